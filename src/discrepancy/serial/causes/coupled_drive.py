"""A motor turns with two joints, so that its friction and its rotor act on both."""

import numpy as np

from discrepancy.serial.causes.base import Cause, partner


class CoupledDrive(Cause):
    """A motor that turns with this joint plus ``ratio`` times the one before: rubs, and has inertia, at that speed."""

    title = "coupled drive of {pair}"
    family = "coupling"
    part = "pair"
    dry = True
    parameters = ("coulomb_Nm", "viscous_Nms_per_rad", "armature_kgm2")
    scales = (1.0, 1.0, 0.1)
    positive = parameters
    reversible = True
    separate = "Motions of one of the two joints alone."

    def sentence(self, n):
        sum_ = "sum" if n.values["ratio"] > 0 else "difference"
        return (
            f"a motor turns with their {sum_}; there it rubs with {n('coulomb_Nm', 'N m', signed=True)} (Coulomb) and "
            f"{n('viscous_Nms_per_rad', 'N m s/rad', signed=True)} (viscous), and its rotor adds "
            f"{n('armature_kgm2', 'kg m^2', signed=True)}"
        )

    def columns(self, signals, at, shape):
        before = partner(signals.tree, at)
        both = np.zeros(signals.q.shape[1])
        both[at], both[before] = 1.0, shape["ratio"]
        v, a = signals.dq @ both, signals.ddq @ both
        slow = float(np.abs(both) @ signals.slow)
        motor = np.column_stack([np.clip(v / slow, -1.0, 1.0), v, a])
        return motor[:, None, :] * both[:, None]

    def shapes(self, hints, at):
        told = float(hints.couplings[at])
        if np.isfinite(told):
            return [{"ratio": told}] if told else []
        return [{"ratio": 1.0}, {"ratio": -1.0}]

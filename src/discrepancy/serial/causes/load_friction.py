"""Dry friction that grows with the load on the gear."""

import numpy as np

from discrepancy.serial.causes.base import Cause, at_joint, direction
from estimator.filtering import low_pass


class LoadFriction(Cause):
    """Teeth and bearings rub in proportion to the torque that they pass on.

    Counted from the typical load on, so that ``friction`` means the same with and without it.
    """

    title = "load-dependent friction in {joint}"
    family = "load_friction"
    dry = True
    laden = True
    parameters = ("share",)
    scales = (0.05,)
    positive = ("share",)
    reversible = True
    separate = "The same steady motion under several loads, such as two poses or two payloads."

    def sentence(self, n):
        return (
            f"dry friction is as large as said under a load of {n('load_Nm', 'N m')}, and changes by "
            f"{n('share', '%', 100.0, signed=True)} of what the load differs"
        )

    def columns(self, signals, at, shape):
        slow = float(signals.slow[at])
        # Noise of the accelerations has no sign, and would be a load where there is none.
        load = signals.inverse[:, at] - signals.tree.armature[at] * signals.ddq[:, at]
        load = np.abs(low_pass(load, signals.rate_hz, signals.cutoff_hz))
        return at_joint(signals, at, direction(signals, at, slow) * (load - shape["load_Nm"]))

    def shapes(self, hints, at):
        return [{"load_Nm": float(hints.load[at])}]

"""The joint's gear or the link bends."""

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause
from discrepancy.serial.mechanics.regressor import rigid_torque, torque_of
from estimator.filtering import differentiate, low_pass


class Elasticity(Cause):
    """Behind the encoder the joint yields to its load, so that the link is where the model does not have it."""

    title = "elasticity of {joint}"
    family = "elasticity"
    laden = True
    parameters = ("compliance_rad_per_Nm",)
    scales = (1e-4,)
    positive = ("compliance_rad_per_Nm",)
    separate = "A known torque on the link with the motor held, and a dial gauge."

    def sentence(self, n):
        return f"yields by {n('compliance_rad_per_Nm', 'mrad per N m', 1e3)} behind its encoder"

    def columns(self, signals, at, shape):
        # Its second derivative is in the trace, and with it the noise of the load's own accelerations.
        cutoff = rules.LOAD_CUTOFF_SHARE * signals.cutoff_hz
        load = low_pass(signals.inverse[:, at], signals.rate_hz, cutoff)
        return along(signals, at, -load)[..., None]


def along(signals, at: int, way: np.ndarray) -> np.ndarray:
    """Change of the nominal torques per unit of a change of one joint's position over time, shape (W, J).

    Args:
        signals: of one log.
        at: the joint.
        way: in which direction and how far, shape (W,).
    """
    size = float(np.abs(way).max())
    if size == 0.0:
        return np.zeros_like(signals.q)
    step = (rules.STEP_M if signals.tree.slides[at] else rules.STEP_RAD) / size
    first = differentiate(way, signals.rate_hz)
    moved = []
    for x, change in (
        (signals.q, way),
        (signals.dq, first),
        (signals.ddq, differentiate(first, signals.rate_hz)),
    ):
        other = x.copy()
        other[:, at] += step * change
        moved.append(other)
    return (torque_of(signals.tree, *moved) - rigid_torque(signals.motion)) / step

"""Something hangs at the last link that the model does not have."""

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause
from discrepancy.serial.mechanics.regressor import body_regressor, inertial_parameters

AXES: tuple[str, ...] = ("x_m", "y_m", "z_m")


class Payload(Cause):
    """A payload at the last link, as a ball of an even size about some point of that link's frame."""

    title = "payload at {link}"
    family = "inertia"
    part = "link"
    parameters = ("mass_kg",)
    scales = (1.0,)
    positive = ("mass_kg",)
    separate = "The arm without it."

    def sentence(self, n):
        at = ", ".join(n(axis, "", 1e3, signed=True) for axis in AXES)
        return (
            f"carries {n('mass_kg', 'kg', signed=True)} more than modelled, centred at ({at}) mm of its frame"
        )

    def columns(self, signals, at, shape):
        centre = np.array([shape[axis] for axis in AXES])
        ball = rules.PAYLOAD_GYRATION_M**2 * np.eye(3)
        body = int(signals.tree.joint_body[at])
        return (body_regressor(signals.motion, body) @ inertial_parameters(1.0, centre, ball))[..., None]

    def shapes(self, hints, at):
        away = [sign * d * e for d in rules.PAYLOAD_M for e in np.eye(3) for sign in (1.0, -1.0)]
        return [dict(zip(AXES, map(float, c), strict=True)) for c in (np.zeros(3), *away)]

    def finer(self, shape):
        return [dict(shape) | {a: shape[a] + d} for a in AXES for d in rules.PAYLOAD_FINER_M]

    def steps(self, shape):
        return {axis: rules.PAYLOAD_STEP_M for axis in AXES}

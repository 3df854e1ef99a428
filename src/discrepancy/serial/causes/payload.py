"""Something hangs at the last link that the model does not have."""

from discrepancy.serial.causes.base import Cause
from discrepancy.serial.mechanics.regressor import body_regressor


class Payload(Cause):
    """A payload at the last link: its mass and first moments in that link's frame."""

    title = "payload at {link}"
    family = "inertia"
    part = "link"
    parameters = ("mass_kg", "moment_x_kgm", "moment_y_kgm", "moment_z_kgm")
    scales = (1.0, 0.1, 0.1, 0.1)
    positive = ("mass_kg",)
    separate = "The arm without it."

    def sentence(self, n):
        return f"carries {n('mass_kg', 'kg')}, with first moments of {n.vector('moment', 'kgm').replace('kgm', 'kg m')}"

    def columns(self, signals, at, shape):
        return body_regressor(signals.motion, int(signals.tree.joint_body[at]))[..., :4]

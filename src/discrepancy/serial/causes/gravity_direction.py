"""The base is not level."""

import numpy as np
from scipy.spatial.transform import Rotation

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause
from discrepancy.serial.mechanics.shift import by_acceleration
from discrepancy.serial.rows.moved import with_tree


class GravityDirection(Cause):
    """The base is tilted about two horizontal axes of the model."""

    title = "tilt of the base"
    family = "tilt"
    part = "arm"
    where = "base"
    laden = True
    parameters = ("tilt_1_rad", "tilt_2_rad")
    tolerances = (rules.LEVEL_RAD, rules.LEVEL_RAD)
    separate = "A level on the base."

    def sentence(self, n):
        first, second = n("tilt_1_rad", "mrad", 1e3, signed=True), n("tilt_2_rad", "mrad", 1e3, signed=True)
        return f"is tilted by {first} and {second} about the two horizontal axes"

    def shapes(self, hints, at):
        return [{}]

    def applied(self, signals, at, values, shape):
        way = np.array(horizontal(signals.tree.gravity)).T @ values
        return with_tree(signals, gravity=Rotation.from_rotvec(-way).apply(signals.tree.gravity))

    def columns(self, signals, at, shape):
        # Turning the base by t turns gravity in its frame by -t, to first order; all seems to accelerate by -g.
        turned = [-np.cross(axis, signals.tree.gravity) for axis in horizontal(signals.tree.gravity)]
        return -np.einsum("wji,ki->wjk", by_acceleration(signals.motion), np.array(turned))


def horizontal(gravity: np.ndarray) -> list[np.ndarray]:
    """Two unit vectors across gravity: where that is along z, x and y; none where there is no gravity."""
    size = float(np.linalg.norm(gravity))
    if size == 0.0:
        return [np.zeros(3), np.zeros(3)]
    up = -gravity / size
    axis = np.eye(3)[0] if abs(up[0]) < 0.9 else np.eye(3)[1]
    first = axis - up * (axis @ up)
    first /= np.linalg.norm(first)
    return [first, np.cross(up, first)]

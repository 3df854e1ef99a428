"""A link's centre of mass is elsewhere."""

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause
from discrepancy.serial.mechanics.regressor import body_regressor, inertial_parameters
from discrepancy.serial.rows.moved import with_tree


class LinkCom(Cause):
    """The centre of mass of a link is off, in the link's frame."""

    title = "centre of mass of {link}"
    family = "inertia"
    part = "link"
    built = True
    parameters = ("x_m", "y_m", "z_m")
    scales = (0.01,) * 3
    separate = "The link balanced on an edge."

    def sentence(self, n):
        x, y, z = (n(f"{axis}_m", "mm", 1e3, signed=True) for axis in "xyz")
        return f"has its centre of mass off by ({x}, {y}, {z})"

    def normal(self, tree, at):
        return [rules.INERTIA_SHARE * _size(tree, int(tree.joint_body[at]))] * 3

    def sizes(self, tree, at):
        return self.normal(tree, at)

    def most(self, tree, at):
        return [rules.MOST_INERTIA_SHARE * _size(tree, int(tree.joint_body[at]))] * 3

    def possible(self, tree, at, values, se):
        most = self.most(tree, at)[0]
        return bool(np.all(np.abs(values) < most + 2.0 * se))

    def applied(self, signals, at, values, shape):
        tree, b = signals.tree, int(signals.tree.joint_body[at])
        here = np.arange(len(tree.mass)) == b
        return with_tree(signals, com=tree.com + here[:, None] * values)

    def columns(self, signals, at, shape):
        b = int(signals.tree.joint_body[at])
        return body_regressor(signals.motion, b) @ _slopes(signals.tree, b)

    def exact(self, signals, at, values, shape):
        tree, b = signals.tree, int(signals.tree.joint_body[at])
        new, old = (
            inertial_parameters(tree.mass[b], tree.com[b] + by, tree.inertia[b])
            for by in (values, 0.0 * values)
        )
        return body_regressor(signals.motion, b) @ (new - old)


def _size(tree, body: int) -> float:
    """Of a link [m]: how far its mass is spread, or its centre from its frame."""
    gyration = np.sqrt(np.trace(tree.inertia[body]) / 2.0 / tree.mass[body])
    return max(float(gyration), float(np.linalg.norm(tree.com[body])), rules.LEAST_LINK_M)


def _slopes(tree, body: int) -> np.ndarray:
    """Of the ten inertial parameters by the centre of mass, shape (10, 3)."""
    m, c = tree.mass[body], tree.com[body]
    out = np.zeros((10, 3))
    out[1:4] = m * np.eye(3)
    for k, e in enumerate(np.eye(3)):
        change = m * (2.0 * (c @ e) * np.eye(3) - np.outer(c, e) - np.outer(e, c))
        out[4:, k] = [*np.diag(change), change[0, 1], change[0, 2], change[1, 2]]
    return out

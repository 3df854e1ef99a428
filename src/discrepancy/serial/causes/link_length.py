"""A link is longer or shorter than drawn."""

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause
from discrepancy.serial.mechanics.shift import by_displacement
from discrepancy.serial.rows.moved import with_tree


class LinkLength(Cause):
    """The frame of a link sits elsewhere in the one before it."""

    title = "seat of {link} in the one before it"
    family = "geometry"
    part = "link"
    laden = True
    parameters = ("x_m", "y_m", "z_m")
    tolerances = (rules.LENGTH_M,) * 3
    separate = "A gauge."

    def sentence(self, n):
        x, y, z = (n(f"{axis}_m", "mm", 1e3, signed=True) for axis in "xyz")
        return f"sits off by ({x}, {y}, {z}) in the frame of the link before it"

    def possible(self, tree, at, values, se):
        return bool(np.all(np.abs(values) < self.most(tree, at)))

    def most(self, tree, at):
        return [rules.MOST_LENGTH_M] * 3

    def applied(self, signals, at, values, shape):
        tree, b = signals.tree, int(signals.tree.joint_body[at])
        here = np.arange(len(tree.mass)) == b
        return with_tree(signals, position=tree.position + here[:, None] * values)

    def columns(self, signals, at, shape):
        return by_displacement(signals.motion, int(signals.tree.joint_body[at]))

"""A link's moments of inertia are others."""

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause
from discrepancy.serial.mechanics.regressor import body_regressor
from discrepancy.serial.rows.moved import with_tree

AXES = ("xx", "yy", "zz", "xy", "xz", "yz")


class LinkInertia(Cause):
    """Moments and products of inertia of a link about its centre of mass, along its frame, are off."""

    title = "inertia of {link}"
    family = "inertia"
    part = "link"
    built = True
    parameters = tuple(f"inertia_{axes}_kgm2" for axes in AXES)
    scales = (0.01,) * 6
    separate = "The link swung as a pendulum."

    def sentence(self, n):
        said = ", ".join(f"{axes} {n(f'inertia_{axes}_kgm2', 'kg m^2', signed=True)}" for axes in AXES)
        return f"has its inertia off by {said}"

    def normal(self, tree, at):
        return [rules.INERTIA_SHARE * _size(tree, int(tree.joint_body[at]))] * 6

    def sizes(self, tree, at):
        return self.normal(tree, at)

    def most(self, tree, at):
        return [rules.MOST_INERTIA_SHARE * _size(tree, int(tree.joint_body[at]))] * 6

    def possible(self, tree, at, values, se):
        most = self.most(tree, at)[0]
        if np.any(np.abs(values) > most + 2.0 * se):
            return False
        total = tree.inertia[tree.joint_body[at]] + symmetric(values)
        # A mass has a density nowhere below zero: the second moments of it, not only the moments of inertia.
        second = 0.5 * np.trace(total) * np.eye(3) - total
        return bool(np.linalg.eigvalsh(second)[0] > -2.0 * np.max(se))

    def applied(self, signals, at, values, shape):
        tree, b = signals.tree, int(signals.tree.joint_body[at])
        here = np.arange(len(tree.mass)) == b
        return with_tree(signals, inertia=tree.inertia + here[:, None, None] * symmetric(values))

    def columns(self, signals, at, shape):
        return body_regressor(signals.motion, int(signals.tree.joint_body[at]))[..., 4:]


def _size(tree, body: int) -> float:
    """Mean principal moment of a link [kg m^2]."""
    return max(float(np.trace(tree.inertia[body])) / 3.0, float(tree.mass[body]) * rules.LEAST_LINK_M**2)


def symmetric(values: np.ndarray) -> np.ndarray:
    """The matrix of (xx, yy, zz, xy, xz, yz), shape (3, 3)."""
    xx, yy, zz, xy, xz, yz = values
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

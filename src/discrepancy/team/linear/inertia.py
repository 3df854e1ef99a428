"""What an unknown payload's inertia may be, before its first fit and after: it turns noise of angles into moments."""

import numpy as np

from estimator.arrays import Array, inertia_matrix
from estimator.rigid_team import Shared

INERTIA_OFF = 0.3
"""Share by which the inertia that turns noise into moments may be off. Chosen: then these are off by as much at most;
with none at all, a healthy log of 12 bits left twice its noise."""


def held_inertia(p_1i: Array, mass: float, p_1c: Array) -> Array:
    """Inertia of a payload whose mass lies where it is held, about its centre of mass [kg m^2], shape (3, 3).

    Args:
        p_1i: origins of the grasp frames in {1} [m], shape (N, 3).
        mass: [kg].
        p_1c: centre of mass in {1} [m], shape (3,).
    """
    lever = p_1i - p_1c
    spread = mass * lever.T @ lever / len(lever)
    return np.asarray(np.trace(spread) * np.eye(3) - spread)


def inertia_about_centre(shared: Shared) -> Array:
    """About the centre of mass, in the axes of {1} [kg m^2], shape (3, 3)."""
    mass, c = shared.pi[0], shared.pi[1:4] / shared.pi[0]
    return np.asarray(inertia_matrix(shared.pi[4:]) - mass * (c @ c * np.eye(3) - np.outer(c, c)))


def inertia_is_like_held(shared: Shared) -> Array:
    """Information that an inertia is as it is to within that of a mass where it is held, (6 (N - 1) + 10,).

    It counts beside what trials tell: axes about which a payload hardly turns keep what was taken for them.
    """
    mass, c = shared.pi[0], shared.pi[1:4] / shared.pi[0]
    size = float(np.trace(held_inertia(shared.grasps.p_1i, mass, c))) / 3.0
    known = np.zeros(6 * shared.grasps.robots + 4)
    known[-6:] = 1.0 / max(size, 1e-6) ** 2
    return known


def is_another(a: Shared, b: Shared) -> bool:
    """Whether noise that is turned into moments by a's inertia must be so again, by b's."""
    first, second = inertia_about_centre(a), inertia_about_centre(b)
    return bool(np.linalg.norm(first - second) > INERTIA_OFF * np.linalg.norm(second))

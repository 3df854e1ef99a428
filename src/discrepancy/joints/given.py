"""What a problem takes besides logs and values, and bodies with a load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from estimator.arrays import Array


@dataclass(frozen=True)
class Given:
    """What a problem takes besides logs and values.

    Attributes:
        changed: signals in which causes act; those after them are a reference, in which the model may be wrong, too.
            None: all.
        joints: which have torques, from 0; None: all.
        motors: joints whose torque per unit is fitted to the model.
        back_emf: joints whose drives lose torque to the speed while they are on.
        excluded: causes that are left out.
        tolerances: standard deviations by cause and parameter in place of the usual ones.
        noise: a draw of what the sensors add to the residual, shape (W, J) each; None: not known.
        kept: weight of each sample, shape (W, J) a log; empty: all count.
    """

    changed: int | None = None
    joints: tuple[int, ...] | None = None
    motors: frozenset[int] = frozenset()
    back_emf: frozenset[int] = frozenset()
    excluded: frozenset[str] = frozenset()
    tolerances: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    noise: Sequence[Array] | None = None
    kept: Sequence[Array] = ()


def horizontal(gravity: Array) -> Array:
    """Two horizontal axes, shape (2, 3)."""
    return np.linalg.svd(gravity[None] / max(float(np.linalg.norm(gravity)), 1e-12))[2][1:]


def with_load(mass: float, com: Array, inertia: Array, load: Array) -> tuple[float, Array, Array]:
    """Mass, centre and inertia about it of a body with more inertial parameters, shape (10,)."""
    total = max(mass + float(load[0]), 0.05 * mass)
    centre = (mass * com + load[1:4]) / total
    xx, yy, zz, xy, xz, yz = load[4:]
    more = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def about(c: Array) -> Array:
        return c @ c * np.eye(3) - np.outer(c, c)

    return total, centre, inertia + mass * about(com) + more - total * about(centre)

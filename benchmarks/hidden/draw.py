"""Draw effects on the tables of ``hidden.limits``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from hidden.limits import LIMITS, pendulum_limit_kg
from mocobot.campaign.effects import Ground

LENGTHS_M = (0.08, 0.5)
"""Of pendulums."""


class Tabled:
    """Detection limits of the tables."""

    def at(
        self, cause: str, robot: int | None = None, joint: int | None = None, trial: int | None = None
    ) -> Mapping[str, float]:
        """Of a cause, the same at all its places."""
        return LIMITS[cause]

    def pendulum(self, rng: np.random.Generator) -> tuple[float, float]:
        """A length, and its limit."""
        length = rng.uniform(*LENGTHS_M)
        return length, pendulum_limit_kg(length)


def ground_of(robots: int, p_1c: NDArray[np.float64], moving: Sequence[tuple[int, float, float]]) -> Ground:
    """A ground with the tables' limits."""
    return Ground(robots, p_1c, moving, Tabled())

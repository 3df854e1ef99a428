"""Draw effects on the tables of ``hidden.limits``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hidden.limits import LIMITS, pendulum_limit_kg
from hidden.of_log import Place
from mocobot.campaign.ground import Ground

LENGTHS_M = (0.08, 0.5)
"""Of pendulums."""


@dataclass(frozen=True)
class Tabled:
    """Detection limits of the tables.

    Attributes:
        times: those of a log over the tables', by place; one where it is not there.
    """

    times: Mapping[Place, float] = field(default_factory=dict)

    def at(
        self, cause: str, robot: int | None = None, joint: int | None = None, trial: int | None = None
    ) -> Mapping[str, float]:
        """Of a cause at a place."""
        times = self.times.get((cause, robot, joint, trial), 1.0)
        return {name: times * limit for name, limit in LIMITS[cause].items()}

    def pendulum(self, rng: np.random.Generator) -> tuple[float, float]:
        """A length, and its limit."""
        length = rng.uniform(*LENGTHS_M)
        return length, self.times.get(("slosh", None, None, None), 1.0) * pendulum_limit_kg(length)


def ground_of(robots: int, p_1c: NDArray[np.float64], moving: Sequence[tuple[int, float, float]]) -> Ground:
    """A ground with the tables' limits."""
    return Ground(robots, p_1c, moving, Tabled())

"""What forms have in common: the answer that is right, how they are drawn, and who acts for them in a trial."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mocobot_sim.effects.base import Effect
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.trial.actors import Actor, Reader
from sealed.ground import Ground

Place = dict[str, int]


@dataclass(frozen=True)
class Form(Effect):
    """An effect of the sealed campaign.

    Attributes:
        answer: the cause of the diagnosis' catalogue that is right; None for a law that nobody has listed.
        size: the parameter that makes it larger; its trace is proportional to it as long as it is small.
    """

    answer: ClassVar[str | None] = None
    size: ClassVar[str]

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        """One of a size, everything else at random."""
        raise NotImplementedError

    def known(self) -> dict[str, float]:
        """Parameters of the answer whose true value the form has, by the catalogue's names."""
        return {}

    def law(self) -> dict[str, Any] | None:
        """What nobody has listed: ``place``, ``of`` (what is wrong there), ``variables``, ``formula``, ``amplitude``,
        ``unit``; None for a form of a listed cause."""
        return None

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        """Who acts in a trial."""
        return ()

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """Sensors that misread in it."""
        return ()

    def _edit(self, scene: TeamScene) -> TeamScene:
        return scene


def direction(rng: np.random.Generator) -> np.ndarray:
    """A unit vector, shape (3,)."""
    draw = rng.standard_normal(3)
    return draw / np.linalg.norm(draw)


def near(point: np.ndarray, reach_m: float, rng: np.random.Generator) -> np.ndarray:
    """A point within a ball [m], shape (3,)."""
    return point + reach_m * np.cbrt(rng.uniform()) * direction(rng)


def vector(name: str, unit: str, values: np.ndarray) -> dict[str, float]:
    """Three parameters of a vector."""
    return {f"{name}_{axis}_{unit}": float(value) for axis, value in zip("xyz", values, strict=True)}

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
        either_sign: whether it is drawn with either sign.
        size_is_known: whether the answer has this parameter, too, by the same name and of the same value.
    """

    answer: ClassVar[str | None] = None
    size: ClassVar[str]
    either_sign: ClassVar[bool] = False
    size_is_known: ClassVar[bool] = False

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        """One of a size, everything else at random."""
        value = float(rng.choice([-1.0, 1.0]) * size) if cls.either_sign else size
        return cls(**place, **{cls.size: value}, **cls.others(ground, place, rng))

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        """Parameters besides place and size, drawn."""
        return {}

    def known(self) -> dict[str, float]:
        """Parameters of the answer whose true value the form has, by the catalogue's names."""
        return {self.size: getattr(self, self.size)} if self.size_is_known else {}

    def law(self) -> dict[str, Any] | None:
        """What nobody has listed: ``place``, ``of`` (what is wrong there), ``variables``, ``formula``, ``amplitude``,
        ``unit``, and ``along`` where there is a direction; None for a form of a listed cause."""
        return None

    def told(
        self, of: str, variables: list[str], formula: str, unit: str, along: list[float] | None = None
    ) -> dict[str, Any]:
        """Such a law, ``size`` being its amplitude."""
        place = {name: getattr(self, name) for name in self.place_names()}
        direction = {} if along is None else {"along": along}
        return {"place": place, "of": of, **direction, "variables": variables, "formula": formula,
                "amplitude": getattr(self, self.size), "unit": unit}  # fmt: skip

    def xyz(self, name: str) -> np.ndarray:
        """Three parameters that are a vector [m], shape (3,)."""
        return np.array([getattr(self, f"{name}_{axis}_m") for axis in "xyz"])

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

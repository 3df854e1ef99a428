"""A payload whose mass is not the same at all times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mocobot_sim.trial.actors import Actor, Stage
from sealed.forms.base import Form, Place
from sealed.ground import Ground


@dataclass(frozen=True)
class MassDrift(Form):
    """It loses (or gains) mass all the time, from everywhere alike: sand that runs out, water that runs in."""

    answer = "payload_mass"
    size, either_sign, size_is_known = "rate_kgps", True, True
    on_payload = True
    ranges: ClassVar = {"rate_kgps": (-0.1, 0.1)}
    rate_kgps: float

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        return [_Mass(lambda time: self.rate_kgps * time)]


@dataclass(frozen=True)
class MassOfTrials(Form):
    """It is another one from some trial on: something was taken off or put on."""

    answer = "payload_mass"
    size = "more_kg"
    on_payload = True
    ranges: ClassVar = {"more_kg": (-10.0, 10.0)}
    trial: int
    more_kg: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        return cls(trial=int(rng.integers(2, 4)), more_kg=float(rng.choice([-1.0, 1.0]) * size))

    def known(self) -> dict[str, float]:
        return {"trial": self.trial, "last_trial": 0, "mass_kg": self.more_kg}

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        changed = trial_number is not None and trial_number >= self.trial
        return [_Mass(lambda time: self.more_kg)] if changed else []


class _Mass:
    """Changes the payload's mass, and its inertia in proportion."""

    def __init__(self, more) -> None:
        self._more = more

    def start(self, stage: Stage) -> None:
        self._model, self._body, self._dt = stage.model, stage.index.payload_body, 1.0 / stage.rate_hz
        self._mass = float(self._model.body_mass[self._body])
        self._inertia = self._model.body_inertia[self._body].copy()

    def act(self, tick: int) -> None:
        ratio = 1.0 + self._more(tick * self._dt) / self._mass
        self._model.body_mass[self._body] = ratio * self._mass
        self._model.body_inertia[self._body] = ratio * self._inertia

"""Drag of other forms: with a moment beside its force, and growing with the square or another power of the speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mocobot_sim.trial.actors import Actor
from sealed.forms.base import Form, Place
from sealed.forms.parts import PayloadWrench
from sealed.ground import Ground


@dataclass(frozen=True)
class TurningDrag(Form):
    """Force -c v at the centre of mass, and moment -c r^2 omega."""

    answer = "drag"
    size, size_is_known = "coefficient_Ns_per_m", True
    on_payload = True
    ranges: ClassVar = {"coefficient_Ns_per_m": (0.0, 1e3), "reach_m": (0.0, 10.0)}
    coefficient_Ns_per_m: float
    reach_m: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"reach_m": float(rng.uniform(0.2, 0.6))}

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        c, turn = self.coefficient_Ns_per_m, self.coefficient_Ns_per_m * self.reach_m**2
        return [PayloadWrench(lambda t, p, v, w: (-c * v, -turn * w))]


@dataclass(frozen=True)
class QuadraticDrag(Form):
    """Force -c |v| v at the centre of mass, and moment -c r^3 |omega| omega."""

    answer = "drag"
    size = "coefficient_Ns2_per_m2"
    on_payload = True
    ranges: ClassVar = {"coefficient_Ns2_per_m2": (0.0, 1e4), "reach_m": (0.0, 10.0)}
    coefficient_Ns2_per_m2: float
    reach_m: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"reach_m": float(rng.uniform(0.1, 0.4))}

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        c, turn = self.coefficient_Ns2_per_m2, self.coefficient_Ns2_per_m2 * self.reach_m**3
        return [
            PayloadWrench(
                lambda t, p, v, w: (-c * float(np.sqrt(v @ v)) * v, -turn * float(np.sqrt(w @ w)) * w)
            )
        ]


@dataclass(frozen=True)
class PowerDrag(Form):
    """Force -c |v|^(n-1) v at the centre of mass, and moment -c r^(n+1) |omega|^(n-1) omega: between the two."""

    answer = "drag"
    size = "coefficient"
    on_payload = True
    ranges: ClassVar = {"coefficient": (0.0, 1e4), "exponent": (1.0, 2.0), "reach_m": (0.0, 10.0)}
    coefficient: float
    exponent: float
    reach_m: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"exponent": float(rng.uniform(1.3, 1.7)), "reach_m": float(rng.uniform(0.1, 0.4))}

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        c, turn = self.coefficient, self.coefficient * self.reach_m ** (self.exponent + 1.0)

        def power(v: np.ndarray) -> np.ndarray:
            speed = float(np.sqrt(v @ v))
            return speed ** (self.exponent - 1.0) * v if speed else v

        return [PayloadWrench(lambda t, p, v, w: (-c * power(v), -turn * power(w)))]

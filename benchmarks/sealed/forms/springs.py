"""Hysteresis inside a spring, of another form than Coulomb's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mocobot_sim.trial.actors import Actor
from sealed.forms.base import Form, Place
from sealed.forms.parts import JointTorque
from sealed.ground import Ground
from sealed.laws.hysteresis import BoucWen


@dataclass(frozen=True)
class BoucWenSpring(Form):
    """Bouc-Wen's torque beside a spring: the link feels it, the reading is the deflection's alone."""

    answer = "sea_hysteresis"
    size = "force_Nm"
    ranges: ClassVar = {
        "force_Nm": (0.0, 20.0), "yield_rad": (1e-5, 0.1), "beta": (0.5, 1.0), "exponent": (1.0, 5.0),
    }  # fmt: skip
    robot: int
    joint: int
    force_Nm: float
    yield_rad: float
    beta: float
    exponent: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {
            "yield_rad": float(rng.uniform(3e-4, 3e-3)),
            "beta": float(rng.uniform(0.5, 0.8)),
            "exponent": float(rng.uniform(1.0, 2.0)),
        }

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        law = BoucWen(self.force_Nm, self.yield_rad, self.beta, self.exponent)
        return [JointTorque("spring", self.robot, self.joint, lambda q, v, t, dt: -law.step(v, dt))]

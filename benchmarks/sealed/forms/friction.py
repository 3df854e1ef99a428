"""Friction of driven joints and gimbals with bristles: LuGre, with and without Stribeck's peak, and Dahl."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mocobot_sim.trial.actors import Actor
from sealed.forms.base import Form, Place
from sealed.forms.parts import JointTorque, Kind
from sealed.ground import Ground
from sealed.laws.friction import Dahl, Lugre

POSITIVE = (0.0, 1e4)


@dataclass(frozen=True)
class _Lugre(Form):
    """LuGre friction; the bristles' own damping is a millisecond's worth of their stiffness."""

    kind: ClassVar[Kind]
    size: ClassVar = "coulomb_Nm"
    ranges: ClassVar = {
        "coulomb_Nm": POSITIVE, "static_ratio": (1.0, 5.0), "stribeck_radps": (1e-4, 10.0),
        "presliding_rad": (1e-5, 0.1), "viscous_Nms_per_rad": POSITIVE,
    }  # fmt: skip
    robot: int
    joint: int
    coulomb_Nm: float
    static_ratio: float
    stribeck_radps: float
    presliding_rad: float
    viscous_Nms_per_rad: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        return cls(
            **place,
            coulomb_Nm=size,
            static_ratio=float(rng.choice([1.0, rng.uniform(1.2, 1.8)])),
            stribeck_radps=float(rng.uniform(0.01, 0.05)),
            presliding_rad=float(rng.uniform(2e-4, 1e-3)),
            viscous_Nms_per_rad=float(size * rng.uniform(0.0, 0.5)),
        )

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        bristle = self.coulomb_Nm / self.presliding_rad
        law = Lugre(
            self.coulomb_Nm, self.static_ratio * self.coulomb_Nm, self.stribeck_radps, bristle, 1e-3 * bristle,
            self.viscous_Nms_per_rad,
        )  # fmt: skip
        return [JointTorque(self.kind, self.robot, self.joint, lambda q, v, t, dt: -law.step(v, dt))]


@dataclass(frozen=True)
class DrivenLugre(_Lugre):
    """Of a driven link against the chassis."""

    answer = "joint_friction"
    kind = "driven"


@dataclass(frozen=True)
class GimbalLugre(_Lugre):
    """Of a gimbal axis."""

    answer = "gimbal_friction"
    kind = "gimbal"


@dataclass(frozen=True)
class _Dahl(Form):
    """Dahl friction."""

    kind: ClassVar[Kind]
    size: ClassVar = "coulomb_Nm"
    ranges: ClassVar = {
        "coulomb_Nm": POSITIVE,
        "rest_way_rad": (1e-5, 0.1),
        "viscous_Nms_per_rad": POSITIVE,
    }
    robot: int
    joint: int
    coulomb_Nm: float
    rest_way_rad: float
    viscous_Nms_per_rad: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        viscous = float(size * rng.uniform(0.0, 0.5))
        return cls(
            **place,
            coulomb_Nm=size,
            rest_way_rad=float(rng.uniform(5e-4, 4e-3)),
            viscous_Nms_per_rad=viscous,
        )

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        law = Dahl(self.coulomb_Nm, self.coulomb_Nm / self.rest_way_rad, self.viscous_Nms_per_rad)
        return [JointTorque(self.kind, self.robot, self.joint, lambda q, v, t, dt: -law.step(v, dt))]


@dataclass(frozen=True)
class DrivenDahl(_Dahl):
    """Of a driven link against the chassis."""

    answer = "joint_friction"
    kind = "driven"


@dataclass(frozen=True)
class GimbalDahl(_Dahl):
    """Of a gimbal axis."""

    answer = "gimbal_friction"
    kind = "gimbal"

"""Torques in joints that no catalogue has."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mocobot_sim.trial.actors import Actor
from sealed.forms.base import Form, Place
from sealed.forms.parts import JointTorque, Kind
from sealed.ground import Ground


@dataclass(frozen=True)
class _Torque(Form):
    """A torque in one joint."""

    kind: ClassVar[Kind]
    robot: int
    joint: int

    def _law(self, variable: str, formula: str, unit: str) -> dict[str, Any]:
        where = "torque in driven joint" if self.kind == "driven" else "torque in gimbal axis"
        return self.told(where, [variable], formula, unit)

    @abstractmethod
    def torque(self, angle: float, rate: float, time: float) -> float:
        """On the link [N m]."""

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        return [JointTorque(self.kind, self.robot, self.joint, lambda q, v, t, dt: self.torque(q, v, t))]


@dataclass(frozen=True)
class Cogging(_Torque):
    """A driven link that feels the poles of a motor beside its spring."""

    kind = "driven"
    size = "amplitude_Nm"
    ranges: ClassVar = {"amplitude_Nm": (0.0, 20.0)}
    amplitude_Nm: float
    times: float
    phase_rad: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"times": float(rng.integers(8, 25)), "phase_rad": float(rng.uniform(-np.pi, np.pi))}

    def law(self) -> dict[str, Any]:
        formula = f"a sin({self.times:.0f} phi + {self.phase_rad:.3g})"
        return self._law("own phi, from home", formula, "N m")

    def torque(self, angle: float, rate: float, time: float) -> float:
        return self.amplitude_Nm * math.sin(self.times * angle + self.phase_rad)


@dataclass(frozen=True)
class CubicSpring(_Torque):
    """A bundle of cables through a gimbal axis that resists the more the further it is turned."""

    kind = "gimbal"
    size = "cubic_Nm_per_rad3"
    ranges: ClassVar = {"cubic_Nm_per_rad3": (0.0, 1e5)}
    cubic_Nm_per_rad3: float

    def law(self) -> dict[str, Any]:
        return self._law("own theta", "-a theta^3", "N m/rad^3")

    def torque(self, angle: float, rate: float, time: float) -> float:
        return -self.cubic_Nm_per_rad3 * angle**3


@dataclass(frozen=True)
class CableSpring(_Torque):
    """A bundle of cables that pulls a gimbal axis back to an angle of its own."""

    kind = "gimbal"
    size = "stiffness_Nm_per_rad"
    ranges: ClassVar = {"stiffness_Nm_per_rad": (0.0, 1e4)}
    stiffness_Nm_per_rad: float
    rest_rad: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"rest_rad": float(rng.uniform(-0.1, 0.1))}

    def law(self) -> dict[str, Any]:
        return self._law("own theta", f"-a (theta - {self.rest_rad:.3g})", "N m/rad")

    def torque(self, angle: float, rate: float, time: float) -> float:
        return -self.stiffness_Nm_per_rad * (angle - self.rest_rad)


@dataclass(frozen=True)
class DoorCloser(_Torque):
    """A driven link that is braked in one direction only."""

    kind = "driven"
    size = "damping_Nms_per_rad"
    ranges: ClassVar = {"damping_Nms_per_rad": (0.0, 100.0)}
    damping_Nms_per_rad: float

    def law(self) -> dict[str, Any]:
        return self._law("own phi rate", "-a max(phi_dot, 0)", "N m s/rad")

    def torque(self, angle: float, rate: float, time: float) -> float:
        return -self.damping_Nms_per_rad * max(rate, 0.0)

"""Torques, wrenches and displacements that nobody lists."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mocobot.campaign.effects import REACH_M
from mocobot_sim.effects.base import precise
from mocobot_sim.effects.geometry import ARMATURE_KG, DAMPING_NS_PER_M, TOLERANCE, add_slides
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.trial.actors import Actor, Stage
from sealed.form import (
    Form,
    Ground,
    JointTorque,
    Kind,
    PayloadWrench,
    Place,
    PointForce,
    direction,
    near,
    vector,
)


@dataclass(frozen=True)
class _Torque(Form):
    """A torque in one joint."""

    kind: ClassVar[Kind]
    robot: int
    joint: int

    @abstractmethod
    def torque(self, angle: float, rate: float, time: float) -> float:
        """On the link [N m]."""

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        return [JointTorque(self.kind, self.robot, self.joint, lambda q, v, t, dt: self.torque(q, v, t))]

    def law(self) -> dict[str, Any] | None:
        law = super().law()
        return law and law | {"of": f"torque in {'driven joint' if self.kind == 'driven' else 'gimbal axis'}"}


@dataclass(frozen=True)
class Cogging(_Torque):
    """A driven link that feels the poles of a motor beside its spring."""

    kind, size = "driven", "amplitude_Nm"
    ranges: ClassVar = {"amplitude_Nm": (0.0, 20.0)}
    formula: ClassVar = (["own phi, from home"], "a sin({times:.0f} phi + {phase_rad:.3g})", "N m")
    amplitude_Nm: float
    times: float
    phase_rad: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"times": float(rng.integers(8, 25)), "phase_rad": float(rng.uniform(-np.pi, np.pi))}

    def torque(self, angle: float, rate: float, time: float) -> float:
        return self.amplitude_Nm * math.sin(self.times * angle + self.phase_rad)


@dataclass(frozen=True)
class CubicSpring(_Torque):
    """A bundle of cables through a gimbal axis that resists the more the further it is turned."""

    kind, size = "gimbal", "cubic_Nm_per_rad3"
    ranges: ClassVar = {"cubic_Nm_per_rad3": (0.0, 1e5)}
    formula: ClassVar = (["own theta"], "-a theta^3", "N m/rad^3")
    cubic_Nm_per_rad3: float

    def torque(self, angle: float, rate: float, time: float) -> float:
        return -self.cubic_Nm_per_rad3 * angle**3


@dataclass(frozen=True)
class CableSpring(_Torque):
    """A bundle of cables that pulls a gimbal axis back to an angle of its own."""

    kind, size = "gimbal", "stiffness_Nm_per_rad"
    ranges: ClassVar = {"stiffness_Nm_per_rad": (0.0, 1e4)}
    draws: ClassVar = {"rest_rad": (-0.1, 0.1)}
    formula: ClassVar = (["own theta"], "-a (theta - {rest_rad:.3g})", "N m/rad")
    stiffness_Nm_per_rad: float
    rest_rad: float

    def torque(self, angle: float, rate: float, time: float) -> float:
        return -self.stiffness_Nm_per_rad * (angle - self.rest_rad)


@dataclass(frozen=True)
class _Force(Form):
    """A force on a point of the payload, given in {1}, in a direction of robot 1's {b}."""

    on_payload = True
    of = "force on the payload, in the world"
    along_x_m: float
    along_y_m: float
    along_z_m: float
    point_x_m: float
    point_y_m: float
    point_z_m: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        where = vector("along", "m", direction(rng)) | vector("point", "m", near(ground.p_1c, REACH_M, rng))
        return where | super().others(ground, place, rng)

    @abstractmethod
    def force(self, time: float) -> float:
        """Along its direction [N]."""

    def along(self) -> list[float]:
        return self.xyz("along").tolist()

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        along = self.xyz("along")
        return [PointForce(lambda time: along * self.force(time), self.xyz("point"))]


@dataclass(frozen=True)
class GrowingPush(_Force):
    """It grows from nothing through every trial."""

    size = "rate_Nps"
    ranges: ClassVar = {"rate_Nps": (0.0, 10.0)}
    formula: ClassVar = (["t"], "a t", "N/s")
    rate_Nps: float = 0.0

    def force(self, time: float) -> float:
        return self.rate_Nps * time


@dataclass(frozen=True)
class Gyroscope(Form):
    """Something that spins in the payload: a moment omega x h, with h fixed in the payload."""

    on_payload = True
    size, of = "spin_kgm2ps", "moment on the payload"
    ranges: ClassVar = {"spin_kgm2ps": (0.0, 1e3)}
    formula: ClassVar = (["payload's angular velocity"], "-omega x h", "kg m^2/s")
    spin_kgm2ps: float
    along_x_m: float
    along_y_m: float
    along_z_m: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return vector("along", "m", direction(rng))

    def along(self) -> list[float]:
        return self.xyz("along").tolist()

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        spin = self.spin_kgm2ps * self.xyz("along")
        # The payload turns by some degrees only, so its axes are the world's but for that.
        return [PayloadWrench(lambda t, p, v, w: (np.zeros(3), -np.cross(w, spin)))]


@dataclass(frozen=True)
class SinkingBase(Form):
    """A base that sinks into the floor, fast at first, in every trial anew."""

    size, of = "depth_m", "displacement of the base, down"
    ranges: ClassVar = {"depth_m": (0.0, 0.1), "time_s": (0.1, 1e4)}
    draws: ClassVar = {"time_s": (6.0, 20.0)}
    formula: ClassVar = (["t"], "a (1 - exp(-t / {time_s:.3g} s))", "m")
    robot: int
    depth_m: float
    time_s: float

    def _edit(self, scene: TeamScene) -> TeamScene:
        precise(scene, TOLERANCE)
        chassis = scene.root.find("body", f"omnid{self.robot}/chassis")
        add_slides(chassis, "sink", "z", armature=ARMATURE_KG, damping=DAMPING_NS_PER_M, stiffness=1.0)
        return scene

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        return [_Sinks(self)]


class _Sinks:
    """Pulls the slide as its damping asks for."""

    def __init__(self, sinking: SinkingBase) -> None:
        self._sinking = sinking

    def start(self, stage: Stage) -> None:
        sinking = self._sinking
        self._data, self._dt = stage.data, 1.0 / stage.rate_hz
        self._dof = int(stage.model.joint(f"omnid{sinking.robot}/sink_z").dofadr[0])
        self._force = -DAMPING_NS_PER_M * sinking.depth_m / sinking.time_s

    def act(self, tick: int) -> None:
        decay = math.exp(-tick * self._dt / self._sinking.time_s)
        self._data.qfrc_applied[self._dof] += self._force * decay

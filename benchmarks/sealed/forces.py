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

SLACK_RAD = 0.03
"""Angle within which a hose hangs loose."""


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
class SlackHose(_Torque):
    """A hose through a gimbal axis that hangs loose, then resists with the square of the angle."""

    kind, size = "gimbal", "square_Nm_per_rad2"
    ranges: ClassVar = {"square_Nm_per_rad2": (0.0, 1e4)}
    formula: ClassVar = (
        ["own theta"], f"-a (theta beyond +-{SLACK_RAD:g}) |theta beyond|", "N m/rad^2"
    )  # fmt: skip
    square_Nm_per_rad2: float

    def torque(self, angle: float, rate: float, time: float) -> float:
        return -self.square_Nm_per_rad2 * math.copysign(max(abs(angle) - SLACK_RAD, 0.0) ** 2, angle)


@dataclass(frozen=True)
class DoorCloser(_Torque):
    """A driven link that is braked in one direction only."""

    kind, size = "driven", "damping_Nms_per_rad"
    ranges: ClassVar = {"damping_Nms_per_rad": (0.0, 100.0)}
    formula: ClassVar = (["own phi rate"], "-a max(phi_dot, 0)", "N m s/rad")
    damping_Nms_per_rad: float

    def torque(self, angle: float, rate: float, time: float) -> float:
        return -self.damping_Nms_per_rad * max(rate, 0.0)


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
class Shaker(_Force):
    """Something unbalanced that turns on the payload."""

    size = "amplitude_N"
    ranges: ClassVar = {"amplitude_N": (0.0, 1e3), "frequency_hz": (0.05, 200.0)}
    draws: ClassVar = {"frequency_hz": (0.9, 3.5)}
    formula: ClassVar = (["t"], "a sin(2 pi {frequency_hz:.4g} Hz t)", "N")
    amplitude_N: float = 0.0
    frequency_hz: float = 1.0

    def force(self, time: float) -> float:
        return self.amplitude_N * math.sin(2.0 * np.pi * self.frequency_hz * time)


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
class ShiftingLoad(Form):
    """A mass on a slow spring in the payload: it shifts sideways as the payload is tilted or hurried."""

    on_payload = True
    size, of = "mass_kg", "force and moment on the payload"
    ranges: ClassVar = {"mass_kg": (0.0, 100.0), "frequency_hz": (0.1, 100.0)}
    draws: ClassVar = {"frequency_hz": (0.8, 1.6), "heading_rad": (-np.pi, np.pi)}
    formula: ClassVar = (
        ["payload's tilt and acceleration"],
        "mass that slides on a spring of {frequency_hz:.3g} Hz, damping ratio 0.7",
        "kg",
    )
    mass_kg: float
    frequency_hz: float
    heading_rad: float
    point_x_m: float
    point_y_m: float
    point_z_m: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        drawn = super().others(ground, place, rng)
        return drawn | vector("point", "m", near(ground.p_1c, REACH_M, rng))

    def along(self) -> list[float]:
        return [math.cos(self.heading_rad), math.sin(self.heading_rad), 0.0]

    def _edit(self, scene: TeamScene) -> TeamScene:
        payload = scene.root.find("body", "omnid1/payload/payload")
        body = payload.add("body", name="load", pos=self.xyz("point"))
        omega = 2.0 * np.pi * self.frequency_hz
        body.add(
            "joint", name="load", type="slide", axis=[np.cos(self.heading_rad), np.sin(self.heading_rad), 0.0],
            stiffness=self.mass_kg * omega**2, damping=1.4 * self.mass_kg * omega, group=3,
        )  # fmt: skip
        body.add("inertial", pos=[0.0, 0.0, 0.0], mass=self.mass_kg, diaginertia=[1e-4 * self.mass_kg] * 3)
        return scene


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

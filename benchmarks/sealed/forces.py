"""Torques, wrenches and displacements that nobody lists."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mocobot.campaign.draw import REACH_M
from mocobot_sim.effects.base_creep import ARMATURE_KG, DAMPING_NS_PER_M, TOLERANCE
from mocobot_sim.effects.slides import add_slides
from mocobot_sim.effects.solver import precise
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.trial.actors import Actor, Stage
from mocobot_sim.trial.readings import RobotReadings
from sealed.form import (
    BoucWen,
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
from sealed.readings import Error, Misread, MisreadNow


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


@dataclass(frozen=True)
class _Force(Form):
    """A force on a point of the payload, given in {1}, in a direction of robot 1's {b}."""

    on_payload = True
    along_x_m: float
    along_y_m: float
    along_z_m: float
    point_x_m: float
    point_y_m: float
    point_z_m: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return vector("along", "m", direction(rng)) | vector("point", "m", near(ground.p_1c, REACH_M, rng))

    def _law(self, formula: str, unit: str) -> dict[str, Any]:
        return self.told(
            "force on the payload, in the world", ["t"], formula, unit, self.xyz("along").tolist()
        )

    @abstractmethod
    def force(self, time: float) -> float:
        """Along its direction [N]."""

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        along = self.xyz("along")
        return [PointForce(lambda time: along * self.force(time), self.xyz("point"))]


@dataclass(frozen=True)
class GrowingPush(_Force):
    """It grows from nothing through every trial."""

    size = "rate_Nps"
    ranges: ClassVar = {"rate_Nps": (0.0, 10.0)}
    rate_Nps: float = 0.0

    def law(self) -> dict[str, Any]:
        return self._law("a t", "N/s")

    def force(self, time: float) -> float:
        return self.rate_Nps * time


@dataclass(frozen=True)
class Shaker(_Force):
    """Something unbalanced that turns on the payload."""

    size = "amplitude_N"
    ranges: ClassVar = {"amplitude_N": (0.0, 1e3), "frequency_hz": (0.05, 200.0)}
    amplitude_N: float = 0.0
    frequency_hz: float = 1.0

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        where = super().others(ground, place, rng)
        return where | {"frequency_hz": float(rng.uniform(0.9, 3.5))}

    def law(self) -> dict[str, Any]:
        return self._law(f"a sin(2 pi {self.frequency_hz:.4g} Hz t)", "N")

    def force(self, time: float) -> float:
        return self.amplitude_N * math.sin(2.0 * np.pi * self.frequency_hz * time)


@dataclass(frozen=True)
class Gyroscope(Form):
    """Something that spins in the payload: a moment omega x h, with h fixed in the payload."""

    size = "spin_kgm2ps"
    on_payload = True
    ranges: ClassVar = {"spin_kgm2ps": (0.0, 1e3)}
    spin_kgm2ps: float
    along_x_m: float
    along_y_m: float
    along_z_m: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return vector("along", "m", direction(rng))

    def law(self) -> dict[str, Any]:
        turned, along = ["payload's angular velocity"], self.xyz("along").tolist()
        return self.told("moment on the payload", turned, "-omega x h", "kg m^2/s", along)

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        spin = self.spin_kgm2ps * self.xyz("along")
        # The payload turns by some degrees only, so its axes are the world's but for that.
        return [PayloadWrench(lambda t, p, v, w: (np.zeros(3), -np.cross(w, spin)))]


@dataclass(frozen=True)
class ShiftingLoad(Form):
    """A mass on a slow spring in the payload: it shifts sideways as the payload is tilted or hurried."""

    size = "mass_kg"
    on_payload = True
    ranges: ClassVar = {"mass_kg": (0.0, 100.0), "frequency_hz": (0.1, 100.0)}
    mass_kg: float
    frequency_hz: float
    heading_rad: float
    point_x_m: float
    point_y_m: float
    point_z_m: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        frequency, heading = float(rng.uniform(0.8, 1.6)), float(rng.uniform(-np.pi, np.pi))
        point = vector("point", "m", near(ground.p_1c, REACH_M, rng))
        return {"frequency_hz": frequency, "heading_rad": heading} | point

    def law(self) -> dict[str, Any]:
        felt, along = (
            ["payload's tilt and acceleration"],
            [math.cos(self.heading_rad), math.sin(self.heading_rad), 0.0],
        )
        formula = f"mass that slides on a spring of {self.frequency_hz:.3g} Hz, damping ratio 0.7"
        return self.told("force and moment on the payload", felt, formula, "kg", along)

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

    size = "depth_m"
    ranges: ClassVar = {"depth_m": (0.0, 0.1), "time_s": (0.1, 1e4)}
    robot: int
    depth_m: float
    time_s: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"time_s": float(rng.uniform(6.0, 20.0))}

    def law(self) -> dict[str, Any]:
        return self.told(
            "displacement of the base, down", ["t"], f"a (1 - exp(-t / {self.time_s:.3g} s))", "m"
        )

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


SCRATCH_RAD = 0.05
"""Width of a scratch on an encoder's disc."""
SOFT_NM = 8.0
"""Torque at which a soft saturation is half way."""
YIELD_NM = 0.4
"""Torque over which a loose gauge changes sides."""
SLACK_RAD = 0.03
"""Angle within which a hose hangs loose."""


@dataclass(frozen=True)
class ScratchedDisc(MisreadNow):
    """A driven joint's encoder errs where its disc is scratched, and nowhere else."""

    channel = "phi"
    size = "depth_rad"
    either_sign = True
    ranges: ClassVar = {"depth_rad": (-0.1, 0.1)}
    depth_rad: float
    at_rad: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"at_rad": float(rng.uniform(-0.1, 0.1))}

    def law(self) -> dict[str, Any]:
        return self._law(
            ["own phi, from home"], f"a exp(-((phi - {self.at_rad:.3g}) / {SCRATCH_RAD})^2)", "rad"
        )

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.depth_rad * math.exp(-(((value - self.at_rad) / SCRATCH_RAD) ** 2))


@dataclass(frozen=True)
class SoftSaturation(MisreadNow):
    """A torque sensor that passes ever less of its torque, without a knee."""

    channel = "tau"
    size = "lost_share"
    ranges: ClassVar = {"lost_share": (0.0, 1.0)}
    lost_share: float

    def law(self) -> dict[str, Any]:
        return self._law(["own tau"], f"-a (tau - {SOFT_NM:g} tanh(tau / {SOFT_NM:g}))", "1")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return -self.lost_share * (value - SOFT_NM * math.tanh(value / SOFT_NM))


@dataclass(frozen=True)
class LooseBridge(Misread):
    """A torque sensor with the hysteresis of Bouc and Wen in its reading."""

    channel = "tau"
    size = "amplitude_Nm"
    ranges: ClassVar = {"amplitude_Nm": (0.0, 5.0)}
    amplitude_Nm: float

    def law(self) -> dict[str, Any]:
        return self._law(["own tau, its history"], f"a z(tau), Bouc-Wen over {YIELD_NM:g} N m", "N m")

    def error_of_trial(self) -> Error:
        wen, last = BoucWen(self.amplitude_Nm, YIELD_NM, 0.5, 1.0), [math.nan]

        def error(readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
            rate = 0.0 if math.isnan(last[0]) else value - last[0]
            last[0] = value
            return wen.step(rate, 1.0)

        return error


@dataclass(frozen=True)
class FineInterpolation(MisreadNow):
    """A gimbal encoder whose interpolation errs 64 times a turn."""

    channel = "theta"
    size = "amplitude_rad"
    ranges: ClassVar = {"amplitude_rad": (0.0, 0.1)}
    amplitude_rad: float
    phase_rad: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"phase_rad": float(rng.uniform(-np.pi, np.pi))}

    def law(self) -> dict[str, Any]:
        return self._law(["own theta"], f"a sin(64 theta + {self.phase_rad:.3g})", "rad")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.amplitude_rad * math.sin(64.0 * value + self.phase_rad)


@dataclass(frozen=True)
class SlackHose(_Torque):
    """A hose through a gimbal axis that hangs loose, then resists with the square of the angle."""

    kind = "gimbal"
    size = "square_Nm_per_rad2"
    ranges: ClassVar = {"square_Nm_per_rad2": (0.0, 1e4)}
    square_Nm_per_rad2: float

    def law(self) -> dict[str, Any]:
        return self._law("own theta", f"-a (theta beyond +-{SLACK_RAD:g}) |theta beyond|", "N m/rad^2")

    def torque(self, angle: float, rate: float, time: float) -> float:
        return -self.square_Nm_per_rad2 * math.copysign(max(abs(angle) - SLACK_RAD, 0.0) ** 2, angle)

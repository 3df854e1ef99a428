"""Forms at joints, grasps and bases that the catalogue lists with another law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from mocobot_sim.effects.base import precise
from mocobot_sim.effects.geometry import (
    ARMATURE_KG,
    DAMPING_NS_PER_M,
    LOOSE_ARMATURE_KG,
    SPRUNG_ARMATURE_KG,
    TOLERANCE,
    add_slides,
    add_springs,
    base_slides,
    grasp_body,
    widened,
)
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.scene.soft import spring_parameters
from mocobot_sim.trial.actors import Actor, Misreading, Reader, RobotReadings, Stage
from sealed.form import BoucWen, Dahl, Form, Ground, JointTorque, Kind, Lugre, Place, SecondOrderLag

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
    """In a driven link against the chassis."""

    answer = "joint_friction"
    kind = "driven"


@dataclass(frozen=True)
class GimbalLugre(_Lugre):
    """In a gimbal axis."""

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
    """In a driven link against the chassis."""

    answer = "joint_friction"
    kind = "driven"


@dataclass(frozen=True)
class GimbalDahl(_Dahl):
    """In a gimbal axis."""

    answer = "gimbal_friction"
    kind = "gimbal"


@dataclass(frozen=True)
class BoucWenSpring(Form):
    """Bouc-Wen's torque beside a spring: the link feels it, the reading is the deflection's alone."""

    answer = "sea_hysteresis"
    size = "force_Nm"
    ranges: ClassVar = {
        "force_Nm": (0.0, 20.0), "yield_rad": (1e-5, 0.1), "beta": (0.5, 1.0), "exponent": (1.0, 5.0),
    }  # fmt: skip
    draws: ClassVar = {"yield_rad": (3e-4, 3e-3), "beta": (0.5, 0.8), "exponent": (1.0, 2.0)}
    robot: int
    joint: int
    force_Nm: float
    yield_rad: float
    beta: float
    exponent: float

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        law = BoucWen(self.force_Nm, self.yield_rad, self.beta, self.exponent)
        return [JointTorque("spring", self.robot, self.joint, lambda q, v, t, dt: -law.step(v, dt))]


def _late(robot: int, joints: Sequence[int], time_s: float, damping_ratio: float) -> Misreading:
    """Sensors of some joints behind a lag of second order that is late by a time [s]."""
    laws: dict[int, SecondOrderLag] = {}

    def ready(dt: float) -> None:
        frequency = damping_ratio / (np.pi * time_s)
        laws.update({joint: SecondOrderLag(frequency, damping_ratio, dt) for joint in joints})

    def change(readings: RobotReadings, seen: np.ndarray, time: float) -> None:
        for joint, law in laws.items():
            readings.set_tau(seen, joint, law.step(readings.tau(seen, joint)))

    return Misreading(robot, change, ready)


@dataclass(frozen=True)
class SecondOrderTorqueLag(Form):
    """All torque sensors of a robot: second order, late by ``time_constant_s``."""

    answer = "torque_lag"
    size, size_is_known = "time_constant_s", True
    ranges: ClassVar = {"time_constant_s": (1e-5, 1.0), "damping_ratio": (0.1, 5.0)}
    draws: ClassVar = {"damping_ratio": (0.6, 1.2)}
    robot: int
    time_constant_s: float
    damping_ratio: float

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        return [_late(self.robot, (1, 2, 3), self.time_constant_s, self.damping_ratio)]


@dataclass(frozen=True)
class SingleTorqueLag(Form):
    """One torque sensor alone: first order (no damping ratio is then of use) or second."""

    answer = "sensor_lag"
    size, size_is_known = "time_constant_s", True
    ranges: ClassVar = {"time_constant_s": (1e-5, 1.0), "damping_ratio": (0.1, 50.0)}
    robot: int
    joint: int
    time_constant_s: float
    damping_ratio: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        # A damping ratio of 5 is a lag of first order but for a hundredth.
        return {"damping_ratio": float(rng.choice([5.0, rng.uniform(0.6, 1.2)]))}

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        return [_late(self.robot, (self.joint,), self.time_constant_s, self.damping_ratio)]


LARGEST_FORCE_N = 400.0
LARGEST_MOMENT_NM = 60.0
TURNING_ARMATURE_KGM2 = 0.01
CONTACT_DAMPING_NS_PER_M = 20.0


@dataclass(frozen=True)
class SlowBaseCompliance(Form):
    """A base on springs beside dampers (Kelvin and Voigt): it follows its load in tens of milliseconds."""

    answer = "base_compliance"
    size, size_is_known = "compliance_m_per_N", True
    ranges: ClassVar = {"compliance_m_per_N": (0.0, 1e-2), "relaxation_s": (0.02, 10.0)}
    draws: ClassVar = {"relaxation_s": (0.03, 0.15)}
    robot: int
    compliance_m_per_N: float
    relaxation_s: float

    def _edit(self, scene: TeamScene) -> TeamScene:
        precise(scene)
        slides = base_slides(scene, self.robot, "slow", armature=SPRUNG_ARMATURE_KG)
        return add_springs(scene, slides, f"slowbase{self.robot}", self.compliance_m_per_N, self.relaxation_s)


@dataclass(frozen=True)
class SlowGrasp(Form):
    """A grasp on springs beside dampers."""

    answer = "grasp_flex"
    size, size_is_known = "compliance_m_per_N", True
    ranges: ClassVar = {"compliance_m_per_N": (0.0, 1e-3), "relaxation_s": (0.02, 10.0)}
    on_payload = True
    draws: ClassVar = {"relaxation_s": (0.03, 0.15)}
    robot: int
    compliance_m_per_N: float
    relaxation_s: float

    def _edit(self, scene: TeamScene) -> TeamScene:
        precise(scene)
        slides = add_slides(grasp_body(scene, self.robot), "slow", "xyz", armature=SPRUNG_ARMATURE_KG)
        scene = add_springs(
            scene, slides, f"slowgrasp{self.robot}", self.compliance_m_per_N, self.relaxation_s
        )
        return widened(scene, self.robot, LARGEST_FORCE_N * self.compliance_m_per_N)


@dataclass(frozen=True)
class TurningGrasp(Form):
    """A grasp that gives way to forces and to moments, about a point beside the gimbal's centre.

    The gimbal passes no moment, so a grasp that turned about its centre would not turn at all.
    """

    answer = "grasp_flex"
    size, size_is_known = "compliance_m_per_N", True
    ranges: ClassVar = {"compliance_m_per_N": (0.0, 1e-3), "reach_m": (0.0, 10.0), "offset_m": (-1.0, 1.0)}
    on_payload = True
    robot: int
    compliance_m_per_N: float
    reach_m: float
    """Compliance in rotation is that in translation over the square of this."""
    offset_m: float
    """From the gimbal's centre to where it turns, along z of {i}."""

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        reach, offset = rng.uniform(0.04, 0.1), rng.choice([-1.0, 1.0]) * rng.uniform(0.03, 0.08)
        return {"reach_m": float(reach), "offset_m": float(offset)}

    def _edit(self, scene: TeamScene) -> TeamScene:
        precise(scene)
        body, turn = grasp_body(scene, self.robot), self.compliance_m_per_N / self.reach_m**2
        slides = add_slides(body, "yield", "xyz", armature=SPRUNG_ARMATURE_KG)
        hinges = [
            body.add(
                "joint",
                pos=[0.0, 0.0, self.offset_m],
                name=f"turn_{axis}",
                type="hinge",
                axis=along,
                armature=TURNING_ARMATURE_KGM2,
                group=3,
            )
            for axis, along in zip("xyz", np.eye(3).tolist(), strict=True)
        ]
        scene = add_springs(scene, slides, f"yield{self.robot}", self.compliance_m_per_N, 0.0)
        scene = add_springs(scene, hinges, f"turn{self.robot}", turn, 0.0)
        slack = np.array(scene.grasp_slack_rad or (0.0,) * scene.robots)
        slack[self.robot - 1] += LARGEST_MOMENT_NM * turn
        scene = replace(scene, grasp_slack_rad=tuple(slack.tolist()))
        way = self.compliance_m_per_N + abs(self.offset_m) ** 2 * turn
        return widened(scene, self.robot, LARGEST_FORCE_N * way)


@dataclass(frozen=True)
class SoftPlay(Form):
    """A loose grasp, damped while it travels, with a contact behind the gap that gives way."""

    answer = "grasp_play"
    size, size_is_known = "play_m", True
    ranges: ClassVar = {
        "play_m": (0.0, 5e-3),
        "contact_m_per_N": (1e-9, 1e-4),
        "damping_Ns_per_m": (0.0, 50.0),
    }
    on_payload = True
    robot: int
    play_m: float
    contact_m_per_N: float
    damping_Ns_per_m: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {
            "contact_m_per_N": float(rng.uniform(0.5e-7, 3e-7)),
            "damping_Ns_per_m": float(rng.choice([0.0, rng.uniform(1.0, CONTACT_DAMPING_NS_PER_M)])),
        }

    def _edit(self, scene: TeamScene) -> TeamScene:
        precise(scene)
        slides = add_slides(
            grasp_body(scene, self.robot), "gap", "xyz", range=[-self.play_m, self.play_m], limited=True,
            armature=LOOSE_ARMATURE_KG,
        )  # fmt: skip
        model = scene.compile()
        for slide in slides:
            at = model.joint(slide.full_identifier).dofadr[0]
            solref, solimp = spring_parameters(self.contact_m_per_N, float(model.dof_invweight0[at]))
            slide.solreflimit, slide.solimplimit = solref, solimp
        return widened(scene, self.robot, 1.75 * self.play_m + 40e-6 + LARGEST_FORCE_N * self.contact_m_per_N)

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        return [_Dashpots(self.robot, self.damping_Ns_per_m)] if self.damping_Ns_per_m else []


class _Dashpots:
    """Dampers in the three directions of a loose grasp."""

    def __init__(self, robot: int, damping: float) -> None:
        self._body, self._damping = f"omnid{robot}/gap" if robot > 1 else "omnid1/payload/gap", damping

    def start(self, stage: Stage) -> None:
        self._data = stage.data
        self._dofs = [int(stage.model.joint(f"{self._body}_{axis}").dofadr[0]) for axis in "xyz"]

    def act(self, tick: int) -> None:
        self._data.qfrc_applied[self._dofs] -= self._damping * self._data.qvel[self._dofs]


@dataclass(frozen=True)
class LateCreep(Form):
    """Still until ``start_s`` of every trial, then at a constant velocity in a direction of {b}."""

    answer = "base_creep"
    size = "speed_mps"
    ranges: ClassVar = {"speed_mps": (0.0, 1e-2), "start_s": (0.0, 1e6)}
    draws: ClassVar = {"heading_rad": (-np.pi, np.pi), "start_s": (10.0, 25.0)}
    robot: int
    speed_mps: float
    heading_rad: float
    start_s: float

    def _edit(self, scene: TeamScene) -> TeamScene:
        precise(scene, TOLERANCE)
        base_slides(scene, self.robot, "late", armature=ARMATURE_KG, damping=DAMPING_NS_PER_M, stiffness=1.0)
        return scene

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        return [_Starts(self)]


class _Starts:
    """Pulls the slides, as strongly as their damping asks for, from a time on."""

    def __init__(self, creep: LateCreep) -> None:
        self._creep = creep

    def start(self, stage: Stage) -> None:
        self._data, self._dt = stage.data, 1.0 / stage.rate_hz
        joints = [stage.model.joint(f"omnid{self._creep.robot}/late_{axis}") for axis in "xy"]
        self._dofs = [int(joint.dofadr[0]) for joint in joints]
        heading = self._creep.heading_rad
        self._force = DAMPING_NS_PER_M * self._creep.speed_mps * np.array([np.cos(heading), np.sin(heading)])

    def act(self, tick: int) -> None:
        if tick * self._dt >= self._creep.start_s:
            self._data.qfrc_applied[self._dofs] += self._force

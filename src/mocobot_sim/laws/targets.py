"""What a law acts on: a reading, a joint, the payload, or a slide in a base or grasp."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mocobot_sim.effects.base_creep import ARMATURE_KG, DAMPING_NS_PER_M, TOLERANCE
from mocobot_sim.effects.slides import add_slides, grasp_body, level_slides, widened
from mocobot_sim.effects.solver import precise
from mocobot_sim.laws.functions import Step
from mocobot_sim.laws.signals import Signals, cross, is_signal, parts_of, robots_of
from mocobot_sim.trial.actors import Stage
from mocobot_sim.trial.readings import RobotReadings

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene

READING = re.compile(r"(phi|theta|tau)_([1-9][0-9]*)_([123])")
JOINT = re.compile(r"(driven|gimbal)_torque_([1-9][0-9]*)_([123])")
SLIDE = re.compile(r"(base|grasp)_position_([1-9][0-9]*)_([xyz])")
PAYLOAD = re.compile(r"payload_(?:mass|(?:force|moment|first_moment|spin)_[xyz])")
WORDS = (
    "tau_2_1, phi_2_1, theta_2_1 (readings of robot, joint), driven_torque_2_1, gimbal_torque_2_1, base_position_2_x, "
    "grasp_position_2_x, payload_force_x, payload_moment_x, payload_mass, payload_first_moment_x, payload_spin_x"
)
SLACK_M = 0.05
"""By which a grasp may seem open that is displaced."""


def is_target(name: str) -> bool:
    """Whether there is a target of a name."""
    return any(kind.fullmatch(name) for kind in (READING, JOINT, SLIDE, PAYLOAD))


def target_robot(name: str) -> int | None:
    """Whose it is, from 1; None of the payload."""
    for kind in (READING, JOINT, SLIDE):
        if match := kind.fullmatch(name):
            return int(match[2])
    return None


@dataclass
class Acts:
    """One law in one trial: an actor, or a reader where it is about a reading.

    Attributes:
        target: what it acts on.
        of, times: signals; the second empty where nothing multiplies.
        amplitude: of the function.
        ready: makes the function for a time step [s].
    """

    target: str
    of: str
    times: str
    amplitude: float
    ready: Callable[[float], Step]

    def start(self, stage: Stage) -> None:
        """Find signals and target."""
        payload = is_about_payload(self.target, self.of, self.times)
        self._signals = Signals(stage, carries=payload)
        self._x = self._signals.of(self.of)
        self._y = self._signals.of(self.times) if self.times else None
        self._function = self.ready(1.0 / stage.rate_hz)
        self._stage, self._dt = stage, 1.0 / stage.rate_hz
        if match := READING.fullmatch(self.target):
            self._readings, self._kind = RobotReadings(stage, int(match[2])), match[1]
            self._joint = int(match[3])
        elif JOINT.fullmatch(self.target):
            self._dofs = joint_dofs(stage, self.target)
        elif match := SLIDE.fullmatch(self.target):
            self._dof = int(stage.model.joint(slide_name(match)).dofadr[0])
        self._last: list[float] = []

    def value(self) -> float:
        """The law now."""
        out = self.amplitude * self._function(self._x())
        return out if self._y is None else out * self._y()

    def read(self, tick: int, seen: np.ndarray) -> None:
        """Change a reading."""
        self._signals.now(tick, seen)
        error = self.value()
        if self._kind == "tau":
            self._readings.set_tau(seen, self._joint, self._readings.tau(seen, self._joint) + error)
        elif self._kind == "phi":
            self._readings.add_phi(seen, self._joint, error)
        else:
            self._readings.add_theta(seen, self._joint, error)

    def act(self, tick: int) -> None:
        """Add a torque, a force or a wrench."""
        self._signals.now(tick)
        value, data = self.value(), self._stage.data
        if JOINT.fullmatch(self.target):
            for dof in self._dofs:
                data.qfrc_applied[dof] += value
        elif SLIDE.fullmatch(self.target):
            rate = (value - self._last[0]) / self._dt if self._last else 0.0
            self._last = [value]
            data.qfrc_applied[self._dof] += DAMPING_NS_PER_M * rate
        else:
            force, moment = self._on_payload(value)
            R, body = self._signals.motion.R, self._stage.index.payload_body
            # MuJoCo takes them at the centre of mass.
            com = self._signals.motion.com
            data.xfrc_applied[body, :3] += R @ force
            data.xfrc_applied[body, 3:] += R @ (moment - cross(com, force))

    def _on_payload(self, value: float) -> tuple[np.ndarray, np.ndarray]:
        """Force and moment at the origin of {1}, in {1}."""
        motion, kind, none = self._signals.motion, self.target.removeprefix("payload_"), np.zeros(3)
        felt = motion.felt
        if kind == "mass":
            lever = cross(motion.alpha, motion.com) + cross(motion.omega, cross(motion.omega, motion.com))
            return -value * (felt + lever), -value * cross(motion.com, felt + lever)
        kind, axis = kind.rsplit("_", 1)
        unit = value * np.eye(3)["xyz".index(axis)]
        if kind in ("force", "moment"):
            along = motion.R.T @ (motion.R_Wb1 @ unit)
            return (along, cross(motion.com, along)) if kind == "force" else (none, along)
        if kind == "spin":
            return none, -cross(motion.omega, unit)
        self._last = [*self._last[-2:], value]
        rates = np.diff(self._last) / self._dt
        axis_unit = np.eye(3)["xyz".index(axis)]
        rate = axis_unit * (rates[-1] if len(rates) else 0.0)
        change = axis_unit * ((rates[-1] - rates[-2]) / self._dt if len(rates) > 1 else 0.0)
        inner = cross(motion.alpha, unit) + cross(motion.omega, cross(motion.omega, unit))
        force = -(inner + 2.0 * cross(motion.omega, rate) + change)
        return force, -cross(unit, felt) - cross(motion.com, change)


def joint_dofs(stage: Stage, target: str) -> list[int]:
    """Degrees of freedom that a torque past the spring of a driven joint, or in a gimbal axis, acts on."""
    match = JOINT.fullmatch(target)
    assert match is not None
    at = int(match[2]) - 1, int(match[3]) - 1
    index = stage.index
    parts = (index.motor_dof, index.spring_dof) if match[1] == "driven" else (index.gimbal_dof,)
    return [int(part[at]) for part in parts]


def slide_name(match: re.Match[str]) -> str:
    """Name of the slide that a displaced base or grasp has."""
    where, robot, axis = match.groups()
    part = f"omnid{robot}/" if where == "base" or robot != "1" else "omnid1/payload/"
    return f"{part}law_{where}_{axis}"


def with_slide(scene: TeamScene, target: str) -> TeamScene:
    """The scene with the slide that a target needs, if it needs one and has none yet."""
    match = SLIDE.fullmatch(target)
    if match is None or scene.root.find("joint", slide_name(match)) is not None:
        return scene
    where, robot, axis = match[1], int(match[2]), match[3]
    precise(scene, TOLERANCE)
    body = scene.root.find("body", f"omnid{robot}/chassis") if where == "base" else grasp_body(scene, robot)
    add_slides(body, f"law_{where}", axis, armature=ARMATURE_KG, damping=DAMPING_NS_PER_M)
    if where == "base":
        level_slides(body)
        return scene
    return widened(scene, robot, SLACK_M)


def robots_in(*names: str) -> list[int]:
    """Robots that targets and signals name."""
    targets = (target_robot(name) for name in names if name and not is_signal(name))
    return [
        *(robot for robot in targets if robot is not None),
        *(i for name in names for i in robots_of(name)),
    ]


def is_about_payload(*names: str) -> bool:
    """Whether targets and signals name the payload."""
    each = (part for name in names for part in (name, *(one for _, one in parts_of(name))))
    return any(one.startswith("payload") for one in each)

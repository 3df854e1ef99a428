"""The effect ``law``: a formula at one place of a team, for errors that no other effect describes."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np

from estimator.errors import InputError
from mocobot_sim.control.control import home_phi
from mocobot_sim.effects.base import Effect, precise
from mocobot_sim.effects.geometry import (
    ARMATURE_KG,
    DAMPING_NS_PER_M,
    TOLERANCE,
    add_slides,
    grasp_body,
    level_slides,
    widened,
)
from mocobot_sim.functions import FUNCTIONS, Inside, Step, check_law
from mocobot_sim.scene.models import base_height_m, omnid_design
from mocobot_sim.trial.actors import RobotReadings, Stage

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene

READING = re.compile(r"(phi|theta|tau)_([1-9][0-9]*)_([123])")
TORQUE = re.compile(r"(driven|gimbal)_torque_([1-9][0-9]*)_([123])")
SLIDE = re.compile(r"(base|grasp)_position_([1-9][0-9]*)_([xyz])")
ON_PAYLOAD = re.compile(r"payload_(?:mass|(?:force|moment|first_moment|spin)_[xyz])")
TARGET = re.compile("|".join(kind.pattern for kind in (READING, TORQUE, SLIDE, ON_PAYLOAD)))
TARGETS = (
    "tau_2_1, phi_2_1, theta_2_1 (readings of robot, joint), driven_torque_2_1, gimbal_torque_2_1, base_position_2_x, "
    "grasp_position_2_x, payload_force_x, payload_moment_x, payload_mass, payload_first_moment_x, payload_spin_x"
)
JOINT = re.compile(
    r"(phi|phi_rate|phi_acceleration|theta|theta_rate|theta_acceleration|tau)_([1-9][0-9]*)_([123])"
)
OF_PAYLOAD = re.compile(r"payload_(position|velocity|acceleration|felt|rate|turn|up)_([xyz])")
PART = re.compile(r"(?:(-?[0-9]+(?:\.[0-9]+)?(?:e-?[0-9]+)?)\*)?([a-z][a-z0-9_]*)")
SIGNALS = (
    "time, phi_2_1 (robot, joint), phi_rate_2_1, phi_acceleration_2_1, same of theta, tau_2_1, payload_position_x, or "
    "a sum of such as 0.6*payload_felt_x + -0.8*payload_felt_y"
)
SLACK_M = 0.05
"""Gap that the trial's checks allow at a grasp displaced by a law [m]. Chosen."""
GRAVITY_MPS2 = 9.81
Value = Callable[[], float]


@dataclass(frozen=True)
class Law(Effect):
    """A formula added to a target: ``amplitude`` times a function of one signal, optionally times a second signal.

    ``target`` is one of: a reading (``tau_2_1`` of robot 2, joint 1; ``phi_2_1``, ``theta_2_1``); a torque
    (``driven_torque_2_1``, ``gimbal_torque_2_1``); a displacement (``base_position_2_x``, ``grasp_position_2_x``); a
    quantity of the payload (``payload_force_x`` and ``payload_moment_x`` in the axes of robot 1's {b};
    ``payload_mass``, ``payload_first_moment_x`` and ``payload_spin_x`` in {1}).

    ``of`` and ``times`` name the two signals: ``time``, ``phi_2_1``, ``phi_rate_2_1``, ``phi_acceleration_2_1``, the
    same for ``theta``, ``tau_2_1``, ``payload_position_x``. Other payload signals are ``velocity``, ``acceleration``,
    ``felt`` (acceleration minus gravity), ``rate`` (angular velocity), ``turn`` (angular acceleration) and ``up``. All
    are in SI units. If the target is a reading, angles and torques are those that the sensors see; otherwise they are
    true values. A weighted sum of signals is also a signal: ``0.6*payload_felt_x + -0.8*payload_felt_y``.

    ``number``, ``second`` and ``phase_rad`` are the parameters of the function, such as the knee of a ramp, a time
    constant, or half the width of a backlash (docs/effects.md).
    """

    repeats = True
    texts = ("target", "function", "of", "times")
    target: str
    function: str
    of: str
    amplitude: float
    number: float = 0.0
    second: float = 0.0
    phase_rad: float = 0.0
    times: str = ""

    def __post_init__(self) -> None:
        """Check names and numbers.

        Raises:
            InputError: a name is not known, or a number is not allowed with this function.
        """
        super().__post_init__()
        check_law(self, TARGET.fullmatch, TARGETS, parts_of, SIGNALS)

    def step(self, dt: float) -> Step:
        """Make the function for a signal sampled at steps of ``dt`` [s]; call it once for each sample."""
        return FUNCTIONS[self.function](Inside(self.number, self.second, self.phase_rad, dt))

    def actors(self, trial_number: int | None) -> Sequence[_Acts]:
        """The actor of a trial, unless the target is a reading."""
        return () if READING.fullmatch(self.target) else (_Acts(self),)

    def readers(self, trial_number: int | None) -> Sequence[_Acts]:
        """The reader of a trial, if the target is a reading."""
        return (_Acts(self),) if READING.fullmatch(self.target) else ()

    @property
    def about_payload(self) -> bool:
        """Whether the target or a signal belongs to the payload."""
        return any(name.startswith("payload") for name in self._names())

    def _names(self) -> Iterator[str]:
        yield self.target
        for name in (self.of, self.times):
            yield from (one for _, one in parts_of(name))

    def _edit(self, scene: TeamScene) -> TeamScene:
        for name in self._names():
            match = next((m for kind in (TORQUE, SLIDE, JOINT) if (m := kind.fullmatch(name))), None)
            if match and int(match[2]) > scene.robots:
                raise InputError(
                    f"law: there is no robot {match[2]}; the team has robots 1 .. {scene.robots}"
                )
        if not scene.carries and self.about_payload:
            raise InputError("law: it is about a payload; robots of a free trial hold nothing")
        return self._with_slide(scene)

    def _with_slide(self, scene: TeamScene) -> TeamScene:
        """Add the slide joint of a displacement target, unless the scene has it already."""
        match = SLIDE.fullmatch(self.target)
        if match is None or scene.root.find("joint", _slide_name(match)) is not None:
            return scene
        where, robot, axis = match[1], int(match[2]), match[3]
        precise(scene, TOLERANCE)
        base = where == "base"
        body = scene.root.find("body", f"omnid{robot}/chassis") if base else grasp_body(scene, robot)
        add_slides(body, f"law_{where}", axis, armature=ARMATURE_KG, damping=DAMPING_NS_PER_M)
        if base:
            level_slides(body)
            return scene
        return widened(scene, robot, SLACK_M)


def parts_of(name: str) -> list[tuple[float, str]]:
    """Split a weighted sum of signals into (factor, name) pairs; empty if ``name`` is not a valid signal."""
    matches = [PART.fullmatch(part) for part in name.split(" + ")]
    parts = [(float(match[1] or 1.0), match[2]) for match in matches if match is not None]
    known = all(
        math.isfinite(factor) and (one == "time" or JOINT.fullmatch(one) or OF_PAYLOAD.fullmatch(one))
        for factor, one in parts
    )
    return parts if known and len(parts) == len(matches) else []


def _slide_name(match: re.Match[str]) -> str:
    """Full name in the compiled model of the slide joint of a displaced base or grasp."""
    where, robot, axis = match.groups()
    part = f"omnid{robot}/" if where == "base" or robot != "1" else "omnid1/payload/"
    return f"{part}law_{where}_{axis}"


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product of two vectors, faster than numpy's for single vectors."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


class PayloadMotion:
    """Motion of the payload, updated once per control tick.

    Attributes:
        position, velocity: of the origin of {1}, in robot 1's {b} without base tilt [m], [m/s].
        acceleration: acceleration of the origin of {1}, in {1} [m/s^2].
        felt: proper acceleration, which is acceleration minus gravity, as an accelerometer reads it, in {1} [m/s^2].
        omega, alpha: angular velocity and acceleration in {1} [rad/s], [rad/s^2].
        up: unit vector opposite to gravity, in {1}.
        R: orientation of {1} in the world, shape (3, 3).
        com: centre of mass in {1} [m].
    """

    def __init__(self, stage: Stage) -> None:
        import mujoco  # here, so that laws can be checked without loading MuJoCo

        self._model, self._data, self._body = stage.model, stage.data, stage.index.payload_body
        mount = stage.model.body_parentid[stage.model.body("omnid1/chassis").id]
        mujoco.mj_kinematics(stage.model, stage.data)
        mujoco.mj_comPos(stage.model, stage.data)
        mujoco.mj_comVel(stage.model, stage.data)
        self.R_Wb1 = stage.data.xmat[mount].reshape(3, 3).copy()
        self._p_Wb1 = stage.data.xpos[mount] + self.R_Wb1 @ [0.0, 0.0, base_height_m()]
        self._dt, self._tick, self._last = 1.0 / stage.rate_hz, -1, (np.zeros(3), np.zeros(3))
        R = stage.data.xmat[self._body].reshape(3, 3)
        self.com = R.T @ (stage.data.xipos[self._body] - stage.data.xpos[self._body])
        self._update(first=True)

    @classmethod
    def of(cls, stage: Stage) -> PayloadMotion:
        """The motion shared by all laws of a trial."""
        if "payload motion" not in stage.shared:
            stage.shared["payload motion"] = cls(stage)
        return cast("PayloadMotion", stage.shared["payload motion"])

    def at(self, tick: int) -> PayloadMotion:
        """Update the motion to a control tick and return it."""
        if tick != self._tick:
            self._tick = tick
            self._update(first=tick == 0)
        return self

    def _update(self, *, first: bool) -> None:
        data, body = self._data, self._body
        self.R = data.xmat[body].reshape(3, 3).copy()
        spin = data.cvel[body, :3]
        # ``cvel`` is the velocity at the centre of mass of the whole kinematic tree.
        away = data.xpos[body] - data.subtree_com[self._model.body_rootid[body]]
        velocity = data.cvel[body, 3:] + _cross(spin, away)
        self.position = self.R_Wb1.T @ (data.xpos[body] - self._p_Wb1)
        self.velocity, self.omega, self.up = self.R_Wb1.T @ velocity, self.R.T @ spin, self.R[2].copy()
        before, turn_before = (velocity, spin) if first else self._last
        self.acceleration = self.R.T @ (velocity - before) / self._dt
        self.alpha = self.R.T @ (spin - turn_before) / self._dt
        self.felt = self.acceleration + GRAVITY_MPS2 * self.up
        self._last = velocity.copy(), spin.copy()


class _Signals:
    """Looks up the signals of one trial by name."""

    def __init__(self, stage: Stage, *, carries: bool) -> None:
        self._stage, self._tick = stage, 0
        self._seen = stage.data.qpos
        self._motion = PayloadMotion.of(stage) if carries else None

    @property
    def motion(self) -> PayloadMotion:
        """Motion of the payload at the current tick."""
        assert self._motion is not None
        return self._motion.at(self._tick)

    def now(self, tick: int, seen: np.ndarray | None = None) -> None:
        """Set the current tick; ``seen`` are the positions as the sensors see them, or None for the true ones."""
        self._tick, self._seen = tick, self._stage.data.qpos if seen is None else seen

    def of(self, name: str) -> Value:
        """A function that returns the value of a signal at the current tick."""
        each = [(factor, self._one(part)) for factor, part in parts_of(name)]
        if len(each) == 1 and each[0][0] == 1.0:
            return each[0][1]
        return lambda: sum(factor * value() for factor, value in each)

    def _one(self, name: str) -> Value:
        if name == "time":
            return lambda: self._tick / self._stage.rate_hz
        match = JOINT.fullmatch(name)
        if match:
            return self._of_joint(match[1], int(match[2]) - 1, int(match[3]) - 1)
        kind, axis = name.removeprefix("payload_").rsplit("_", 1)
        k, attribute = "xyz".index(axis), {"rate": "omega", "turn": "alpha"}.get(kind, kind)
        return lambda: float(getattr(self.motion, attribute)[k])

    def _of_joint(self, kind: str, robot: int, joint: int) -> Value:
        index, data, at = self._stage.index, self._stage.data, (robot, joint)
        if kind == "tau":
            spring, stiffness = int(index.spring_qpos[at]), omnid_design().sea_stiffness_Nm_per_rad
            return lambda: -stiffness * float(self._seen[spring])
        angle, _, derivative = kind.partition("_")
        parts = ("motor", "spring") if angle == "phi" else ("gimbal",)
        if derivative:
            dofs = [int(getattr(index, f"{part}_dof")[at]) for part in parts]
            array = data.qvel if derivative == "rate" else data.qacc
            return lambda: sum(float(array[k]) for k in dofs)
        positions = [int(getattr(index, f"{part}_qpos")[at]) for part in parts]
        home = home_phi(omnid_design()) if angle == "phi" else 0.0
        return lambda: home + sum(float(self._seen[k]) for k in positions)


class _Acts:
    """One law in one trial: a reader if its target is a reading, else an actor."""

    def __init__(self, law: Law) -> None:
        self._law = law

    def start(self, stage: Stage) -> None:
        law, self._stage, self._dt = self._law, stage, 1.0 / stage.rate_hz
        self._signals = _Signals(stage, carries=law.about_payload)
        self._x = self._signals.of(law.of)
        self._y = self._signals.of(law.times) if law.times else None
        self._function = Law.step(law, self._dt)
        self._dofs: list[int] = []
        self._slide = bool(match := SLIDE.fullmatch(law.target))
        if match:
            self._dofs = [int(stage.model.joint(_slide_name(match)).dofadr[0])]
        elif match := READING.fullmatch(law.target):
            self._readings, self._kind = RobotReadings(stage, int(match[2])), match[1]
            self._joint = int(match[3])
        elif match := TORQUE.fullmatch(law.target):
            # A driven torque acts between chassis and link, so it is applied to motor and spring coordinates alike.
            parts, at = ("motor", "spring") if match[1] == "driven" else ("gimbal",), match.groups()
            place = int(at[1]) - 1, int(at[2]) - 1
            self._dofs = [int(getattr(stage.index, f"{part}_dof")[place]) for part in parts]
        self._last: list[float] = []

    def _value(self) -> float:
        out = self._law.amplitude * self._function(self._x())
        return out if self._y is None else out * self._y()

    def read(self, tick: int, seen: np.ndarray) -> None:
        """Add the law's value to a reading."""
        self._signals.now(tick, seen)
        error = self._value()
        if self._kind == "tau":
            self._readings.set_tau(seen, self._joint, self._readings.tau(seen, self._joint) + error)
        elif self._kind == "phi":
            self._readings.add_phi(seen, self._joint, error)
        else:
            self._readings.add_theta(seen, self._joint, error)

    def act(self, tick: int) -> None:
        """Apply the law's value as a generalised force on joints or as a wrench on the payload."""
        self._signals.now(tick)
        value, data = self._value(), self._stage.data
        if self._slide:
            rate = (value - self._last[0]) / self._dt if self._last else 0.0
            self._last, value = [value], DAMPING_NS_PER_M * rate
        if self._dofs:
            for dof in self._dofs:
                data.qfrc_applied[dof] += value
            return
        force, moment = self._on_payload(value)
        R, com, body = self._signals.motion.R, self._signals.motion.com, self._stage.index.payload_body
        # ``xfrc_applied`` acts at the centre of mass.
        data.xfrc_applied[body, :3] += R @ force
        data.xfrc_applied[body, 3:] += R @ (moment - _cross(com, force))

    def _on_payload(self, value: float) -> tuple[np.ndarray, np.ndarray]:
        """Force and moment of a payload target about the origin of {1}, in {1}."""
        motion, kind, none = self._signals.motion, self._law.target.removeprefix("payload_"), np.zeros(3)
        felt = motion.felt
        if kind == "mass":
            lever = _cross(motion.alpha, motion.com) + _cross(motion.omega, _cross(motion.omega, motion.com))
            return -value * (felt + lever), -value * _cross(motion.com, felt + lever)
        kind, axis = kind.rsplit("_", 1)
        axis_unit = np.eye(3)["xyz".index(axis)]
        unit = value * axis_unit
        if kind in ("force", "moment"):
            along = motion.R.T @ (motion.R_Wb1 @ unit)
            return (along, _cross(motion.com, along)) if kind == "force" else (none, along)
        if kind == "spin":
            return none, -_cross(motion.omega, unit)
        self._last = [*self._last[-2:], value]
        rates = np.diff(self._last) / self._dt
        rate = axis_unit * (rates[-1] if len(rates) else 0.0)
        change = axis_unit * ((rates[-1] - rates[-2]) / self._dt if len(rates) > 1 else 0.0)
        inner = _cross(motion.alpha, unit) + _cross(motion.omega, _cross(motion.omega, unit))
        force = -(inner + 2.0 * _cross(motion.omega, rate) + change)
        return force, -_cross(unit, felt) - _cross(motion.com, change)

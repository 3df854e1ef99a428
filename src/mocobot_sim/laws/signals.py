"""Signals of a running trial by the names that laws give them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import cast

import numpy as np

from mocobot_sim.control.control import home_phi
from mocobot_sim.scene.design import base_height_m, omnid_design
from mocobot_sim.trial.actors import Stage

JOINT = re.compile(
    r"(phi|phi_rate|phi_acceleration|theta|theta_rate|theta_acceleration|tau)_([1-9][0-9]*)_([123])"
)
PAYLOAD = re.compile(r"payload_(position|velocity|acceleration|felt|rate|turn|up)_([xyz])")
PART = re.compile(r"(?:(-?[0-9]+(?:\.[0-9]+)?(?:e-?[0-9]+)?)\*)?([a-z][a-z0-9_]*)")
WORDS = (
    "time, phi_2_1 (robot, joint), phi_rate_2_1, phi_acceleration_2_1, same of theta, tau_2_1, payload_position_x, or "
    "a sum of such as 0.6*payload_felt_x + -0.8*payload_felt_y"
)
Value = Callable[[], float]


def is_signal(name: str) -> bool:
    """Whether there is a signal of a name, or it is a sum of such."""
    return bool(parts_of(name))


def parts_of(name: str) -> list[tuple[float, str]]:
    """Factors and names of the signals that a name adds up; empty if it is none."""
    matches = [PART.fullmatch(part) for part in name.split(" + ")]
    parts = [(float(match[1] or 1.0), match[2]) for match in matches if match is not None]
    known = all(
        math.isfinite(factor) and (one == "time" or JOINT.fullmatch(one) or PAYLOAD.fullmatch(one))
        for factor, one in parts
    )
    return parts if known and len(parts) == len(matches) else []


def robots_of(name: str) -> list[int]:
    """Whose signals it has, from 1; none of the payload and of time."""
    matches = (JOINT.fullmatch(one) for _, one in parts_of(name))
    return [int(match[2]) for match in matches if match]


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of two vectors of three; numpy's takes ten times as long for so few numbers."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


class PayloadMotion:
    """Motion of the payload, brought up to date once a tick.

    Attributes:
        position, velocity: of the origin of {1}, in robot 1's {b} without any tilt [m], [m/s].
        acceleration: of the same, in {1} [m/s^2].
        felt: that less gravity: what a scale would feel, in {1} [m/s^2].
        omega, alpha: angular velocity and acceleration in {1} [rad/s], [rad/s^2].
        up: unit vector against gravity in {1}.
        R: axes of {1} in the world, shape (3, 3).
        com: centre of mass in {1} [m].
    """

    def __init__(self, stage: Stage) -> None:
        import mujoco  # only where a trial runs: what a law may name is known without

        self._model, self._data, self._body = stage.model, stage.data, stage.index.payload_body
        mount = stage.model.body_parentid[stage.model.body("omnid1/chassis").id]
        mujoco.mj_kinematics(stage.model, stage.data)
        mujoco.mj_comPos(stage.model, stage.data)
        mujoco.mj_comVel(stage.model, stage.data)
        self.R_Wb1 = stage.data.xmat[mount].reshape(3, 3).copy()
        self._p_Wb1 = stage.data.xpos[mount] + self.R_Wb1 @ [0.0, 0.0, base_height_m()]
        self._dt, self._tick, self._last = 1.0 / stage.rate_hz, -1, (np.zeros(3), np.zeros(3))
        self.com = self.R_of().T @ (stage.data.xipos[self._body] - stage.data.xpos[self._body])
        self._update(first=True)

    @classmethod
    def of(cls, stage: Stage) -> PayloadMotion:
        """Of a trial; all that ask for it have the same one."""
        if "payload motion" not in stage.shared:
            stage.shared["payload motion"] = cls(stage)
        return cast("PayloadMotion", stage.shared["payload motion"])

    def R_of(self) -> np.ndarray:
        """Axes of {1} in the world, now."""
        return self._data.xmat[self._body].reshape(3, 3)

    def at(self, tick: int) -> PayloadMotion:
        """The motion at a tick."""
        if tick != self._tick:
            self._tick = tick
            self._update(first=tick == 0)
        return self

    def _update(self, *, first: bool) -> None:
        data, body = self._data, self._body
        self.R = self.R_of().copy()
        spin = data.cvel[body, :3]
        # Velocities of MuJoCo's bodies are given at the centre of mass of the whole tree.
        away = data.xpos[body] - data.subtree_com[self._model.body_rootid[body]]
        velocity = data.cvel[body, 3:] + cross(spin, away)
        self.position = self.R_Wb1.T @ (data.xpos[body] - self._p_Wb1)
        self.velocity, self.omega, self.up = self.R_Wb1.T @ velocity, self.R.T @ spin, self.R[2].copy()
        before, turn_before = (velocity, spin) if first else self._last
        self.acceleration = self.R.T @ (velocity - before) / self._dt
        self.alpha = self.R.T @ (spin - turn_before) / self._dt
        self.felt = self.acceleration + 9.81 * self.up
        self._last = velocity.copy(), spin.copy()


class Signals:
    """Signals of one trial.

    Args:
        stage: the trial.
        carries: whether signals of the payload are asked for.
    """

    def __init__(self, stage: Stage, *, carries: bool) -> None:
        self._stage, self._tick = stage, 0
        self._seen = stage.data.qpos
        self._motion = PayloadMotion.of(stage) if carries else None

    @property
    def motion(self) -> PayloadMotion:
        """The payload's."""
        assert self._motion is not None
        return self._motion.at(self._tick)

    def now(self, tick: int, seen: np.ndarray | None = None) -> None:
        """Go on to a tick; ``seen`` are the positions that the sensors see, else the true ones."""
        self._tick, self._seen = tick, self._stage.data.qpos if seen is None else seen

    def of(self, name: str) -> Value:
        """What a signal is at the tick that is now."""
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
        driven = angle == "phi"
        parts = (index.motor_qpos, index.spring_qpos) if driven else (index.gimbal_qpos,)
        moving = (index.motor_dof, index.spring_dof) if driven else (index.gimbal_dof,)
        positions, dofs = [int(part[at]) for part in parts], [int(part[at]) for part in moving]
        if derivative:
            array = data.qvel if derivative == "rate" else data.qacc
            return lambda: sum(float(array[k]) for k in dofs)
        home = home_phi(omnid_design()) if driven else 0.0
        return lambda: home + sum(float(self._seen[k]) for k in positions)

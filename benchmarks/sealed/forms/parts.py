"""Who acts for forms: torques in joints, wrenches on the payload."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import mujoco
import numpy as np

from mocobot_sim.trial.actors import Stage

Kind = Literal["driven", "spring", "gimbal"]
Torque = Callable[[float, float, float, float], float]
"""Torque on a joint [N m] at an angle [rad], a rate [rad/s] and a time [s], after a step [s]."""
Wrench = Callable[[float, np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Force [N] and moment about the centre of mass [N m] in the world, from the time [s], the centre of mass [m], its
velocity [m/s] and the angular velocity [rad/s]."""


class JointTorque:
    """A torque in one joint: past the spring of a driven one, inside a spring, or of a gimbal axis.

    Args:
        kind, robot, joint: where; robot and joint from 1.
        torque: what it is.
    """

    def __init__(self, kind: Kind, robot: int, joint: int, torque: Torque) -> None:
        self._kind, self._at, self._torque = kind, (robot - 1, joint - 1), torque

    def start(self, stage: Stage) -> None:
        """Find the joint."""
        index, at = stage.index, self._at
        positions = {
            "driven": (index.motor_qpos[at], index.spring_qpos[at]),
            "spring": (index.spring_qpos[at],),
            "gimbal": (index.gimbal_qpos[at],),
        }[self._kind]
        dofs = {
            "driven": (index.motor_dof[at], index.spring_dof[at]),
            "spring": (index.spring_dof[at],),
            "gimbal": (index.gimbal_dof[at],),
        }[self._kind]
        self._positions, self._dofs = [int(k) for k in positions], [int(k) for k in dofs]
        self._data, self._dt = stage.data, 1.0 / stage.rate_hz

    def act(self, tick: int) -> None:
        """Add the torque, the same in both parts of a driven joint."""
        data = self._data
        angle = sum(float(data.qpos[k]) for k in self._positions)
        rate = sum(float(data.qvel[k]) for k in self._dofs)
        torque = self._torque(angle, rate, tick * self._dt, self._dt)
        for k in self._dofs:
            data.qfrc_applied[k] += torque


class PayloadWrench:
    """A wrench on the payload."""

    def __init__(self, wrench: Wrench) -> None:
        self._wrench = wrench

    def start(self, stage: Stage) -> None:
        """Find the payload."""
        self._data, self._model = stage.data, stage.model
        self._body, self._dt = stage.index.payload_body, 1.0 / stage.rate_hz
        self._J = np.zeros((6, stage.model.nv))

    def act(self, tick: int) -> None:
        """Add the wrench; the payload's pose is that of the step before, its rates are those of this instant.

        A position moves on by the rate that it has after a step, so that of an instant is half a step ahead. Rates of
        the step before would be 1.5 ms late: of 37 N s/m an inertia of -0.055 kg that has no weight.
        """
        data, body = self._data, self._body
        mujoco.mj_jacBodyCom(self._model, data, self._J[:3], self._J[3:], body)
        rates = self._J @ (data.qvel + 0.5 * self._model.opt.timestep * data.qacc)
        force, moment = self._wrench(tick * self._dt, data.xipos[body], rates[:3], rates[3:])
        data.xfrc_applied[body, :3] += force
        data.xfrc_applied[body, 3:] += moment


class PointForce:
    """A force on a point that is fixed to the payload.

    Args:
        force: at a time [s], in the axes of robot 1's {b} [N], shape (3,).
        point: in {1} [m], shape (3,).
    """

    def __init__(self, force: Callable[[float], np.ndarray], point: np.ndarray) -> None:
        self._force, self._point = force, point

    def start(self, stage: Stage) -> None:
        """Find the payload, and where robot 1 stands."""
        mount = stage.model.body_parentid[stage.model.body("omnid1/chassis").id]
        self._R = stage.data.xmat[mount].reshape(3, 3).copy()
        self._data, self._body, self._dt = stage.data, stage.index.payload_body, 1.0 / stage.rate_hz

    def act(self, tick: int) -> None:
        """Add it."""
        force = self._force(tick * self._dt)
        if force.any():
            data, body = self._data, self._body
            force = self._R @ force
            arm = data.xpos[body] + data.xmat[body].reshape(3, 3) @ self._point - data.xipos[body]
            data.xfrc_applied[body, :3] += force
            data.xfrc_applied[body, 3:] += _cross(arm, force)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """np.cross is slow for one pair."""
    (x, y, z), (u, v, w) = a, b
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])

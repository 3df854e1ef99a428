"""Addresses of the released bases in a compiled model, looked up by name."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from mocobot_sim.base.design import WHEELS
from mocobot_sim.scene.team_index import Index, ids_of, robots_with


@dataclass(frozen=True)
class BaseIndex:
    """Where the wheels of N released robots live; wheels in the order of ``WHEELS``.

    Attributes:
        wheel_qpos, wheel_dof: positions in ``qpos`` and ``qvel``, shape (N, 4).
        drive: positions of the wheels' motors in ``ctrl``, shape (N, 4).
        chassis: body ids, shape (N,).
        free_qpos: where the position and quaternion of every chassis begin in ``qpos``, shape (N,).
        geom_wheel: number of the wheel, 4 robot + wheel from 0, that each geom is a roller of, or -1; shape (ngeom,).
    """

    wheel_qpos: Index
    wheel_dof: Index
    drive: Index
    chassis: Index
    free_qpos: Index
    geom_wheel: Index

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return len(self.chassis)

    @classmethod
    def of(cls, model: mujoco.MjModel) -> BaseIndex:
        """Look everything up.

        Raises:
            InputError: a robot is parked, or there is none.
        """
        robots = robots_with(model, mujoco.mjtObj.mjOBJ_BODY, "chassis")
        if not robots:
            raise InputError("the model has no Omnid; a base that is to drive must be there")
        drives = [f"drive_{wheel}" for wheel in WHEELS]
        driven = min(robots_with(model, mujoco.mjtObj.mjOBJ_ACTUATOR, drive) for drive in drives)
        if driven < robots:
            raise InputError(f"omnid{driven + 1} is parked; a base that is to drive must be released")
        names = [f"wheel_{wheel}" for wheel in WHEELS]
        joints = ids_of(model.joint, robots, names)
        geom_wheel = np.full(model.ngeom, -1, dtype=np.intp)
        for number, hub in enumerate(ids_of(model.body, robots, names).ravel()):
            geom_wheel[model.body_parentid[model.geom_bodyid] == hub] = number
        return cls(
            wheel_qpos=model.jnt_qposadr[joints].astype(np.intp),
            wheel_dof=model.jnt_dofadr[joints].astype(np.intp),
            drive=ids_of(model.actuator, robots, drives),
            chassis=ids_of(model.body, robots, ("chassis",)).ravel(),
            free_qpos=model.jnt_qposadr[ids_of(model.joint, robots, ("",)).ravel()].astype(np.intp),
            geom_wheel=geom_wheel,
        )

    def poses(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """Where every chassis is: x, y [m], yaw [rad] within +-pi in the world, shape (N, 3)."""
        w, x, y, z = data.qpos[self.free_qpos[:, None] + np.arange(3, 7)].T
        at = data.qpos[self.free_qpos[:, None] + np.arange(2)]
        yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        return np.column_stack([at, yaw])

"""Addresses of the released bases in a compiled model, looked up by name."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from mocobot_sim.base.design import WHEELS

Index = NDArray[np.intp]


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
        robots = 0
        while mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, f"omnid{robots + 1}/chassis") >= 0:
            robots += 1
        names = [[f"omnid{i + 1}/wheel_{wheel}" for wheel in WHEELS] for i in range(robots)]
        drives = [[f"omnid{i + 1}/drive_{wheel}" for wheel in WHEELS] for i in range(robots)]
        for i, row in enumerate(drives):
            if any(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, name) < 0 for name in row):
                raise InputError(f"omnid{i + 1} is parked; a base that is to drive must be released")
        if not robots:
            raise InputError("the model has no Omnid; a base that is to drive must be there")
        joints = np.array([[model.joint(name).id for name in row] for row in names])
        geom_wheel = np.full(model.ngeom, -1, dtype=np.intp)
        for number, name in enumerate(name for row in names for name in row):
            hub = model.body(name).id
            geom_wheel[model.body_parentid[model.geom_bodyid] == hub] = number
        return cls(
            wheel_qpos=model.jnt_qposadr[joints].astype(np.intp),
            wheel_dof=model.jnt_dofadr[joints].astype(np.intp),
            drive=np.array([[model.actuator(name).id for name in row] for row in drives], dtype=np.intp),
            chassis=np.array([model.body(f"omnid{i + 1}/chassis").id for i in range(robots)], dtype=np.intp),
            free_qpos=np.array(
                [model.jnt_qposadr[model.joint(f"omnid{i + 1}/").id] for i in range(robots)], dtype=np.intp
            ),
            geom_wheel=geom_wheel,
        )

    def poses(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """Where every chassis is: x, y [m], yaw [rad] within +-pi in the world, shape (N, 3)."""
        w, x, y, z = data.qpos[self.free_qpos[:, None] + np.arange(3, 7)].T
        at = data.qpos[self.free_qpos[:, None] + np.arange(2)]
        yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        return np.column_stack([at, yaw])

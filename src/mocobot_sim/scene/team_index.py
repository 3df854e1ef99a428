"""Addresses of joints, sites and wheels in a compiled model, looked up by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from mocobot_sim.base.design import WHEELS
from mocobot_sim.scene.models import GIMBAL_AXES
from mocobot_sim.scene.payload import payload_joint

Index = NDArray[np.intp]

JOINTS = {
    "motor": ("motor1", "motor2", "motor3"),
    "spring": ("spring1", "spring2", "spring3"),
    "gimbal": tuple(f"gimbal_{axis}" for axis in GIMBAL_AXES),
    "slide": ("platform_x", "platform_y", "platform_z"),
    "knee": tuple(f"knee{k}_{motion}" for k in (1, 2, 3) for motion in ("swing", "tilt")),
}
PAYLOAD_PREFIX = "omnid1/payload/"


@dataclass(frozen=True)
class TeamIndex:
    """Addresses of a team in a compiled model; every joint here has one coordinate."""

    # addresses in ``qpos``, shape (N, 3); gimbals in the order z, y, x
    motor_qpos: Index
    spring_qpos: Index
    gimbal_qpos: Index
    slide_qpos: Index
    # addresses in ``qvel``, shape (N, 3), knees (N, 6)
    motor_dof: Index
    spring_dof: Index
    gimbal_dof: Index
    slide_dof: Index
    knee_dof: Index
    actuator: Index  # addresses of the motors in ``ctrl``, shape (N, 3)
    grasp_site: Index  # site id of every robot's flange, shape (N,)
    # site id of every robot's grasp on the payload, shape (N,); of the flange without payload
    payload_site: Index
    payload_body: int  # body id of the payload; -1 without payload
    # slides and sprung hinges that effects have added: compliant, loose or moving bases and grasps
    yielding_dof: Index
    hanging_dof: Index  # other hinges that effects have added: pendulums in the payload
    payload_dof: Index  # joint of a payload of two bodies; empty for a rigid one
    base_dof: Index  # free chassis, wheels and rollers; empty for a parked team

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return len(self.grasp_site)

    @classmethod
    def of(cls, model: mujoco.MjModel, carries: bool = True) -> TeamIndex:
        """Look up all addresses in a compiled scene, with or without a payload.

        Raises:
            KeyError: the model is not a team scene (the message names what is missing).
        """
        robots = robots_with(model, mujoco.mjtObj.mjOBJ_SITE, "grasp")
        joints = {kind: ids_of(model.joint, robots, names) for kind, names in JOINTS.items()}
        base = _base_joints(model)
        joint = payload_joint(model, PAYLOAD_PREFIX)
        between = np.array([] if joint is None else [joint.joint], dtype=np.intp)
        own = np.concatenate([*(ids.ravel() for ids in joints.values()), base, between])
        qpos = {
            f"{kind}_qpos": model.jnt_qposadr[joints[kind]].astype(np.intp)
            for kind in JOINTS
            if kind != "knee"
        }
        dof = {f"{kind}_dof": model.jnt_dofadr[joints[kind]].astype(np.intp) for kind in JOINTS}
        sprung = model.eq_obj1id[model.eq_type == mujoco.mjtEq.mjEQ_JOINT]
        slides = _added(model, own, mujoco.mjtJoint.mjJNT_SLIDE)
        hinges = _added(model, own, mujoco.mjtJoint.mjJNT_HINGE)
        turning = np.isin(model.dof_jntid[hinges], sprung)
        flanges = ids_of(model.site, robots, ("grasp",)).ravel()
        grasps = [model.site(f"{PAYLOAD_PREFIX}grasp{i + 1}").id for i in range(robots if carries else 0)]
        return cls(
            **qpos,
            **dof,
            actuator=ids_of(model.actuator, robots, JOINTS["motor"]),
            grasp_site=flanges,
            payload_site=np.array(grasps, dtype=np.intp) if carries else flanges,
            payload_body=model.body(f"{PAYLOAD_PREFIX}payload").id if carries else -1,
            yielding_dof=np.concatenate([slides, hinges[turning]]),
            hanging_dof=hinges[~turning],
            payload_dof=model.jnt_dofadr[between].astype(np.intp),
            base_dof=np.flatnonzero(np.isin(model.dof_jntid, base)).astype(np.intp),
        )


def robots_with(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str) -> int:
    """Number of consecutive robots, from omnid1 on, that have an object of this kind and name."""
    robots = 0
    while mujoco.mj_name2id(model, kind, f"omnid{robots + 1}/{name}") >= 0:
        robots += 1
    return robots


def ids_of(look_up: Callable[[str], Any], robots: int, names: Sequence[str]) -> Index:
    """Ids of named objects of every robot, shape (N, number of names).

    Raises:
        KeyError: a name does not exist.
    """
    ids = [[look_up(f"omnid{i + 1}/{name}").id for name in names] for i in range(robots)]
    return np.array(ids, dtype=np.intp)


def _added(model: mujoco.MjModel, own: Index, kind: mujoco.mjtJoint) -> Index:
    """Addresses in ``qvel`` of the joints of one type that effects have added."""
    joints = np.setdiff1d(np.flatnonzero(model.jnt_type == kind), own)
    return model.jnt_dofadr[joints].astype(np.intp)


def _base_joints(model: mujoco.MjModel) -> Index:
    """Ids of free joints and of joints named ``.../wheel_*``."""
    wheel = [model.joint(j).name.rsplit("/", 1)[-1].startswith("wheel_") for j in range(model.njnt)]
    return np.flatnonzero(
        np.array(wheel, dtype=bool) | (model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    ).astype(np.intp)


@dataclass(frozen=True)
class BaseIndex:
    """Addresses of the bases of N released robots; wheels in the order of ``WHEELS``."""

    # addresses of the wheels in ``qpos`` and ``qvel``, shape (N, 4)
    wheel_qpos: Index
    wheel_dof: Index
    drive: Index  # addresses of the wheels' motors in ``ctrl``, shape (N, 4)
    chassis: Index  # body ids, shape (N,)
    free_qpos: Index  # address of the free joint of every chassis in ``qpos``, shape (N,)
    # for each geom, the wheel of which it is a roller (4 robot + wheel, from 0), or -1; shape (ngeom,)
    geom_wheel: Index

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return len(self.chassis)

    @classmethod
    def of(cls, model: mujoco.MjModel) -> BaseIndex:
        """Look up all addresses in a compiled scene.

        Raises:
            InputError: a robot is parked, or there is no robot.
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
        """Pose of every chassis in the world: x, y [m], yaw within +-pi [rad], shape (N, 3)."""
        w, x, y, z = data.qpos[self.free_qpos[:, None] + np.arange(3, 7)].T
        at = data.qpos[self.free_qpos[:, None] + np.arange(2)]
        yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        return np.column_stack([at, yaw])

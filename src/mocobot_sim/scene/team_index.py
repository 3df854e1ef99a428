"""Addresses of the team's joints, sites and constraints in a compiled model, looked up by name."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.intp]

GIMBAL_AXES = ("z", "y", "x")
SLIDES = ("platform_x", "platform_y", "platform_z")
PAYLOAD_PREFIX = "omnid1/payload/"


@dataclass(frozen=True)
class TeamIndex:
    """Where each robot's coordinates live; every joint here has one coordinate.

    Attributes:
        motor_qpos, spring_qpos, gimbal_qpos, slide_qpos: positions in ``qpos``, (N, 3); gimbal order z, y, x.
        motor_dof, spring_dof, gimbal_dof, slide_dof, knee_dof: positions in ``qvel``; (N, 3), knees (N, 6).
        actuator: positions in ``ctrl``, shape (N, 3).
        grasp_site: the flange's site of every robot, shape (N,).
        payload_site: the payload's grasp site of every robot, shape (N,).
        payload_body: body id of the payload.
        yielding_dof: slides that effects have added: bases and grasps that yield, are loose or creep.
        hanging_dof: hinges that effects have added: what swings in the payload.
        base_dof: free chassis, wheels and rollers; none in a team that is parked.
    """

    motor_qpos: Index
    spring_qpos: Index
    gimbal_qpos: Index
    slide_qpos: Index
    motor_dof: Index
    spring_dof: Index
    gimbal_dof: Index
    slide_dof: Index
    knee_dof: Index
    actuator: Index
    grasp_site: Index
    payload_site: Index
    payload_body: int
    yielding_dof: Index
    hanging_dof: Index
    base_dof: Index

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return len(self.grasp_site)

    @classmethod
    def of(cls, model: mujoco.MjModel) -> TeamIndex:
        """Look everything up by name.

        Raises:
            KeyError: the model is not a team scene (the message names what is missing).
        """
        robots = 0
        while mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, f"omnid{robots + 1}/grasp") >= 0:
            robots += 1
        prefixes = [f"omnid{i + 1}/" for i in range(robots)]

        def joints(names: list[str]) -> list[int]:
            return [model.joint(name).id for name in names]

        motor = np.array([joints([f"{p}motor{k}" for k in (1, 2, 3)]) for p in prefixes], dtype=np.intp)
        spring = np.array([joints([f"{p}spring{k}" for k in (1, 2, 3)]) for p in prefixes], dtype=np.intp)
        gimbal = np.array(
            [joints([f"{p}gimbal_{axis}" for axis in GIMBAL_AXES]) for p in prefixes], dtype=np.intp
        )
        slide = np.array([joints([f"{p}{name}" for name in SLIDES]) for p in prefixes], dtype=np.intp)
        knee = np.array(
            [
                joints([f"{p}knee{k}_{motion}" for k in (1, 2, 3) for motion in ("swing", "tilt")])
                for p in prefixes
            ],
            dtype=np.intp,
        )
        base = _base_joints(model)
        own = np.concatenate([joints.ravel() for joints in (motor, spring, gimbal, slide, knee, base)])
        return cls(
            motor_qpos=model.jnt_qposadr[motor].astype(np.intp),
            spring_qpos=model.jnt_qposadr[spring].astype(np.intp),
            gimbal_qpos=model.jnt_qposadr[gimbal].astype(np.intp),
            slide_qpos=model.jnt_qposadr[slide].astype(np.intp),
            motor_dof=model.jnt_dofadr[motor].astype(np.intp),
            spring_dof=model.jnt_dofadr[spring].astype(np.intp),
            gimbal_dof=model.jnt_dofadr[gimbal].astype(np.intp),
            slide_dof=model.jnt_dofadr[slide].astype(np.intp),
            knee_dof=model.jnt_dofadr[knee].astype(np.intp),
            actuator=np.array(
                [[model.actuator(f"{p}motor{k}").id for k in (1, 2, 3)] for p in prefixes], dtype=np.intp
            ),
            grasp_site=np.array([model.site(f"{p}grasp").id for p in prefixes], dtype=np.intp),
            payload_site=np.array(
                [model.site(f"{PAYLOAD_PREFIX}grasp{i + 1}").id for i in range(robots)], dtype=np.intp
            ),
            payload_body=model.body(f"{PAYLOAD_PREFIX}payload").id,
            yielding_dof=_added(model, own, mujoco.mjtJoint.mjJNT_SLIDE),
            hanging_dof=_added(model, own, mujoco.mjtJoint.mjJNT_HINGE),
            base_dof=np.flatnonzero(np.isin(model.dof_jntid, base)).astype(np.intp),
        )


def _added(model: mujoco.MjModel, own: Index, kind: mujoco.mjtJoint) -> Index:
    """Positions in ``qvel`` of joints of one kind that the robots as designed do not have: effects add them."""
    joints = np.setdiff1d(np.flatnonzero(model.jnt_type == kind), own)
    return model.jnt_dofadr[joints].astype(np.intp)


def _base_joints(model: mujoco.MjModel) -> Index:
    """Free joints, and joints called ``.../wheel_*``."""
    wheel = [model.joint(j).name.rsplit("/", 1)[-1].startswith("wheel_") for j in range(model.njnt)]
    return np.flatnonzero(
        np.array(wheel, dtype=bool) | (model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    ).astype(np.intp)

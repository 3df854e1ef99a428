"""A log of joints made ready to be shown: poses and shapes of the model's bodies, measured torques and the model's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from discrepancy.joints.mechanics import inverse_torque
from discrepancy.joints.model import SerialModel
from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from mocobot_logs.joints.joint_log import JointLog
from mocobot_view.bodies.primitives import Triangles, capsule, join
from mocobot_view.bodies.shapes import Shape, body_shape

POSE_HZ, SERIES_HZ = 60.0, 500.0
"""Poses and samples a second that are drawn, at most."""
SMOOTH_HZ, SMOOTH_SHARE = 20.0, 0.1
"""Low-pass of the positions that the model's torques are computed from; a share of the rate where that is less."""
BONE_M, BONE_RGBA = 0.02, (0.75, 0.77, 0.80, 1.0)
"""What is drawn between the joints of a model that shows nothing."""
_POINT = 1e-6  # shorter bones are none [m]
_TURN = [1, 2, 3, 0]  # MuJoCo's quaternions are (w, x, y, z), the viewer's (x, y, z, w)


@dataclass(frozen=True, eq=False)
class JointReplay:
    """All that is drawn of one log.

    Attributes:
        name: root of its entities, unique among the logs shown together.
        log: the samples.
        joints: names of the joints.
        units: of their positions and of their torques.
        shapes: of every body that shows something, in its frame.
        time: of the poses [s], shape (P,).
        position, quaternion: of those bodies in the world, by name, shape (P, 3) and (P, 4), (x, y, z, w).
        reach: centre [m], (3,), and radius [m] of a ball around the robot in all poses.
        series_time: of the series [s], shape (S,).
        asked: torques that the model asks for without friction, shape (S, J).
        every: samples of the log from one of the series to the next.
    """

    name: str
    log: JointLog
    joints: tuple[str, ...]
    units: tuple[tuple[str, str], ...]
    shapes: Mapping[str, Shape]
    time: Array
    position: Mapping[str, Array]
    quaternion: Mapping[str, Array]
    reach: tuple[Array, float]
    series_time: Array
    asked: Array
    every: int

    @property
    def notes(self) -> tuple[str, ...]:
        """What a viewer should know, sentences."""
        return self.log.notes


def joint_replay(model: SerialModel, log: JointLog, name: str) -> JointReplay:
    """Work out everything that is drawn of a log.

    Args:
        model: the robot.
        log: of its joints.
        name: what to call it.
    """
    shapes = _shapes(model.model)
    step = max(1, round(log.rate_hz / POSE_HZ))
    places, turns, reach = _poses(model.model, log.q[::step], list(shapes))
    every = max(1, round(log.rate_hz / SERIES_HZ))
    q = low_pass(log.q, log.rate_hz, min(SMOOTH_HZ, SMOOTH_SHARE * log.rate_hz))
    dq = differentiate(q, log.rate_hz)
    ddq = differentiate(dq, log.rate_hz)
    return JointReplay(
        name=name,
        log=log,
        joints=model.joints,
        units=tuple(("m", "N") if slides else ("rad", "N m") for slides in model.slides),
        shapes=shapes,
        time=log.time[::step],
        position=places,
        quaternion=turns,
        reach=reach,
        series_time=log.time[::every],
        asked=inverse_torque(model.model, q[::every], dq[::every], ddq[::every]),
        every=every,
    )


def _poses(
    model: mujoco.MjModel, q: Array, names: list[str]
) -> tuple[dict[str, Array], dict[str, Array], tuple[Array, float]]:
    data = mujoco.MjData(model)
    position = np.empty((len(q), model.nbody, 3))
    quaternion = np.empty((len(q), model.nbody, 4))
    for k, pose in enumerate(q):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        position[k], quaternion[k] = data.xpos, data.xquat
    low, high = position[:, 1:].min(axis=(0, 1)), position[:, 1:].max(axis=(0, 1))
    reach = (low + high) / 2.0, float(max(np.linalg.norm(high - low) / 2.0, 0.1))
    ids = {name: _body(model, name) for name in names}
    return (
        {name: position[:, b] for name, b in ids.items()},
        {name: quaternion[:, b][:, _TURN] for name, b in ids.items()},
        reach,
    )


def _shapes(model: mujoco.MjModel) -> dict[str, Shape]:
    """By body name, or number where it has none; bones where nothing that moves shows anything."""
    names = [model.body(b).name or f"body{b}" for b in range(model.nbody)]
    shapes = {names[b]: body_shape(model, [b]) for b in range(model.nbody)}
    found = {name: shape for name, shape in shapes.items() if shape is not None}
    moving = {names[int(b)] for b in model.jnt_bodyid}
    return found if moving & set(found) else found | _bones(model, names)


def _bones(model: mujoco.MjModel, names: list[str]) -> dict[str, Shape]:
    """A rod from every body to each of its children, or to its centre of mass where it is the last."""
    bones = {}
    for b in range(1, model.nbody):
        children = np.flatnonzero(model.body_parentid == b)
        ends = [end for end in model.body_pos[children] if np.linalg.norm(end) > _POINT] or [
            model.body_ipos[b]
        ]
        rods = [_rod(end) for end in ends if np.linalg.norm(end) > _POINT]
        if rods:
            bones[names[b]] = Shape.of(join(rods), BONE_RGBA)
    return bones


def _rod(end: Array) -> Triangles:
    """A capsule from the origin to a point."""
    length = float(np.linalg.norm(end))
    z = end / length
    x = np.linalg.svd(z[None])[2][1]
    R = np.column_stack([x, np.cross(z, x), z])
    return capsule(min(BONE_M, 0.2 * length), length / 2.0).moved(end / 2.0, R)


def _body(model: mujoco.MjModel, name: str) -> int:
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    return found if found >= 0 else int(name.removeprefix("body"))

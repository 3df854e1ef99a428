"""From where a replay's 3D views are seen: as near as can be, with everything in sight."""

import numpy as np
import rerun.blueprint as rrb

from estimator.arrays import Array
from mocobot_view.bodies.robot import robot_shapes
from mocobot_view.pictures.camera import CORNERS, Camera, clearest, framing
from mocobot_view.replay.replay_trial import ReplayTrial
from mocobot_view.sizes import FORCE_M_PER_N

FOVY_DEG = 55.0
"""Vertical angle of view of the viewer's 3D views [deg]."""
AZIMUTH, ELEVATION = 135.0, -36.0
"""Direction of view that is preferred [deg]."""
INSTANTS = 50
"""Of a trial, at which everything must be in sight."""


def scene_eye(trial: ReplayTrial, aspect: float) -> rrb.EyeControls3D:
    """All robots and the payload over the whole trial, from where the robots hide each other least.

    Args:
        trial: what is shown.
        aspect: width over height of the narrowest view that must hold it.
    """
    return _eye(clearest(_seen(trial), trial.bases.p_Wb, AZIMUTH, ELEVATION, aspect, FOVY_DEG))


def path_eye(trial: ReplayTrial, robot: int, aspect: float) -> rrb.EyeControls3D:
    """A robot's whole wrist path, measured and commanded, in its {b}; robots count from 0."""
    ref = trial.recording.ref
    paths = [trial.bodies.wrist[:, robot]] if ref is None else [trial.bodies.wrist[:, robot], ref[:, robot]]
    return _eye(framing(np.concatenate(paths), AZIMUTH, ELEVATION, aspect, FOVY_DEG))


def _seen(trial: ReplayTrial) -> Array:
    """Corners of the boxes around robots and payload and the tips of the forces in the world [m], shape (K, 3)."""
    standing = _box(robot_shapes(trial.recording.metadata.design).standing.triangles.vertices)
    every = slice(None, None, max(1, len(trial.time) // INSTANTS))
    points = []
    for R, p, wrist in zip(
        trial.bases.R_Wb, trial.bases.p_Wb, np.swapaxes(trial.bodies.wrist[every], 0, 1), strict=True
    ):
        points += [standing @ R.T + p, wrist @ R.T + p]
    if trial.data is not None:
        data, few = trial.data, slice(None, None, max(1, len(trial.data.time) // INSTANTS))
        tips = data.p_bi[few] + FORCE_M_PER_N * np.einsum(
            "qnij,qnj->qni", data.R_bi[few], data.wrench[few, :, 3:]
        )
        points.append((np.einsum("nij,qnj->qni", trial.bases.R_Wb, tips) + trial.bases.p_Wb).reshape(-1, 3))
    if trial.motion is not None and trial.shape is not None:
        held = _box(trial.shape.triangles.vertices)
        R_W1, p_W1 = trial.motion.R_W1[every], trial.motion.p_W1[every]
        points.append((held @ np.swapaxes(R_W1, -1, -2) + p_W1[:, None]).reshape(-1, 3))
    return np.concatenate(points)


def _box(vertices: Array) -> Array:
    """Corners of the box around points, shape (8, 3)."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return 0.5 * (low + high) + 0.5 * CORNERS * (high - low)


def _eye(camera: Camera) -> rrb.EyeControls3D:
    target = np.array(camera.lookat)
    position = target - camera.distance * camera.axes()[2]
    return rrb.EyeControls3D(position=position, look_target=target, eye_up=(0.0, 0.0, 1.0))

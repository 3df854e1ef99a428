"""The robots of a replay in Rerun: shapes once, joint motion as columns, wrist paths, forces, marks of a diagnosis."""

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from mocobot_view import colours
from mocobot_view.bodies.robot import PATHS, TINTED, fixed_frames, robot_shapes
from mocobot_view.bodies.shapes import Shape
from mocobot_view.colours import FORCE_M_PER_N, MARK_M, Colour
from mocobot_view.facts.cause_body import by_place
from mocobot_view.replay.log_time import send, send_poses
from mocobot_view.replay.replay_trial import ReplayTrial

TRAIL_HZ = 25.0
"""Pieces of a wrist path per second; it is drawn only, the samples are among the series."""


def log_robots(stream: rr.RecordingStream, trial: ReplayTrial) -> None:
    """Log all robots below the trial's root."""
    shapes = robot_shapes(trial.recording.metadata.design)
    for i in range(trial.robots):
        robot = f"{trial.name}/omnid{i + 1}"
        turn = Rotation.from_matrix(trial.bases.R_Wb[i]).as_quat()
        standing = rr.Transform3D(translation=trial.bases.p_Wb[i], quaternion=turn)
        stream.log(f"{robot}/base", standing, static=True)
        log_shape(stream, f"{robot}/base/shape", shapes.standing)
        foot = [0.0, 0.0, 0.02 - shapes.base_height_m]
        log_label(stream, f"{robot}/base/name", foot, f"omnid{i + 1}", colours.of_robot(i + 1))
        for path, (position, quaternion) in fixed_frames(trial.recording.metadata.design).items():
            fixed = rr.Transform3D(translation=position, quaternion=rr.Quaternion(xyzw=quaternion))
            stream.log(f"{robot}/{path}", fixed, static=True)
        send_poses(stream, f"{robot}/{PATHS['platform']}", trial.time, trial.bodies.wrist[:, i], None)
        for body, turn in trial.bodies.turns.items():
            send_poses(stream, f"{robot}/{PATHS[body]}", trial.time, None, turn[:, i])
        for body, shape in shapes.moving.items():
            tinted = shape.in_colour(colours.of_robot(i + 1)) if body in TINTED else shape
            log_shape(stream, f"{robot}/{PATHS[body]}/shape", tinted)
        _log_paths(stream, trial, i)
        _log_force(stream, trial, i)


def log_causes(stream: rr.RecordingStream, trial: ReplayTrial) -> None:
    """Mark every cause of the diagnosis where it sits; several at one place share a mark."""
    named = trial.diagnosis.causes if trial.diagnosis else ()
    for (robot, body), causes in by_place(named).items():
        position = np.zeros(3)
        place = "payload" if robot is None else f"omnid{robot}/{PATHS[body] if body else 'base'}"
        if robot is None and trial.facts is not None and trial.facts.p_1c is not None:
            position = trial.facts.p_1c
        path = f"{trial.name}/{place}/cause"
        label = ", ".join(f"! {cause.name}" for cause in causes)
        stream.log(path, rr.Points3D([position], colors=[colours.FAULT], radii=MARK_M), static=True)
        log_label(stream, f"{path}/name", position + np.array([0.0, 0.0, 2.0 * MARK_M]), label, colours.FAULT)


def log_label(
    stream: rr.RecordingStream, path: str, position: ArrayLike, text: str, colour: Colour, show: bool = True
) -> None:
    """Write text at a point of the entity's parents' frame, readable on the viewer's dark labels."""
    pale = [colours.pale(colour)]
    stream.log(
        path, rr.Points3D([position], labels=[text], colors=pale, radii=0.001, show_labels=show), static=True
    )


def log_shape(stream: rr.RecordingStream, path: str, shape: Shape) -> None:
    """Log a coloured mesh once, in the frame of the entity's parents."""
    mesh = shape.triangles
    drawn = rr.Mesh3D(
        vertex_positions=mesh.vertices.astype(np.float32),
        vertex_normals=mesh.normals.astype(np.float32),
        triangle_indices=mesh.faces,
        vertex_colors=shape.rgba,
    )
    stream.log(path, drawn, static=True)


def trail_paths(trial: ReplayTrial) -> list[str]:
    """Entities that hold wrist paths piece by piece, to be seen over a window of time."""
    return [f"{trial.name}/omnid{i + 1}/base/wrist" for i in range(trial.robots)]


def _log_paths(stream: rr.RecordingStream, trial: ReplayTrial, i: int) -> None:
    """Measured and commanded wrist positions in {b}, piece by piece."""
    every = slice(None, None, max(1, round(trial.recording.metadata.rate_hz / TRAIL_HZ)))
    path = f"{trial.name}/omnid{i + 1}/base/wrist"
    paths, looks = [trial.bodies.wrist[:, i]], [(colours.of_robot(i + 1), 1.5)]
    if trial.recording.ref is not None:
        paths.append(trial.recording.ref[:, i])
        looks.append((colours.COMMAND, 1.0))
    corners = np.stack([p[every] for p in paths], axis=1).astype(np.float32)
    pieces = np.stack([corners[:-1], corners[1:]], axis=2)  # (pieces, paths, 2, 3)
    tones, radii = zip(*looks, strict=True)
    look = rr.LineStrips3D.from_fields(colors=tones, radii=rr.Radius.ui_points(radii))
    stream.log(path, look, static=True)
    strips = rr.LineStrips3D.columns(strips=pieces.reshape(-1, 2, 3))
    send(stream, path, trial.time[every][1:], strips.partition(np.full(len(pieces), len(paths))))


def _log_force(stream: rr.RecordingStream, trial: ReplayTrial, i: int) -> None:
    """Force of the robot on the payload, in {i}; it ends where the filtered data do."""
    if trial.data is None:
        return
    path = f"{trial.name}/omnid{i + 1}/{PATHS['flange']}/force"
    force = trial.data.wrench[:, i, 3:]
    stream.log(path, rr.Arrows3D.from_fields(colors=colours.of_robot(i + 1), radii=0.008), static=True)
    time = np.append(trial.data.time, trial.data.time[-1] + 1.0 / trial.data.rate_hz)
    counts = np.append(np.ones(len(force), dtype=int), 0)
    vectors = (FORCE_M_PER_N * force).astype(np.float32)
    send(stream, path, time, rr.Arrows3D.columns(vectors=vectors).partition(counts))

"""Replay of a joint log in Rerun: robot motion, and position, command, torque and model torque of every joint."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from discrepancy.joints.mechanics import inverse_torque
from discrepancy.joints.model import SerialModel
from discrepancy.joints.problem import FADE_S
from discrepancy.result.traces import Trace
from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from mocobot_logs.joints.joint_log import JointLog
from mocobot_view import colours
from mocobot_view.blueprint import playing, plot_view, world_view
from mocobot_view.colours import Colour
from mocobot_view.shapes import Shape, Triangles, body_shape, capsule, join
from mocobot_view.stream import begin, log_lines, log_shape, send, send_poses

POSE_HZ, SERIES_HZ = 60.0, 500.0  # largest rates of drawn poses and of samples in the series [Hz]. Chosen.
SMOOTH_HZ, SMOOTH_SHARE = 20.0, 0.1
"""Cut-off of the low-pass filter of positions for the model torques: the smaller of SMOOTH_HZ [Hz] and SMOOTH_SHARE
times the sample rate. Chosen."""
BONE_M, BONE_RGBA = 0.02, (0.75, 0.77, 0.80, 1.0)
"""Radius [m] and colour of the rods that are drawn for a model without visible geometry. Chosen."""
_POINT = 1e-6  # shorter rods are not drawn [m]
_TURN = [1, 2, 3, 0]  # MuJoCo's quaternions are (w, x, y, z), the viewer's (x, y, z, w)


@dataclass(frozen=True, eq=False)
class JointReplay:
    """Data of the replay of one log."""

    name: str  # root of its entities, unique among the replays shown together
    log: JointLog
    joints: tuple[str, ...]  # names of the J joints
    units: tuple[tuple[str, str], ...]  # units of position and torque of every joint
    shapes: Mapping[str, Shape]  # shape of every visible body in its frame, by name
    time: Array  # times of the poses [s], shape (P,)
    # position, quaternion: poses of those bodies in the world, by name: positions [m], shape (P, 3), and quaternions
    # (x, y, z, w), shape (P, 4)
    position: Mapping[str, Array]
    quaternion: Mapping[str, Array]
    # centre [m], shape (3,), and radius [m] of a ball that contains the robot in all poses
    reach: tuple[Array, float]
    series_time: Array  # times of the series [s], shape (S,)
    asked: Array  # inverse-dynamics torques of the model without friction [N m or N], shape (S, J)
    every: int  # number of log samples per sample of the series
    # anchor, axis: place and direction of every joint in the world, shape (P, J, 3) each [m] and [1]
    anchor: Array
    axis: Array
    # torques of the model with the causes of a diagnosis at the times of the series, shape (S, J), NaN where they are
    # not known; None without a diagnosis
    found: Array | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        if self.log.torque is None:
            return self.log.notes
        said = "Arrows are torques, by the right-hand rule, in shares of the joint's largest: blue measured"
        return (
            *self.log.notes,
            f"{said}{'' if self.found is None else ', green the model with the causes'}.",
        )

    @property
    def torques(self) -> dict[str, tuple[Array, Colour]]:
        """Torques to draw as arrows at the times of the poses, shape (P, J) each, with their colours, by name."""
        if self.log.torque is None:
            return {}
        at = np.clip(np.searchsorted(self.log.time, self.time), 0, len(self.log.time) - 1)
        out = {"measured": (self.log.torque[at], MEASURED)}
        if self.found is not None:
            each = [np.interp(self.time, self.series_time, values) for values in self.found.T]
            out["corrected"] = np.column_stack(each), FOUND
        return out


def joint_replay(
    model: SerialModel, log: JointLog, name: str, traces: Sequence[Trace] = (), columns: Sequence[int] = ()
) -> JointReplay:
    """Compute the data of the replay of a log.

    ``traces`` are residuals of a diagnosis of this log, with measured torques; ``columns`` tells the joint of each of
    their channels, from 0.
    """
    shapes = _shapes(model.model)
    step = max(1, round(log.rate_hz / POSE_HZ))
    names = {b: model.model.body(b).name or f"body{b}" for b in shapes}
    position, quaternion, reach, joints = _poses(model.model, model.coupling.all(log.q[::step])[0])
    every = max(1, round(log.rate_hz / SERIES_HZ))
    q = low_pass(log.q, log.rate_hz, min(SMOOTH_HZ, SMOOTH_SHARE * log.rate_hz))
    dq = differentiate(q, log.rate_hz)
    ddq = differentiate(dq, log.rate_hz)
    return JointReplay(
        name=name,
        log=log,
        joints=model.joints,
        units=tuple(("m", "N") if slides else ("rad", "N m") for slides in model.slides),
        shapes={names[b]: shape for b, shape in shapes.items()},
        time=log.time[::step],
        position={name: position[:, b] for b, name in names.items()},
        quaternion={name: quaternion[:, b] for b, name in names.items()},
        reach=reach,
        series_time=log.time[::every],
        asked=inverse_torque(model.model, q[::every], dq[::every], ddq[::every]),
        every=every,
        anchor=joints[0][:, model.coupling.own],
        axis=joints[1][:, model.coupling.own],
        found=_found(log.time[::every], traces, columns, len(model.joints)) if traces else None,
    )


def _found(time: Array, traces: Sequence[Trace], columns: Sequence[int], joints: int) -> Array:
    """Interpolate the torques with the causes, and leave out the ends of the log, where the rows fade."""
    out = np.full((len(time), joints), np.nan)
    rows = np.concatenate([trace.time for trace in traces])
    order, inside = np.argsort(rows), (time > time[0] + FADE_S) & (time < time[-1] - FADE_S)
    modelled = np.concatenate([t.measured - t.after for t in traces if t.measured is not None])
    for channel, j in enumerate(columns):
        out[inside, j] = np.interp(time[inside], rows[order], modelled[order, channel])
    return out


def _poses(model: mujoco.MjModel, q: Array) -> tuple[Array, Array, tuple[Array, float], Array]:
    """Compute the poses of bodies and joints.

    Returns positions and quaternions (x, y, z, w) of all bodies, (P, B, 3) and (P, B, 4), a ball around them, and
    anchors and axes of the joints, (2, P, J, 3).
    """
    joints = np.empty((2, len(q), model.njnt, 3))
    data = mujoco.MjData(model)
    position = np.empty((len(q), model.nbody, 3))
    quaternion = np.empty((len(q), model.nbody, 4))
    for k, pose in enumerate(q):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        position[k], quaternion[k] = data.xpos, data.xquat
        joints[0, k], joints[1, k] = data.xanchor, data.xaxis
    low, high = position[:, 1:].min(axis=(0, 1)), position[:, 1:].max(axis=(0, 1))
    reach = (low + high) / 2.0, float(max(np.linalg.norm(high - low) / 2.0, 0.1))
    return position, quaternion[..., _TURN], reach, joints


def _shapes(model: mujoco.MjModel) -> dict[int, Shape]:
    """Return the shapes by body; rods are added if no body with a joint has visible geometry."""
    shapes = {b: shape for b in range(model.nbody) if (shape := body_shape(model, [b])) is not None}
    return shapes if {int(b) for b in model.jnt_bodyid} & set(shapes) else shapes | _bones(model)


def _bones(model: mujoco.MjModel) -> dict[int, Shape]:
    """Make rods from every body to its children, or to its centre of mass if it has none."""
    bones = {}
    for b in range(1, model.nbody):
        children = model.body_pos[np.flatnonzero(model.body_parentid == b)]
        ends = [end for end in children if np.linalg.norm(end) > _POINT] or [model.body_ipos[b]]
        rods = [_rod(end) for end in ends if np.linalg.norm(end) > _POINT]
        if rods:
            bones[b] = Shape.of(join(rods), BONE_RGBA)
    return bones


def _rod(end: Array) -> Triangles:
    """Make a capsule from the origin to a point [m]."""
    length = float(np.linalg.norm(end))
    z = end / length
    x = np.linalg.svd(z[None])[2][1]
    R = np.column_stack([x, np.cross(z, x), z])
    return capsule(min(BONE_M, 0.2 * length), length / 2.0).moved(end / 2.0, R)


MEASURED, ASKED, FOUND, COMMANDED = *map(colours.of_robot, (1, 2, 3)), colours.COMMAND
ARROW_SHARE, THICK_SHARE = 0.45, 0.012
"""Length of the arrow of a joint's largest torque, and radius of an arrow, over the robot's radius. Chosen."""
SHOWN = 4  # number of joints in one tab of plots. Chosen.


def log_joint_replay(
    stream: rr.RecordingStream,
    replays: Sequence[JointReplay],
    progress: Callable[[int], object] | None = None,
) -> None:
    """Log replays side by side, each below a root with its name, on one timeline that starts at 0."""
    columns = [_column(replay) for replay in replays]
    layout = playing(columns[0] if len(columns) == 1 else rrb.Horizontal(*columns))
    begin(stream, layout, [replay.name for replay in replays])
    for replay in replays:
        for body, shape in replay.shapes.items():
            path = f"{replay.name}/robot/{rr.escape_entity_path_part(body)}"
            send_poses(stream, path, replay.time, replay.position[body], replay.quaternion[body])
            log_shape(stream, f"{path}/shape", shape)
        _log_arrows(stream, replay)
        _log_series(stream, replay)
        if progress:
            progress(1)


def _log_arrows(stream: rr.RecordingStream, replay: JointReplay) -> None:
    """Log the torques as arrows along the axes; those of the model lie beside the measured ones."""
    radius = THICK_SHARE * replay.reach[1]
    sideways = np.cross(replay.axis, (0.0, 0.0, 1.0)) + np.cross(replay.axis, (0.0, 1e-3, 0.0))
    sideways /= np.linalg.norm(sideways, axis=-1, keepdims=True)
    for number, (what, (torque, colour)) in enumerate(replay.torques.items()):
        largest = np.nanmax(np.abs(np.nan_to_num(replay.torques["measured"][0])), axis=0)
        share = np.nan_to_num(torque) / np.where(largest > 0.0, largest, 1.0)
        vectors = ARROW_SHARE * replay.reach[1] * share[..., None] * replay.axis
        origins = replay.anchor + 3.0 * number * radius * sideways
        for j in np.flatnonzero(largest):
            path = f"{replay.name}/torque/{rr.escape_entity_path_part(replay.joints[j])}/{what}"
            stream.log(path, rr.Arrows3D.from_fields(colors=colour, radii=radius), static=True)
            columns = rr.Arrows3D.columns(
                origins=origins[:, j].astype(np.float32), vectors=vectors[:, j].astype(np.float32)
            )
            send(stream, path, replay.time, columns)


def _log_series(stream: rr.RecordingStream, replay: JointReplay) -> None:
    log = replay.log
    q, torque, command, duty = (
        None if x is None else x[:: replay.every]
        for x in (log.q, log.torque, log.command if log.drive.command == "position" else None, log.drive.duty)
    )
    lines = (
        ("position", "measured", q, MEASURED),
        ("torque", "measured", torque, MEASURED),
        ("torque", "model, without friction", replay.asked, ASKED),
        ("torque", "corrected, with the causes", replay.found, FOUND),
        ("position", "commanded", command, COMMANDED),
        ("duty", "measured", duty, MEASURED),
    )
    for j in range(len(replay.joints)):
        for quantity, name, values, colour in lines:
            if values is not None and np.isfinite(values[:, j]).any():
                path = f"{_series(replay, j)}/{quantity}/{name.split(',')[0]}"
                log_lines(stream, path, replay.series_time, values[:, [j]], [name], [colour])


def _series(replay: JointReplay, j: int) -> str:
    return f"{replay.name}/series/{rr.escape_entity_path_part(replay.joints[j])}"


def _column(replay: JointReplay) -> rrb.Horizontal:
    tabs = []
    for first in range(0, len(replay.joints), SHOWN):
        shown = range(first, min(first + SHOWN, len(replay.joints)))
        name = replay.joints[shown[0]] + (f" to {replay.joints[shown[-1]]}" if len(shown) > 1 else "")
        plots = [_plots(replay, j) for j in shown]
        tabs.append(rrb.Vertical(*plots, name=name))
    return rrb.Horizontal(_scene(replay), rrb.Tabs(*tabs), column_shares=[1.0, 1.4])


def _plots(replay: JointReplay, j: int) -> rrb.Horizontal:
    log, (length, force) = replay.log, replay.units[j]
    quantities = {
        "position": f"position [{length}]" + ("" if log.command is None else " (white: command)"),
        "torque": f"torque [{force}] (orange: model{'' if replay.found is None else '; green: with the causes'})",
    }
    if log.drive.duty is not None:
        quantities["duty"] = "duty"
    root, joint = _series(replay, j), replay.joints[j]
    views = [plot_view(f"/{root}/{name}", f"{joint}: {title}") for name, title in quantities.items()]
    return rrb.Horizontal(*views)


def _scene(replay: JointReplay) -> rrb.Spatial3DView:
    centre, radius = replay.reach
    eye = centre + 2.6 * radius * np.array([0.75, -0.85, 0.45]) / np.linalg.norm([0.75, -0.85, 0.45])
    controls = rrb.EyeControls3D(position=eye, look_target=centre, eye_up=(0.0, 0.0, 1.0))
    return world_view(replay.name, ["$origin/robot/**", "$origin/torque/**"], controls)

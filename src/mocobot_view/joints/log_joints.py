"""Logs of joints in Rerun: the robot moving, and every joint's position, command, torque and the model's torque."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from estimator.arrays import Array
from mocobot_view import colours
from mocobot_view.colours import Colour
from mocobot_view.joints.joint_replay import JointReplay
from mocobot_view.replay.blueprint import BACKGROUND, playing
from mocobot_view.replay.log_robots import log_shape
from mocobot_view.replay.log_time import send, send_poses

MEASURED, ASKED, COMMANDED = colours.of_robot(1), colours.of_robot(2), colours.COMMAND
SHOWN = 4
"""Joints whose plots stand below each other in a tab."""


def log_joint_replay(
    stream: rr.RecordingStream,
    replays: Sequence[JointReplay],
    progress: Callable[[int], object] | None = None,
) -> None:
    """Log replays side by side, each below the root of its name, all on one timeline that starts at 0.

    Args:
        stream: where to.
        replays: what is shown.
        progress: called with 1 after each.
    """
    stream.send_blueprint(_blueprint(replays), make_active=True, make_default=True)
    stream.send_recording_name(", ".join(replay.name for replay in replays))
    for replay in replays:
        stream.log(replay.name, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for body, shape in replay.shapes.items():
            path = f"{replay.name}/robot/{rr.escape_entity_path_part(body)}"
            send_poses(stream, path, replay.time, replay.position[body], replay.quaternion[body])
            log_shape(stream, f"{path}/shape", shape)
        _log_series(stream, replay)
        if progress:
            progress(1)


def _log_series(stream: rr.RecordingStream, replay: JointReplay) -> None:
    log, every = replay.log, slice(None, None, replay.every)
    for j in range(len(replay.joints)):
        root = _series(replay, j)
        lines: list[tuple[str, str, Array | None, Colour]] = [
            ("position", "measured", log.q[every, j], MEASURED),
            ("torque", "measured", None if log.torque is None else log.torque[every, j], MEASURED),
            ("torque", "model, without friction", replay.asked[:, j], ASKED),
        ]
        if log.command is not None and log.drive.command == "position":
            lines.append(("position", "commanded", log.command[every, j], COMMANDED))
        if log.drive.duty is not None:
            lines.append(("duty", "measured", log.drive.duty[every, j], MEASURED))
        for quantity, name, values, colour in lines:
            if values is None or not np.isfinite(values).any():
                continue
            path = f"{root}/{quantity}/{name.split(',')[0]}"
            look = rr.SeriesLines(colors=[colour], names=[name], widths=[1.2])
            stream.log(path, look, static=True)
            send(stream, path, replay.series_time, rr.Scalars.columns(scalars=values))


def _series(replay: JointReplay, j: int) -> str:
    return f"{replay.name}/series/{rr.escape_entity_path_part(replay.joints[j])}"


def _blueprint(replays: Sequence[JointReplay]) -> rrb.Blueprint:
    columns = [_column(replay) for replay in replays]
    return playing(columns[0] if len(columns) == 1 else rrb.Horizontal(*columns))


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
        "torque": f"torque [{force}] (orange: model)",
    }
    if log.drive.duty is not None:
        quantities["duty"] = "duty"
    views = [
        rrb.TimeSeriesView(
            origin=f"/{_series(replay, j)}/{quantity}",
            name=f"{replay.joints[j]}: {title}",
            axis_x=rrb.TimeAxis(link="LinkToGlobal"),
            plot_legend=rrb.PlotLegend(visible=False),
        )
        for quantity, title in quantities.items()
    ]
    return rrb.Horizontal(*views)


def _scene(replay: JointReplay) -> rrb.Spatial3DView:
    centre, radius = replay.reach
    eye = centre + 2.6 * radius * np.array([0.75, -0.85, 0.45]) / np.linalg.norm([0.75, -0.85, 0.45])
    return rrb.Spatial3DView(
        origin=f"/{replay.name}",
        contents=["$origin/robot/**"],
        name=replay.name,
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(
            visible=True, spacing=0.25, plane=rr.components.Plane3D.XY, color=(220, 225, 235, 70)
        ),
        eye_controls=rrb.EyeControls3D(position=eye, look_target=centre, eye_up=(0.0, 0.0, 1.0)),
    )

"""Layout of a replay in the viewer: scene on the left, text and plots on the right."""

import uuid
from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from estimator.arrays import Array
from mocobot_view import colours
from mocobot_view.camera import CORNERS, Camera, clearest, framing
from mocobot_view.colours import FORCE_M_PER_N
from mocobot_view.replay_trial import ReplayTrial
from mocobot_view.robot import robot_shapes

TIMELINE = "time"

# Own legends ("keys") replace the viewer's, which hides the first seconds of a plot and has room for few lines.

PARTS = {"joints": ("1", "2", "3"), "axes": ("x", "y", "z"), "robots": ("",)}
"""Legends by name, with the labels of the lines of one robot."""
NAME, DOT, GAP = 2.4, 1.0, 0.6
"""Widths of a robot's name, of a dot, and of the gap between robots, in arbitrary units. Chosen."""
ROBOT = NAME + 3 * DOT + GAP
MIDDLE = 0.3, 0.6
"""Vertical range of a legend, narrow so that its width sets the scale; dots are at 0 with labels below. Chosen."""


def log_keys(stream: rr.RecordingStream, trial: ReplayTrial) -> None:
    """Log all legends below the series in the root of the trial."""
    for key, parts in PARTS.items():
        places, labels, tones, radii = [], [], [], []
        for robot in range(1, trial.robots + 1):
            start = (robot - 1) * ROBOT
            places.append(start + 0.5 * NAME)
            labels.append(f"omnid{robot}")
            shades = colours.shades(robot) if len(parts) == 3 else [colours.of_robot(robot)]
            tones.append(colours.pale(colours.of_robot(robot)))
            radii.append(0.0)
            places += [start + NAME + (k + 0.5) * DOT for k in range(len(parts))]
            labels += parts
            tones += shades
            radii += [5.0] * len(parts)
        dots = rr.Points2D(
            np.column_stack([places, np.zeros(len(places))]),
            labels=labels,
            colors=tones,
            radii=rr.Radius.ui_points(radii),
            show_labels=True,
        )
        stream.log(_path(trial, key), dots, static=True)


def key_view(trial: ReplayTrial, key: str) -> rrb.Spatial2DView:
    """Make the view of a legend, a strip as wide as the plots below it."""
    return rrb.Spatial2DView(
        origin=f"/{_path(trial, key)}",
        name="key",
        titlebar=False,
        visual_bounds=rrb.VisualBounds2D(x_range=(0.0, max(trial.robots, 3) * ROBOT - GAP), y_range=MIDDLE),
    )


def _path(trial: ReplayTrial, key: str) -> str:
    return f"{trial.name}/series/key/{key}"


FOVY_DEG = 55.0  # vertical angle of view of the viewer's 3D views [deg]
AZIMUTH, ELEVATION = 135.0, -36.0  # preferred direction of view [deg]. Chosen.
INSTANTS = 50  # number of instants of a trial at which the view must show everything. Chosen.


def scene_eye(trial: ReplayTrial, aspect: float) -> rrb.EyeControls3D:
    """Place the eye so that it sees robots and payload during the whole trial, with little occlusion.

    ``aspect`` is width over height of the narrowest view that must show everything.
    """
    return _eye(clearest(_seen(trial), trial.bases.p_Wb, AZIMUTH, ELEVATION, aspect, FOVY_DEG))


def path_eye(trial: ReplayTrial, robot: int, aspect: float) -> rrb.EyeControls3D:
    """Place the eye so that it sees a robot's whole wrist path, measured and commanded, in {b}; robots count from 0."""
    ref = trial.recording.ref
    paths = [trial.bodies.wrist[:, robot]] if ref is None else [trial.bodies.wrist[:, robot], ref[:, robot]]
    return _eye(framing(np.concatenate(paths), AZIMUTH, ELEVATION, aspect, FOVY_DEG))


def _seen(trial: ReplayTrial) -> Array:
    """Return corners of boxes around robots and payload, and tips of force arrows, in the world [m], shape (K, 3)."""
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
    """Return the corners of the bounding box of points, shape (8, 3)."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return 0.5 * (low + high) + 0.5 * CORNERS * (high - low)


def _eye(camera: Camera) -> rrb.EyeControls3D:
    target = np.array(camera.lookat)
    position = target - camera.distance * camera.axes()[2]
    return rrb.EyeControls3D(position=position, look_target=target, eye_up=(0.0, 0.0, 1.0))


TRAIL_S = 3.0  # duration of the visible part of the wrist paths [s]. Chosen.
BACKGROUND = (100, 108, 120)
SCENE_ASPECT = {1: 0.7, 2: 1.5}
"""Width over height of the scene by number of trials, 1 for more trials. Measured in a window 800 px wide and slightly
higher."""
KEY_SHARE = 0.07  # height of a legend relative to one plot, in a column of full height. Chosen.
ALL_PLOTS = uuid.UUID("5c0dca6a-e63f-9cf7-f657-2602590474cc")
"""Id of the view with which the viewer stores the shared time range of linked plots (GLOBAL_VIEW_ID in its sources).
Its interface cannot set that range; the default shows only 30 s around the cursor for trials longer than 60 s."""


def blueprint(trials: Sequence[ReplayTrial]) -> rrb.Blueprint:
    """Make the layout; several trials stand side by side, each with its own scene and plots."""
    aspect = SCENE_ASPECT.get(len(trials), 1.0)
    if len(trials) == 1:
        trial = trials[0]
        body: rrb.Container = rrb.Horizontal(
            scene_view(trial, aspect),
            rrb.Tabs(_text(trial), *_series(trial, KEY_SHARE), active_tab=0),
            column_shares=[1.25, 1],
        )
    else:
        columns = [
            rrb.Vertical(
                scene_view(trial, aspect),
                rrb.Tabs(*_series(trial, 2.0 * KEY_SHARE), _text(trial), active_tab=0),
                row_shares=[1, 1],
            )
            for trial in trials
        ]
        body = rrb.Horizontal(*columns) if len(columns) <= 3 else rrb.Grid(*columns)
    _share_range(body, max(float(trial.time[-1]) for trial in trials))
    return playing(body)


def playing(body: rrb.Container) -> rrb.Blueprint:
    """Make a layout that starts playing with collapsed panels."""
    return rrb.Blueprint(
        body,
        rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="playing", loop_mode="all"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def scene_view(trial: ReplayTrial, aspect: float = 1.0) -> rrb.Spatial3DView:
    """Make the 3D view of one trial, seen from above, with everything in sight; ``aspect`` as for ``scene_eye``."""
    window = rrb.VisibleTimeRange(
        TIMELINE,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-TRAIL_S),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    overrides = {path: rrb.VisibleTimeRanges([window]) for path in trail_paths(trial)}
    return world_view(trial.name, ["$origin/**", "- $origin/series/**"], scene_eye(trial, aspect), overrides)


def world_view(
    name: str, contents: list[str], eye: rrb.EyeControls3D, overrides: dict[Any, Any] | None = None
) -> rrb.Spatial3DView:
    """Make a 3D view of the entities below a name, over a floor with a grid."""
    return rrb.Spatial3DView(
        origin=f"/{name}",
        contents=contents,
        name=name,
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(
            visible=True, spacing=0.25, plane=rr.components.Plane3D.XY, color=(220, 225, 235, 70)
        ),
        eye_controls=eye,
        overrides=overrides,
    )


def plot_view(origin: str, title: str, axis_y: rrb.ScalarAxis | None = None) -> rrb.TimeSeriesView:
    """Make a plot of the series below a path, on the time axis that all plots share."""
    return rrb.TimeSeriesView(
        origin=origin,
        name=title,
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        axis_y=axis_y,
        plot_legend=rrb.PlotLegend(visible=False),
    )


def trail_paths(trial: ReplayTrial) -> list[str]:
    """List the entities with the segments of the wrist paths, which are visible for ``TRAIL_S``."""
    return [f"{trial.name}/omnid{i + 1}/base/wrist" for i in range(trial.robots)]


def _series(trial: ReplayTrial, key_share: float) -> list[rrb.Container | rrb.View]:
    tabs = {
        "joints": {"phi": "phi [rad]", "theta": "theta [rad] (1, 2, 3: z, y, x)", "tau": "tau [N m]"},
        "wrist": {
            f"wrist/omnid{i + 1}": f"omnid{i + 1}: wrist in {{b}} [m] (pale: command)"
            for i in range(trial.robots)
        },
        "twist": {"omega": "omega in {i} [rad/s]", "velocity": "v in {i} [m/s]"},
        "wrench": {
            "force": "force on the payload in {i} [N]",
            "moment": "moment on the payload in {i} [N m]",
        },
        "residuals": {
            "grasp_position_mm": "flange to grasp frame [mm]",
            "grasp_rotation_mrad": "flange to grasp frame [mrad]",
            "balance_force": "force balance in {1} [N] (RGB: x, y, z)",
            "balance_moment": "moment balance about the CoM [N m]",
            "joint": "joint between the two bodies [mm or mrad]",
        },
    }
    keys = {"joints": "joints", "residuals": "robots"}
    missing = _missing(trial)
    shown = []
    for name, plots in tabs.items():
        views = [
            _plot(trial, quantity, title) for quantity, title in plots.items() if quantity not in missing
        ]
        if views:
            strip = key_view(trial, keys.get(name, "axes"))
            shares = [key_share * len(views), *[1.0] * len(views)]
            shown.append(rrb.Vertical(strip, *views, row_shares=shares, name=name))
    return [*shown[:2], _paths(trial), *shown[2:]]


def _paths(trial: ReplayTrial) -> rrb.Grid:
    """Make close views of the whole path of every wrist in its {b}."""
    whole = rrb.VisibleTimeRange(
        TIMELINE, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.infinite()
    )
    columns = 1 if trial.robots <= 2 else 2
    aspect = 0.75 * -(-trial.robots // columns) / columns
    views = [
        rrb.Spatial3DView(
            origin=f"/{path}",
            name=f"omnid{i + 1} (white: command)",
            background=BACKGROUND,
            line_grid=False,
            spatial_information=rrb.SpatialInformation(target_frame=f"tf#/{path}", show_axes=True),
            eye_controls=path_eye(trial, i, aspect),
            time_ranges=[whole],
        )
        for i, path in enumerate(trail_paths(trial))
    ]
    return rrb.Grid(*views, grid_columns=columns, name="paths")


def _missing(trial: ReplayTrial) -> set[str]:
    """Return the names of the series that this trial lacks."""
    given = {
        ("omega", "velocity", "force", "moment"): trial.data,
        ("grasp_position_mm", "grasp_rotation_mrad"): trial.motion,
        ("balance_force",): trial.balance,
        ("joint",): trial.two,
        ("balance_moment",): trial.balance and trial.balance.moment,
    }
    return {quantity for quantities, source in given.items() if source is None for quantity in quantities}


def _plot(trial: ReplayTrial, quantity: str, title: str) -> rrb.TimeSeriesView:
    top = None
    if trial.motion is not None and quantity.startswith("grasp_"):  # distances start at zero
        gap = trial.motion.gap_position_m if "position" in quantity else trial.motion.gap_rotation_rad
        top = 1e3 * float(gap.max()) or None
    axis_y = None if top is None else rrb.ScalarAxis(range=(0.0, 1.05 * top))
    return plot_view(f"/{trial.name}/series/{quantity}", title, axis_y)


def _share_range(body: rrb.Container, end_s: float) -> None:
    """Let all linked plots show the time from 0 to ``end_s`` [s]; the first plot stores the range for all."""
    plot = next(view for view in _views(body) if isinstance(view, rrb.TimeSeriesView))
    plot.id = ALL_PLOTS
    boundary = rrb.TimeRangeBoundary.absolute
    plot.properties["TimeAxis"] = rrb.TimeAxis(
        link="LinkToGlobal", view_range=rr.encodings.TimeRange(boundary(seconds=0.0), boundary(seconds=end_s))
    )


def _views(content: rrb.Container | rrb.View) -> list[rrb.View]:
    if isinstance(content, rrb.View):
        return [content]
    return [view for part in content.contents for view in _views(part)]


def _text(trial: ReplayTrial) -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=f"/{trial.name}/summary", name="summary")

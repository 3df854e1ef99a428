"""The layout of a replay: the scene left, series right, a text below."""

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from estimator.arrays import Array
from mocobot_view.replay.log_robots import trail_paths
from mocobot_view.replay.log_time import TIMELINE
from mocobot_view.replay.replay_trial import ReplayTrial

TRAIL_S = 3.0
"""Length of the visible wrist paths."""
PATH_EYE_M = np.array([0.11, -0.11, 0.08])
"""From where a wrist's path is seen."""
BACKGROUND = (100, 108, 120)


def blueprint(trials: Sequence[ReplayTrial], tab: str | None = None) -> rrb.Blueprint:
    """Ready layout; several trials stand side by side, each with its own scene and series.

    Args:
        trials: what is shown.
        tab: name of the tab of series that is open at first; None for the joints.
    """
    if len(trials) == 1:
        trial = trials[0]
        body: rrb.Container = rrb.Horizontal(
            rrb.Vertical(scene_view(trial), _text(trial), row_shares=[3, 1.4]),
            _tabs(_series(trial, True), tab),
            column_shares=[1.25, 1],
        )
    else:
        columns = [
            rrb.Vertical(
                scene_view(trial), _tabs([*_series(trial, False), _text(trial)], tab), row_shares=[1, 1]
            )
            for trial in trials
        ]
        body = rrb.Horizontal(*columns) if len(columns) <= 3 else rrb.Grid(*columns)
    return rrb.Blueprint(
        body,
        rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="playing", loop_mode="all"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def scene_view(trial: ReplayTrial) -> rrb.Spatial3DView:
    """The 3D view of one trial, seen from the front and above, all robots in sight."""
    places = trial.bases.p_Wb[:, :2]
    centre = 0.5 * (places.min(axis=0) + places.max(axis=0))
    reach = 0.5 * float(np.linalg.norm(np.ptp(places, axis=0))) + 0.6
    target = np.array([*centre, 0.5])
    towards = np.array([0.6, -0.6, 0.65])
    window = rrb.VisibleTimeRange(
        TIMELINE,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-TRAIL_S),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    return rrb.Spatial3DView(
        origin=f"/{trial.name}",
        contents=["$origin/**", "- $origin/series/**"],
        name=trial.name,
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(
            visible=True, spacing=0.25, plane=rr.components.Plane3D.XY, color=(220, 225, 235, 70)
        ),
        eye_controls=_eye(target + 1.85 * reach * towards / np.linalg.norm(towards), target),
        overrides={path: rrb.VisibleTimeRanges([window]) for path in trail_paths(trial)},
    )


def _eye(position: Array, target: Array) -> rrb.EyeControls3D:
    return rrb.EyeControls3D(position=position, look_target=target, eye_up=(0.0, 0.0, 1.0))


def _tabs(contents: list[rrb.Container | rrb.View], tab: str | None) -> rrb.Tabs:
    names = [content.name for content in contents]
    return rrb.Tabs(*contents, active_tab=names.index(tab) if tab in names else 0)


def _series(trial: ReplayTrial, legend: bool) -> list[rrb.Container | rrb.View]:
    tabs = {
        "joints": {"phi": "phi [rad]", "theta": "theta [rad]", "tau": "tau [N m]"},
        "wrist": {
            f"wrist/omnid{i + 1}": f"omnid{i + 1}: wrist in {{b}}, measured and commanded [m]"
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
            "balance_force": "force balance in {1} [N]",
            "balance_moment": "moment balance about the CoM [N m]",
        },
    }
    missing = _missing(trial)
    shown = []
    for name, plots in tabs.items():
        views = [_plot(trial, key, title, legend) for key, title in plots.items() if key not in missing]
        if views:
            shown.append(rrb.Vertical(*views, name=name))
    return [*shown[:2], _paths(trial), *shown[2:]]


def _paths(trial: ReplayTrial) -> rrb.Grid:
    """Close views of every wrist's whole path, in its {b}."""
    whole = rrb.VisibleTimeRange(
        TIMELINE, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.infinite()
    )
    home = np.array([0.0, 0.0, trial.recording.metadata.design.home_height_m])
    views = [
        rrb.Spatial3DView(
            origin=f"/{path}",
            name=f"omnid{i}: wrist measured (in colour) and commanded (white)",
            background=BACKGROUND,
            line_grid=False,
            spatial_information=rrb.SpatialInformation(target_frame=f"tf#/{path}", show_axes=True),
            eye_controls=_eye(home + PATH_EYE_M, home),
            time_ranges=[whole],
        )
        for i, path in enumerate(trail_paths(trial), start=1)
    ]
    return rrb.Grid(*views, grid_columns=1 if trial.robots <= 3 else 2, name="paths")


def _missing(trial: ReplayTrial) -> set[str]:
    """Series that this trial does not have."""
    given = {
        ("omega", "velocity", "force", "moment"): trial.data,
        ("grasp_position_mm", "grasp_rotation_mrad"): trial.motion,
        ("balance_force",): trial.balance,
        ("balance_moment",): trial.balance and trial.balance.moment,
    }
    return {quantity for quantities, source in given.items() if source is None for quantity in quantities}


def _plot(trial: ReplayTrial, quantity: str, title: str, legend: bool) -> rrb.TimeSeriesView:
    top = None
    if trial.motion is not None and quantity.startswith("grasp_"):  # distances: from zero up
        gap = trial.motion.gap_position_m if "position" in quantity else trial.motion.gap_rotation_rad
        top = 1e3 * float(gap.max()) or None
    return rrb.TimeSeriesView(
        origin=f"/{trial.name}/series/{quantity}",
        name=title,
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        axis_y=None if top is None else rrb.ScalarAxis(range=(0.0, 1.05 * top)),
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop, visible=legend),
    )


def _text(trial: ReplayTrial) -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=f"/{trial.name}/summary", name="summary")

"""What a user sees of a replay at once: all robots, whole plots from 0, all of the text, paths that fill views."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun.blueprint as rrb

from estimator.arrays import Array
from estimator.recording.model import Recording
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trial_log import TrialLog
from mocobot_view import colours
from mocobot_view.blueprint import ALL_PLOTS, FOVY_DEG, SCENE_ASPECT, blueprint
from mocobot_view.colours import FORCE_M_PER_N
from mocobot_view.replay_trial import ReplayTrial, replay_trial
from mocobot_view.stream import save_replay, summary
from replay_case import Replayed


@pytest.fixture(scope="module")
def recording(random_a: TrialLog) -> Recording:
    return measure(random_a, sensor_preset("nominal"), np.random.default_rng(2), payload="a", name="rec")


@pytest.fixture(scope="module")
def trial(recording: Recording) -> ReplayTrial:
    return replay_trial(recording, "rec")


def views(content: rrb.Container | rrb.View) -> list[rrb.View]:
    if isinstance(content, rrb.View):
        return [content]
    return [view for part in content.contents for view in views(part)]


def seen(view: rrb.View, points: Array, aspect: float) -> Array:
    """Where points lie in a 3D view, -1 to 1 from left to right and from bottom to top: the pinhole's formula."""
    eye = view.properties["EyeControls3D"]
    position, target = (
        np.array(part.as_arrow_array().to_pylist(), dtype=float).ravel()
        for part in (eye.position, eye.look_target)
    )
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    depth = (points - position) @ forward
    assert (depth > 0).all()
    at = np.stack(
        [(points - position) @ right / aspect, (points - position) @ np.cross(right, forward)], axis=-1
    )
    return at / (depth[..., None] * np.tan(np.deg2rad(0.5 * FOVY_DEG)))


@pytest.mark.parametrize("count", [1, 2, 3])
def test_all_robots_and_the_payload_are_in_sight_for_the_whole_trial(trial: ReplayTrial, count: int) -> None:
    """Also in the narrowest view that a window of 800 leaves them, and none of them behind another."""
    trials = [replace(trial, name=f"rec{k}") for k in range(count)]
    aspect = SCENE_ASPECT.get(count, 1.0)
    scenes = [view for view in views(blueprint(trials).root_container) if view.name.startswith("rec")]
    assert len(scenes) == count
    assert trial.motion is not None
    assert trial.shape is not None
    wrists = np.einsum("nij,qnj->qni", trial.bases.R_Wb, trial.bodies.wrist) + trial.bases.p_Wb
    wheels = trial.bases.p_Wb[:, None] + [
        [x, y, -trial.bases.p_Wb[0, 2]] for x in (-0.2, 0.2) for y in (-0.2, 0.2)
    ]
    corners = trial.shape.triangles.vertices
    held = np.einsum("qij,vj->qvi", trial.motion.R_W1[::20], corners) + trial.motion.p_W1[::20, None]
    assert trial.data is not None
    forces = FORCE_M_PER_N * np.einsum("qnij,qnj->qni", trial.data.R_bi, trial.data.wrench[..., 3:])
    tips = np.einsum("nij,qnj->qni", trial.bases.R_Wb, trial.data.p_bi + forces) + trial.bases.p_Wb
    for points in (wrists, wheels, held, tips):
        assert np.abs(seen(scenes[0], points, aspect)).max() < 1.0
    feet = seen(scenes[0], trial.bases.p_Wb, aspect)
    apart = [np.linalg.norm(feet[i] - feet[j]) for i, j in ((0, 1), (0, 2), (1, 2))]
    assert min(apart) > 0.3


def test_paths_fill_their_views(trial: ReplayTrial) -> None:
    """Measured and commanded path whole, and as near as that allows."""
    paths = [view for view in views(blueprint([trial]).root_container) if "white: command" in view.name]
    assert len(paths) == 3
    assert trial.recording.ref is not None
    for i, view in enumerate(paths):
        at = seen(view, np.concatenate([trial.bodies.wrist[:, i], trial.recording.ref[:, i]]), aspect=0.75)
        assert np.abs(at).max() < 1.0
        assert np.ptp(at, axis=0).max() > 1.7


def test_plots_open_with_all_of_the_trial_and_nothing_on_top(trial: ReplayTrial) -> None:
    """One range for all plots, from 0 to the end of the longest trial; no legend; a key over them instead."""
    longer = replace(trial, name="longer", time=np.linspace(0.0, 95.0, len(trial.time)))
    shown = views(blueprint([trial, longer]).root_container)
    plots = [view for view in shown if isinstance(view, rrb.TimeSeriesView)]
    assert len(plots) == 28
    assert len({view.id for view in shown}) == len(shown)
    for plot in plots:
        assert plot.properties["PlotLegend"].visible.as_arrow_array().to_pylist() == [False]
        assert plot.properties["TimeAxis"].link.as_arrow_array().to_pylist() == [2], "linked"
    (holder,) = [plot for plot in plots if plot.id == ALL_PLOTS]
    (span,) = holder.properties["TimeAxis"].view_range.as_arrow_array().to_pylist()
    assert [span[end] for end in ("start", "end")] == [0, 95_000_000_000]


def test_key_names_every_line_in_its_colour(trial: ReplayTrial, tmp_path: Path) -> None:
    save_replay([trial], tmp_path / "out.rrd")
    file = Replayed(tmp_path / "out.rrd")
    for key, parts in (("joints", ["1", "2", "3"]), ("axes", ["x", "y", "z"]), ("robots", [""])):
        labels = file.texts(f"rec/series/key/{key}", "Points2D:labels")
        assert labels == [label for i in (1, 2, 3) for label in (f"omnid{i}", *parts)]
    packed = file.texts("rec/series/key/joints", "Points2D:colors")
    dots = [colour >> 8 for k, colour in enumerate(packed) if k % 4]  # 0xRRGGBBAA
    lines = [colour >> 8 for colour in file.texts("rec/series/phi", "SeriesLines:colors")]
    shades = [shade for i in (1, 2, 3) for shade in colours.shades(i)]
    assert dots == lines == [(red << 16) + (green << 8) + blue for red, green, blue in shades]


def test_no_line_of_the_summarys_table_is_wider_than_its_panel(trial: ReplayTrial) -> None:
    """350 points in a window of 800, at some 7 points a letter."""
    rows = [line for line in summary(trial).splitlines() if line.startswith("|")]
    assert len(rows) == 2 + 1 + 3 + 3 + 2 * 6
    columns = zip(
        *([cell.strip() for cell in row.strip("|").split("|")] for row in rows[:1] + rows[2:]), strict=True
    )
    assert 7 * sum(max(map(len, column)) for column in columns) < 350

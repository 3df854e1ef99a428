"""What a replay shows where estimate, payload or diagnosis are missing or do not fit."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from diagnosed import small_diagnosis
from discrepancy.result.read import NamedCause, WrittenDiagnosis, read_diagnosis
from estimator.errors import InputError
from estimator.estimate.payload import estimate_payload
from estimator.recording.model import Recording
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trial_log import TrialLog
from mocobot_view.blueprint import blueprint
from mocobot_view.payload import BAR_M, Grasps, cad_shape, held_elsewhere
from mocobot_view.replay_trial import distinct_names, replay_trial
from mocobot_view.robot import body_of
from mocobot_view.stream import save_replay, summary
from payload_mjcf import FIVE
from recordings import metadata
from replay_case import Replayed, true_estimate


@pytest.fixture(scope="module")
def recording(random_a: TrialLog) -> Recording:
    return measure(random_a, sensor_preset("nominal"), np.random.default_rng(2), payload="a", name="rec")


def labelled(recording: Recording, payload: str | None) -> Recording:
    return replace(recording, metadata=replace(recording.metadata, payload=payload))


def part(recording: Recording, rows: slice, robots: int = 3) -> Recording:
    keep = rows, slice(0, robots)
    return replace(
        recording,
        time=recording.time[rows],
        phi=recording.phi[keep],
        theta=recording.theta[keep],
        tau=recording.tau[keep],
        ref=None,
        metadata=replace(recording.metadata, robots=robots, payload=None),
    )


def standing(recording: Recording, robots: int = 3) -> Recording:
    """The first second, in which nothing moves."""
    return part(recording, slice(0, 100), robots)


def test_without_grasps_robots_stand_in_a_row(recording: Recording, tmp_path: Path) -> None:
    trial = replay_trial(standing(recording), "still")
    assert trial.motion is None
    assert trial.shape is None
    assert trial.bases.p_Wb[:, 0] == pytest.approx([0.0, 1.2, 2.4])
    notes = " ".join(trial.notes)
    assert "Nothing could be estimated from this recording" in notes
    assert "drawn in a row, without a payload" in notes
    assert "--estimate" in notes
    assert "No twists and no wrenches" in notes
    save_replay([trial], tmp_path / "out.rrd")
    entities = Replayed(tmp_path / "out.rrd").entities()
    assert "still/omnid3/base/platform" in entities
    assert not any("payload" in name or "grasp" in name for name in entities)


def test_an_estimate_of_other_recordings_places_them(recording: Recording) -> None:
    whole = replay_trial(recording, "whole")
    trial = replay_trial(standing(recording), "still", whole.estimate)
    assert trial.bases.p_Wb == pytest.approx(whole.bases.p_Wb, abs=1e-3)
    assert trial.motion is not None
    assert not any("row" in note for note in trial.notes)


def test_one_robot_needs_no_estimate(recording: Recording) -> None:
    """Its grasp is the payload's frame, whatever is known of the payload."""
    trial = replay_trial(standing(recording, robots=1), "one")
    assert trial.motion is not None
    assert trial.motion.p_W1 == pytest.approx(trial.bases.p_Wb[0] + trial.bodies.wrist[:, 0])
    assert trial.shape is None


def test_unknown_payloads_are_bars_to_the_grasps(recording: Recording) -> None:
    trial = replay_trial(labelled(recording, None), "rec")
    assert trial.facts is not None
    assert trial.facts.grasps is not None
    assert trial.shape is not None
    points = trial.shape.triangles.vertices
    for end in (*trial.facts.grasps.p_1i, trial.facts.p_1c):
        assert np.linalg.norm(points - end, axis=1).min() == pytest.approx(BAR_M, rel=1e-3)
    assert points.min(axis=0) == pytest.approx(trial.facts.grasps.p_1i.min(axis=0), abs=2 * BAR_M)
    assert not trial.notes


def test_a_label_whose_cad_does_not_fit_is_not_believed(recording: Recording) -> None:
    trial = replay_trial(labelled(recording, "d"), "rec")
    (note,) = trial.notes
    assert note.startswith("The geometry of payload 'd' is not drawn: grasp ")
    asked = replay_trial(recording, "rec", payload="d")
    (note,) = asked.notes
    assert note.startswith("The geometry of payload 'd' is drawn as asked, but grasp ")
    assert asked.shape is not None
    assert trial.shape is not None
    assert len(asked.shape.rgba) != len(trial.shape.rgba)


@pytest.mark.parametrize(("turn_deg", "shift_m", "fits"), [
    (10.0, 0.0, True), (20.0, 0.0, False), (0.0, 0.08, True), (0.0, 0.12, False),
])  # fmt: skip
def test_cad_fits_grasps_nearby(turn_deg: float, shift_m: float, fits: bool) -> None:
    _, cad = cad_shape("a", 3)
    R, p = cad.R_1i.copy(), cad.p_1i.copy()
    R[2] = R[2] @ Rotation.from_rotvec([0.0, turn_deg, 0.0], degrees=True).as_matrix()
    p[1] += [0.0, 0.0, shift_m]
    said = held_elsewhere(cad, Grasps(R, p))
    if fits:
        assert said is None
    else:
        assert said is not None
        assert said.startswith("grasp 3 is 0.00 m and 20" if turn_deg else "grasp 2 is 0.12 m")


def test_payload_for_other_robots(recording: Recording, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="has 5 grasps; the recording is of 3 robots"):
        replay_trial(recording, "rec", payload=FIVE.write(tmp_path))
    trial = replay_trial(labelled(part(recording, slice(None), robots=2), "a"), "rec")
    assert any("payload 'a' is not drawn" in note for note in trial.notes)


def test_estimates_that_do_not_belong(recording: Recording, teams) -> None:
    with pytest.raises(InputError, match="the estimate is of 5 robots; rec is of 3 robots"):
        replay_trial(recording, "rec", true_estimate(teams[5]))
    estimate = estimate_payload([recording])
    assert estimate.grasps is not None
    moved = estimate.grasps.moved(np.array([0.3, 0.0, 0.0, *np.zeros(9)]))
    trial = replay_trial(recording, "rec", replace(estimate, grasps=moved, payload="q"))
    assert "The estimate is of payload 'q'; this recording is of 'a'." in trial.notes
    assert any("grasps do not fit this recording" in note for note in trial.notes)
    assert not replay_trial(recording, "rec", estimate).notes


def test_axes_that_are_not_determined_are_not_drawn(recording: Recording, tmp_path: Path) -> None:
    estimate = estimate_payload([recording])
    assert estimate.inertia is not None
    blurred = replace(estimate.inertia.principal, R_1c=None, R_1c_covariance=None)
    trial = replay_trial(
        recording, "rec", replace(estimate, inertia=replace(estimate.inertia, principal=blurred))
    )
    save_replay([trial], tmp_path / "out.rrd")
    entities = Replayed(tmp_path / "out.rrd").entities()
    assert "rec/payload/estimate/inertia" in entities
    assert "rec/payload/estimate/axes" not in entities


def cause(name: str, robot: int | None, joint: int | None) -> NamedCause:
    return NamedCause(name, robot, joint, f"{name} [is] *here*.")


@pytest.mark.parametrize(
    ("name", "robot", "joint", "body"),
    [
        ("joint_friction", 1, 3, "proximal3"),
        ("theta_zero", 1, 1, "yoke"),
        ("gimbal_friction", 2, 2, "ring"),
        ("theta_zero", 1, 3, "flange"),
        ("tether", 3, None, "flange"),
        ("clock_delay", 3, None, None),
        ("drag", None, None, None),
    ],
)
def test_causes_sit_at_bodies(
    tmp_path: Path, name: str, robot: int | None, joint: int | None, body: str | None
) -> None:
    """The gimbal's joints 1, 2, 3 are z, y, x; those of the other causes are the legs."""
    values = small_diagnosis()
    values["causes"][0] |= {"cause": name, "robot": robot, "joint": joint}
    (tmp_path / "diagnosis.json").write_text(json.dumps(values), encoding="utf-8")
    (found,) = read_diagnosis(tmp_path).causes
    assert (found.name, found.robot, body_of(found)) == (name, robot, body)


def test_causes_are_marked_where_they_sit(recording: Recording, tmp_path: Path) -> None:
    causes = (
        cause("sea_bias", 2, 3), cause("joint_friction", 2, 3), cause("base_tilt", 1, None),
        cause("theta_zero", 3, 2), cause("slosh", None, None),
    )  # fmt: skip
    trial = replay_trial(recording, "rec", diagnosis=WrittenDiagnosis("explained", causes, ("rec",)))
    assert not trial.notes
    save_replay([trial], tmp_path / "out.rrd")
    file = Replayed(tmp_path / "out.rrd")
    for place, label in (
        ("omnid2/base/leg3/proximal", "! sea_bias, ! joint_friction"),
        ("omnid1/base", "! base_tilt"),
        ("omnid3/base/platform/yoke/ring", "! theta_zero"),
        ("payload", "! slosh"),
    ):
        assert file.texts(f"rec/{place}/cause/name", "Points3D:labels") == [label]
    assert sum(name.endswith("/cause") for name in file.entities()) == 4
    assert trial.facts is not None
    _, place = file.column("rec/payload/cause", "Points3D:positions")
    assert place[0] == pytest.approx(trial.facts.p_1c, abs=1e-6)
    assert "- **sea\\_bias**: sea\\_bias \\[is\\] \\*here\\*." in summary(trial)


def test_names_in_the_summary_are_no_markup(recording: Recording) -> None:
    trial = replay_trial(labelled(recording, "a*b|c\n# d"), "rec")
    assert "payload a\\*b\\|c \\# d" in summary(trial)


def test_side_by_side_layouts(recording: Recording) -> None:
    trial = replay_trial(recording, "rec")
    for count in (1, 2, 5):
        trials = [replace(trial, name=name) for name in distinct_names([Path("x.parquet")] * count)]
        assert blueprint(trials).root_container is not None


def test_names_are_distinct_and_safe_in_entity_paths() -> None:
    files = [Path("a/x.p"), Path("x.q"), Path("x-2.p"), Path("b/x.p")]
    assert distinct_names(files) == ["x", "x-2", "x-2-2", "x-3"]
    odd = [Path("trial 1 (ü).parquet"), Path("trial_1_(é).parquet"), Path("__init__.py"), Path("a#b.parquet")]
    assert distinct_names(odd) == ["trial_1____", "trial_1____-2", "_init__", "a_b"]


def test_metadata_helper_is_of_the_shipped_design(recording: Recording) -> None:
    """The tests' other recordings and these are of the same robots."""
    assert metadata().design == recording.metadata.design

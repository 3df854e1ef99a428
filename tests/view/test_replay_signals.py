"""What a replay's file holds, queried back through Rerun's dataframes, against the recording and the estimator."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.estimate.consistency import wrench_balance
from estimator.estimate.payload import estimate_payload
from estimator.recording.model import Recording
from estimator.signals import process_recording
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trial_log import TrialLog
from mocobot_sim.trial.truth import GroundTruth
from mocobot_view.payload import BodyFacts, Grasps, facts_of
from mocobot_view.replay_trial import ReplayTrial, balance, replay_trial
from mocobot_view.stream import save_replay
from replay_case import Replayed


@pytest.fixture(scope="module")
def recording(random_a: TrialLog) -> Recording:
    """Payload (a), nominal sensors, with a time origin of its own."""
    made = measure(random_a, sensor_preset("nominal"), np.random.default_rng(2), payload="a", name="rec")
    return Recording(made.time + 12.5, made.phi, made.theta, made.tau, made.ref, made.metadata, "rec")


@pytest.fixture(scope="module")
def truth(team_a) -> BodyFacts:
    true = GroundTruth.of(team_a)
    return BodyFacts(Grasps(true.R_1i, true.p_1i), true.mass_kg, true.p_1c, true.R_1c, true.principal_kgm2)


@pytest.fixture(scope="module")
def trial(recording: Recording, truth: BodyFacts) -> ReplayTrial:
    return replay_trial(recording, "trial", truth=truth)


@pytest.fixture(scope="module")
def path(trial: ReplayTrial, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("replay") / "out.rrd"
    save_replay([trial], path)
    return path


@pytest.fixture(scope="module")
def file(path: Path) -> Replayed:
    return Replayed(path)


@pytest.mark.parametrize("quantity", ["phi", "theta", "tau"])
def test_measured_series_are_the_recordings_samples(
    file: Replayed, recording: Recording, quantity: str
) -> None:
    time, values = file.column(f"trial/series/{quantity}", "Scalars:scalars")
    assert time == pytest.approx(recording.time - 12.5, abs=1e-9)
    np.testing.assert_array_equal(values, getattr(recording, quantity).reshape(len(recording.time), 9))


@pytest.mark.parametrize(("quantity", "field", "part"), [
    ("omega", "twist", slice(0, 3)), ("velocity", "twist", slice(3, 6)),
    ("moment", "wrench", slice(0, 3)), ("force", "wrench", slice(3, 6)),
])  # fmt: skip
def test_twists_and_wrenches_are_the_estimators(
    file: Replayed, recording: Recording, quantity: str, field: str, part: slice
) -> None:
    data = process_recording(recording)
    time, values = file.column(f"trial/series/{quantity}", "Scalars:scalars")
    assert time == pytest.approx(data.time[::2] - 12.5, abs=1e-9)
    np.testing.assert_array_equal(values, getattr(data, field)[::2, :, part].reshape(len(time), 9))


def test_forces_are_arrows_in_the_flange_and_end_with_the_data(file: Replayed, recording: Recording) -> None:
    data = process_recording(recording)
    for i in range(3):
        entity = f"trial/omnid{i + 1}/base/platform/yoke/ring/flange/force"
        table = file.store.reader(index="time", contents=f"/{entity}").to_arrow_table()
        rows = [row for row in table[f"/{entity}:Arrows3D:vectors"].to_pylist() if row is not None]
        assert rows[-1] == []
        newtons = np.array(rows[:-1])[:, 0] / 0.006
        assert newtons == pytest.approx(data.wrench[::2, i, 3:], rel=1e-5, abs=1e-4)


def test_balance_is_the_estimators(trial: ReplayTrial, recording: Recording) -> None:
    """The estimator reduces the same residual to two numbers."""
    estimate, data = trial.estimate, process_recording(recording)
    assert estimate is not None
    assert estimate.grasps is not None
    assert estimate.mass is not None
    assert estimate.p_1c is not None
    left = balance(data, estimate)
    assert left is not None
    assert left.moment is not None
    force, moment = wrench_balance(data, estimate.grasps, estimate.mass.mass, estimate.p_1c, estimate.inertia)
    weight = estimate.mass.mass * 9.81
    assert np.sqrt(np.mean(np.sum(left.force**2, axis=1))) == pytest.approx(force * weight)
    assert moment is not None
    assert np.sqrt(np.mean(np.sum(left.moment**2, axis=1))) == pytest.approx(moment * weight)


def test_residual_series(file: Replayed, trial: ReplayTrial) -> None:
    assert trial.motion is not None
    assert trial.balance is not None
    _, gaps = file.column("trial/series/grasp_position_mm", "Scalars:scalars")
    np.testing.assert_allclose(gaps, 1e3 * trial.motion.gap_position_m)
    _, turns = file.column("trial/series/grasp_rotation_mrad", "Scalars:scalars")
    np.testing.assert_allclose(turns, 1e3 * trial.motion.gap_rotation_rad)
    _, force = file.column("trial/series/balance_force", "Scalars:scalars")
    np.testing.assert_array_equal(force, trial.balance.force)
    _, moment = file.column("trial/series/balance_moment", "Scalars:scalars")
    np.testing.assert_array_equal(moment, trial.balance.moment)


@pytest.mark.parametrize("said", ["estimate", "truth"])
def test_payload_overlay(file: Replayed, recording: Recording, truth: BodyFacts, said: str) -> None:
    facts = truth if said == "truth" else facts_of(estimate_payload([recording]))
    root = f"trial/payload/{said}"
    assert facts.grasps is not None
    for i in range(3):
        _, origins = file.column(f"{root}/grasp{i + 1}", "Arrows3D:origins")
        _, vectors = file.column(f"{root}/grasp{i + 1}", "Arrows3D:vectors")
        assert origins.reshape(3, 3) == pytest.approx(np.tile(facts.grasps.p_1i[i], (3, 1)), abs=1e-6)
        axes = vectors.reshape(3, 3) / np.linalg.norm(vectors.reshape(3, 3), axis=1, keepdims=True)
        np.testing.assert_allclose(axes.T, facts.grasps.R_1i[i], atol=1e-6)
    _, com = file.column(f"{root}/com", "Points3D:positions")
    assert com[0] == pytest.approx(facts.p_1c, abs=1e-6)
    _, half = file.column(f"{root}/inertia", "Ellipsoids3D:half_sizes")
    _, turn = file.column(f"{root}/inertia", "Ellipsoids3D:quaternions")
    _, centre = file.column(f"{root}/inertia", "Ellipsoids3D:centers")
    assert centre[0] == pytest.approx(facts.p_1c, abs=1e-6)
    # A uniform solid ellipsoid as drawn has the inertia: m/5 (a^2 + b^2 + c^2 - a_k^2) about its axes.
    R, squares = Rotation.from_quat(turn[0]).as_matrix(), half[0] ** 2
    assert facts.mass_kg is not None
    assert facts.R_1c is not None
    assert facts.principal_kgm2 is not None
    drawn = facts.mass_kg / 5.0 * R @ np.diag(squares.sum() - squares) @ R.T
    assert drawn == pytest.approx(facts.R_1c @ np.diag(facts.principal_kgm2) @ facts.R_1c.T, abs=1e-5)
    _, axes = file.column(f"{root}/axes", "Arrows3D:vectors")
    assert np.linalg.norm(axes.reshape(3, 3), axis=1) == pytest.approx(half[0], rel=1e-5)


def test_summary_has_the_numbers(file: Replayed, trial: ReplayTrial) -> None:
    (text,) = file.texts("trial/summary", "TextDocument:text")
    assert trial.estimate is not None
    assert trial.estimate.mass is not None
    assert f"| mass [kg] | {trial.estimate.mass.mass:.4f} ± {trial.estimate.mass.se:.4f} | 11.6720 |" in text
    assert re.search(r"\| CoM x in \{1\} \[mm\] \| 53\d\.\d\d ± \d\.\d\d \| 537\.00 \|", text)
    assert re.search(r"\| CoM y in \{1\} \[mm\] \| 15\d\.\d\d ± \d\.\d\d \| 156\.00 \|", text)
    assert re.search(r"\| moment 1 \[kg m²\] \| 2\.3\d+ ± 0\.\d+ \| 2\.3180 \|", text)
    assert re.search(r"\| moment 3 \[kg m²\] \| 5\.5\d+ ± 0\.\d+ \| 5\.5240 \|", text)
    assert "random trial, 3 robots, payload a" in text
    assert "Time 0 is 12.5 s in the recording" in text
    assert re.search(r"\| grasp 3 x in \{1\} \[mm\] \| 110\d\.\d\d \| 1105\.00 \|", text)
    assert re.search(r"\| grasp 3 y in \{1\} \[mm\] \| -30\d\.\d\d \| -305\.00 \|", text)
    assert re.search(r"\| grasp 3 about z \[deg\] \| -(90\.0|89\.9)\d\d \| -90\.000 \|", text)
    assert "wrench balance" in text

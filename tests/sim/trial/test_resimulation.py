"""Running a recording's commands again."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from effect_cases import example, team_with
from estimator.errors import InputError
from estimator.recording.parquet import read_recording, write_recording
from mocobot_sim.scene.models import base_height_m
from mocobot_sim.scene.payload import payload_mjcf
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.resimulate import predicted, resimulate
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.truth import GroundTruth

INSIDE = slice(200, -200)


def _rms(one, two) -> dict[str, float]:
    return {
        name: float(np.sqrt(np.mean((getattr(one, name)[INSIDE] - getattr(two, name)[INSIDE]) ** 2)))
        for name in ("phi", "theta", "tau")
    }


@pytest.fixture(scope="module")
def recording(random_a):
    return measure(random_a, sensor_preset("ideal"), np.random.default_rng(0), payload="a")


def test_the_same_team_does_the_same_again(recording, tmp_path):
    """Through a file, too. Only the first second knows that the load was taken up."""
    path = tmp_path / "rec.parquet"
    write_recording(recording, path)
    again = predicted(resimulate(read_recording(path), build_team("a")))
    difference = _rms(again, recording)
    assert difference["phi"] < 1e-7
    assert difference["theta"] < 1e-7
    assert difference["tau"] < 1e-6
    assert np.abs(again.phi[0] - recording.phi[0]).max() < 1e-6


def test_a_finer_step_stays_close(recording):
    difference = _rms(predicted(resimulate(recording, build_team("a"), timestep_s=0.0005)), recording)
    assert difference["phi"] < 0.03e-3
    assert difference["tau"] < 0.8e-3


def test_nominal_sensors_are_good_enough_to_start_from(random_a, recording):
    noisy = measure(random_a, sensor_preset("nominal"), np.random.default_rng(0))
    difference = _rms(predicted(resimulate(noisy, build_team("a"))), recording)
    assert difference["phi"] < 1e-6
    assert difference["tau"] < 1e-4


def test_the_guilty_effect_explains_a_recording_and_others_do_not(recording):
    hidden = predicted(resimulate(recording, team_with("a", example("sea_scale", 2))))
    assert _rms(hidden, recording)["tau"] > 1e-2
    right = predicted(resimulate(hidden, team_with("a", example("sea_scale", 2))))
    wrong = predicted(resimulate(hidden, team_with("a", example("sea_scale", 3))))
    hidden_scale = _rms(right, hidden)
    assert hidden_scale["tau"] < 2e-5
    assert _rms(wrong, hidden)["tau"] > 1e-2


def _from_numbers(truth: GroundTruth, team) -> tuple:
    """The same payload from its numbers, and the bases from poses in another world."""
    inertia = truth.R_1c @ np.diag(truth.principal_kgm2) @ truth.R_1c.T
    X_1i = RigidTransform.from_components(truth.p_1i, Rotation.from_matrix(truth.R_1i))
    turn = RigidTransform.from_components([1.0, -2.0, 0.0], Rotation.from_euler("z", 0.7))
    return payload_mjcf(truth.mass_kg, truth.p_1c, inertia, X_1i), turn * team.mounts


def test_a_team_from_numbers_alone_is_the_team(recording, team_a):
    payload, mounts = _from_numbers(GroundTruth.of(team_a), team_a)
    scene = build_team(payload, mounts=mounts)
    truth, other = GroundTruth.of(team_a), GroundTruth.of(scene)
    for entry in ("R_1i", "p_1i", "p_1c", "principal_kgm2"):
        np.testing.assert_allclose(getattr(other, entry), getattr(truth, entry), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(scene.wrist_home_b, team_a.wrist_home_b, rtol=0, atol=1e-12)
    np.testing.assert_allclose(scene.theta_home, team_a.theta_home, rtol=0, atol=1e-12)
    np.testing.assert_allclose(scene.X_Wb.translation[:, 2], base_height_m(), rtol=0, atol=1e-15)
    difference = _rms(predicted(resimulate(recording, scene)), recording)
    assert difference["phi"] < 1e-6
    assert difference["tau"] < 1e-5


def test_mounts_that_are_off_are_assembled_from_the_first_sample(recording, team_a):
    """Estimated base poses, half a millimetre and a milliradian off in every coordinate."""
    payload, mounts = _from_numbers(GroundTruth.of(team_a), team_a)
    rng = np.random.default_rng(0)
    error = RigidTransform.from_components(
        rng.normal(0, 5e-4, (3, 3)), Rotation.from_rotvec(rng.normal(0, 1e-3, (3, 3)))
    )
    again = predicted(resimulate(recording, build_team(payload, mounts=mounts * error)))
    assert 1e-5 < np.abs(again.phi[0] - recording.phi[0]).max() < 0.02
    assert _rms(again, recording)["phi"] < 0.02


def test_what_cannot_be_resimulated_is_refused(recording, teams):
    scene = build_team("a")
    meta = recording.metadata

    def but(**changes):
        return dataclasses.replace(recording, metadata=dataclasses.replace(meta, **changes), name="rec")

    cases = [
        (dataclasses.replace(recording, ref=None, name="rec"), scene, "rec: has no commands"),
        (but(control=None), scene, "rec: metadata has no 'control'"),
        (but(control={}), scene, r"rec: control.feed_forward_N is null; it must be 3 x 3 finite numbers"),
        (but(control=meta.control | {"feed_forward_N": [[1, 2]]}), scene, r"feed_forward_N is \[\[1, 2\]\]"),
        (but(control=meta.control | {"torque_gain": -1}), scene, "rec: control.torque_gain is -1"),
        (but(rate_hz=200.0), scene, "rec: rate_hz is 200; resimulating it needs 100"),
        (recording, build_team("a", timestep_s=0.001) and teams[2], "is of 3 robots; the scene has 2"),
    ]
    for bad, team, sentence in cases:
        with pytest.raises(InputError, match=sentence):
            resimulate(bad, team)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"mass_kg": 0.0}, "payload mass is 0 kg"),
        ({"p_1c": [np.nan, 0, 0]}, "payload centre of mass"),
        ({"inertia_1": np.diag([1.0, 1.0, 2.5])}, r"principal moments \(1, 1, 2.5\)"),
        ({"inertia_1": np.diag([-1.0, 1.0, 1.0])}, "greater than 0"),
        ({"inertia_1": np.diag([1.0, 1.0, 1.0]) + np.eye(3, k=1)}, "not symmetric"),
    ],
)
def test_payloads_that_no_body_has_are_refused(changes, sentence):
    numbers = {"mass_kg": 1.0, "p_1c": np.zeros(3), "inertia_1": np.eye(3)} | changes
    with pytest.raises(InputError, match=sentence):
        payload_mjcf(**numbers, X_1i=RigidTransform.identity(2))


def test_mounts_and_postures_of_another_team_are_refused():
    with pytest.raises(InputError, match="mounts are not 3 transforms"):
        build_team("a", mounts=RigidTransform.identity(2))
    with pytest.raises(InputError, match="initial theta is not 3 x 3 finite angles"):
        build_team("a", initial=(np.zeros((3, 3)), np.zeros((2, 3))))

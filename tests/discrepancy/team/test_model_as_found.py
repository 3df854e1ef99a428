"""The team that a user takes away answers the recorded commands as the recorded one did, healthy parts included."""

import json

import numpy as np
import pytest

import mocobot
from discrepancy.team import told
from estimator.errors import InputError
from mocobot_sim.effects import apply_effects, make_effect
from mocobot_sim.extended.extended import extra_of, load_extended
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.resimulate import predicted, resimulate
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trajectories import random_vias, sphere_motion
from mocobot_sim.trial.trial import run_trial

BIAS_NM = 0.2
TIMESTEP_S = 1e-3


@pytest.fixture(scope="module")
def hidden():
    """Each driven joint rubs by no more than its tolerance; one sensor has a zero far beyond its own."""
    rng = np.random.default_rng(41)
    rubbing = [
        make_effect("joint_friction", {"coulomb_Nm": abs(rng.normal(0.0, 0.003))}, robot=r, joint=j)
        for r in (1, 2, 3)
        for j in (1, 2, 3)
    ]
    return [*rubbing, make_effect("sea_bias", {"bias_Nm": BIAS_NM}, robot=2, joint=1)]


@pytest.fixture(scope="module")
def recordings(hidden):
    """Two trials of payload (b), with noise."""
    rng, nominal = np.random.default_rng(42), sensor_preset("nominal")
    home = build_team("b")
    motions = [
        random_vias(home.wrist_home_b, rng, vias=6),
        sphere_motion(home.wrist_home_b, home.X_1i, duration_s=10.0, rng=rng),
    ]
    logs = [
        run_trial(apply_effects(build_team("b", timestep_s=TIMESTEP_S), hidden), motion) for motion in motions
    ]
    return [measure(log, nominal, rng, name=f"trial {k}") for k, log in enumerate(logs, start=1)]


def _off(recordings, folder):
    """Root mean square of recorded minus simulated driven angles, of what remains when noise is taken out [rad]."""
    scene, out = load_extended(folder), []
    for recording in recordings:
        again = predicted(resimulate(recording, scene, timestep_s=TIMESTEP_S))
        error = (recording.phi - again.phi)[400:]
        smooth = error[: len(error) // 50 * 50].reshape(-1, 50, *error.shape[1:]).mean(axis=1)
        out.append(np.sqrt(np.mean(smooth**2)))
    return np.array(out)


@pytest.mark.slow
def test_the_team_as_found_answers_as_the_recorded_one_did(recordings, tmp_path, monkeypatch):
    diagnosed = mocobot.diagnose(recordings)
    (cause,) = diagnosed.to_dict()["causes"]
    assert cause["cause"] == "sea_bias"
    response = diagnosed.to_dict()["gain"]["held_out"]
    assert response["as_found"]["chi2_per_n"] < 0.5 * response["after"]["chi2_per_n"]
    diagnosed.write(tmp_path / "verdict")
    named, found = (tmp_path / "verdict" / name for name in ("extended", "as_found"))
    # The zero is in both, as large; what rubs in one only, and its page tells the two kinds apart.
    for folder in (named, found):
        assert load_extended(folder).units[1].tau_zero_Nm[0] == pytest.approx(BIAS_NM, rel=0.05)
    assert [effect.cause for effect in load_extended(named).effects] == ["sea_bias"]
    effects = load_extended(found).effects
    assert effects[0].cause == "sea_bias"
    assert len([effect for effect in effects if effect.cause == "joint_friction"]) >= 5
    page = (found / "README.md").read_text(encoding="utf-8")
    assert page.index("`sea_bias`") < page.index("Every other part") < page.index("`joint_friction`")
    assert extra_of(found)["causes"] == extra_of(named)["causes"] == [cause["name"]]
    off_named, off_found = _off(recordings, named), _off(recordings, found)
    assert np.all(off_found < 0.4 * off_named), (off_found, off_named)

    def none(*args, whole, write=told.write_model):
        if whole:
            raise InputError("no effect has such values")
        write(*args, whole=whole)

    monkeypatch.setattr(told, "write_model", none)
    diagnosed.write(tmp_path / "other")
    assert not (tmp_path / "other" / "as_found").exists()
    assert load_extended(tmp_path / "other" / "extended").robots == 3
    notes = json.loads((tmp_path / "other" / "diagnosis.json").read_text(encoding="utf-8"))["notes"]
    assert "There is no model as found: no effect has such values." in notes

"""A new effect is two files and one line each: hidden, it is named, simulated, written and marked in the replay."""

import json

import numpy as np
import pytest
from discrepancy.engine.diagnose import diagnose

from discrepancy.result.json import diagnosis_to_dict
from discrepancy.result.read import read_diagnosis
from discrepancy.result.text import format_diagnosis
from discrepancy.team.causes import CAUSES
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import read_tolerances
from discrepancy.team.words import TeamWords
from estimator.estimate.payload import estimate_payload
from joint_spring_cause import JointSpring as Trace
from joint_spring_effect import JointSpring
from mocobot_sim.effects import EFFECTS, apply_effects, make_effect
from mocobot_sim.extended.extended import load_extended
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trajectories import random_vias, sphere_motion
from mocobot_sim.trial.trial import run_trial
from mocobot_view.facts.cause_body import body_of

STIFFNESS = 0.3


@pytest.fixture
def registered(monkeypatch):
    """One line each."""
    monkeypatch.setitem(EFFECTS, "joint_spring", JointSpring)
    monkeypatch.setitem(CAUSES, "joint_spring", Trace())


def recorded(effects):
    """Two short trials of payload (a), with noise."""
    rng, nominal = np.random.default_rng(11), sensor_preset("nominal")
    home = build_team("a")
    motions = [
        random_vias(home.wrist_home_b, rng, vias=6),
        sphere_motion(home.wrist_home_b, home.X_1i, duration_s=10.0, rng=rng),
    ]
    for number, motion in enumerate(motions, start=1):
        team = apply_effects(build_team("a", timestep_s=1e-3), effects)
        yield measure(run_trial(team, motion, trial_number=number), nominal, rng, name=f"trial {number}")


@pytest.mark.slow
def test_two_files_are_all_that_an_effect_needs(registered, tmp_path):
    hidden = make_effect("joint_spring", {"stiffness_Nm_per_rad": STIFFNESS}, robot=3, joint=2)
    recordings = list(recorded([hidden]))
    rig = TeamRig.of(recordings, estimate_payload(recordings), read_tolerances(None))
    diagnosis = diagnose(rig)
    values = diagnosis_to_dict(diagnosis, rig, TeamWords())

    # Named: the right cause at the right place, its size and sentence.
    (cause,) = values["causes"]
    assert (cause["cause"], cause["robot"], cause["joint"]) == ("joint_spring", 3, 2)
    stiffness = cause["parameters"]["stiffness_Nm_per_rad"]
    assert stiffness["value"] == pytest.approx(STIFFNESS, abs=max(4.0 * stiffness["se"], 0.03 * STIFFNESS))
    sentence = "Robot 3, joint 2: a hose pulls the driven joint back with 0.3"
    assert cause["sentence"].startswith(sentence)
    assert " ".join(format_diagnosis(values).split()).startswith(f"EXPLAINED. {sentence}")

    # Simulated: with it the response to the commands is nearly that of the recordings.
    before, after = (values["gain"]["held_out"][name]["chi2_per_n"] for name in ("before", "after"))
    assert after < 0.2 * before

    # Written, and read again: whoever takes the model away has the hose in it.
    rig.write_extended(diagnosis.explanation, tmp_path / "extended")
    (effect,) = load_extended(tmp_path / "extended").effects
    assert [effect] == rig.effects(diagnosis.causes[0].candidate, diagnosis.causes[0].values)
    model = load_extended(tmp_path / "extended").compile()
    hose = model.tendon("hose3_2").id
    assert np.ravel(model.tendon_stiffness[hose])[0] == pytest.approx(effect.stiffness_Nm_per_rad)

    # Replayed: marked at the link that it pulls.
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps(values), encoding="utf-8")
    (mark,) = read_diagnosis(path).causes
    assert (mark.name, mark.robot, body_of(mark)) == ("joint_spring", 3, "proximal2")
    assert mark.sentence == cause["sentence"]

"""A cable that is slack at times, hidden in simulated trials: found, told in numbers, and simulated."""

import numpy as np
import pytest

from discrepancy.team.diagnosis import diagnose_team
from hidden.schedule import Schedule
from hidden_quick import TIMESTEP_S
from mocobot_sim.effects import apply_effects, make_effect
from mocobot_sim.extended.extended import load_extended
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trial import run_trial

AWAY_M, STRETCH_M = np.array([-0.4, 0.5, 0.2]), 0.02
LENGTH_M = float(np.linalg.norm(AWAY_M)) - STRETCH_M


def hidden(effect):
    rng, recordings = np.random.default_rng(99111), []
    schedule = Schedule(randoms=1, vias=8, periodic_s=10.0, hold_s=None)
    for number, trajectory in enumerate(schedule.trajectories(build_team("b"), rng), start=1):
        scene = apply_effects(build_team("b", timestep_s=TIMESTEP_S), [effect])
        log = run_trial(scene, trajectory, trial_number=number)
        recordings.append(measure(log, sensor_preset("nominal"), rng, name=f"trial {number}"))
    return recordings


@pytest.mark.slow
def test_a_strap_that_stiffens_is_one_cause_with_its_numbers(tmp_path):
    """Not two cables of other lengths; it is simulated with what it stiffens by."""
    home = build_team("b").wrist_home_b[0]
    numbers = {"stiffness_N_per_m": 10.0, "length_m": LENGTH_M - 0.01, "stiffening_N_per_m2": 800.0}
    numbers |= {f"anchor_{a}_m": float(x) for a, x in zip("xyz", home + AWAY_M, strict=True)}
    found = diagnose_team(hidden(make_effect("tether", numbers, 1)), closed_loop=False)
    (cause,) = found.to_dict()["causes"]
    assert (cause["cause"], cause["robot"]) == ("tether", 1)
    assert cause["probability"] > 0.99
    told = cause["parameters"]["stiffening_N_per_m2"]
    assert told["value"] == pytest.approx(800.0, rel=0.2)
    assert abs(told["value"] - 800.0) < 3.0 * told["se"]
    assert "and stiffens by" in cause["sentence"]
    found.rig.write_extended(found.diagnosis.explanation, tmp_path / "model")
    (added,) = load_extended(tmp_path / "model").effects
    assert added.stiffening_N_per_m2 == pytest.approx(told["value"])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tether", "payload_tether"])
def test_a_cable_that_is_slack_at_times_is_named_with_its_length(tmp_path, name):
    home, point = build_team("b").wrist_home_b[0], np.array([0.4, 0.1, 0.1])
    tied = home + (point if name == "payload_tether" else 0.0)
    numbers = {"stiffness_N_per_m": 20.0, "length_m": LENGTH_M}
    numbers |= {f"anchor_{a}_m": float(x) for a, x in zip("xyz", tied + AWAY_M, strict=True)}
    if name == "payload_tether":
        numbers |= {f"point_{a}_m": float(x) for a, x in zip("xyz", point, strict=True)}
        effect = make_effect(name, numbers)
    else:
        effect = make_effect(name, numbers, 1)
    found = diagnose_team(hidden(effect), closed_loop=False)
    verdict = found.to_dict()
    (cause,) = verdict["causes"]
    assert verdict["verdict"] == "explained"
    assert (cause["cause"], cause["robot"]) == (name, None if name == "payload_tether" else 1)
    assert cause["probability"] > 0.99
    told = {key: entry["value"] for key, entry in cause["parameters"].items()}
    assert told["stiffness_N_per_m"] == pytest.approx(20.0, rel=0.05)
    # How far away it is tied hardly shows; where it comes from, where its line is and when it is slack do.
    anchor = np.array([told[f"anchor_{a}_m"] for a in "xyz"])
    start = np.array([told[f"point_{a}_m"] for a in "xyz"]) + home if name == "payload_tether" else home
    along = (anchor - start) / np.linalg.norm(anchor - start)
    assert np.degrees(np.arccos(along @ AWAY_M / np.linalg.norm(AWAY_M))) < 3.0
    assert np.linalg.norm(np.cross(tied - start, along)) < 0.02
    assert np.linalg.norm(anchor - start) - told["length_m"] == pytest.approx(STRETCH_M, abs=0.003)
    assert "is slack below" in cause["sentence"]
    found.rig.write_extended(found.diagnosis.explanation, tmp_path / "model")
    (added,) = load_extended(tmp_path / "model").effects
    assert added.length_m == pytest.approx(told["length_m"])

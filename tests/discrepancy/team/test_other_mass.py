"""A box that is put on the payload before the second trial: what is said of it, and the simulation with it."""

import numpy as np
import pytest

from discrepancy.team.diagnosis import diagnose_team
from estimator.errors import InputError
from hidden.schedule import Schedule
from hidden_quick import TIMESTEP_S
from mocobot_sim.effects import apply_effects, make_effect
from mocobot_sim.extended.extended import load_extended
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trial import run_trial

BOX = {
    "mass_kg": 0.8,
    "trial": 2,
    "point_x_m": 0.35,
    "point_y_m": 0.2,
    "point_z_m": 0.15,
    "inertia_zz_m2": 5e-3,
}


@pytest.mark.slow
def test_a_box_on_the_payload_is_named_and_simulated(tmp_path):
    rng, recordings = np.random.default_rng(99107), []
    schedule = Schedule(randoms=1, vias=6, periodic_s=8.0, hold_s=None)
    for number, trajectory in enumerate(schedule.trajectories(build_team("b"), rng), start=1):
        scene = apply_effects(build_team("b", timestep_s=TIMESTEP_S), [make_effect("payload_mass", BOX)])
        log = run_trial(scene, trajectory, trial_number=number)
        recordings.append(measure(log, sensor_preset("nominal"), rng, name=f"trial {number}"))
    refused = r"trial 1 says 11.67 kg and trial 2 says 12.4\d kg; recordings must be of one payload"
    with pytest.raises(InputError, match=refused):
        diagnose_team(recordings, excluded=["payload_mass"])
    found = diagnose_team(recordings, laws="never")
    verdict = found.to_dict()
    (cause,) = verdict["causes"]
    assert verdict["verdict"] == "explained"
    assert cause["cause"] == "payload_mass"
    assert cause["probability"] > 0.99
    named = {name: entry["value"] for name, entry in cause["parameters"].items()}
    assert (named["trial"], named["last_trial"], named["rate_kgps"]) == (2, 0, 0.0)
    assert named["mass_kg"] == pytest.approx(0.8, rel=0.02)
    assert [named[f"point_{a}_m"] for a in "xyz"] == pytest.approx([0.35, 0.2, 0.15], abs=0.02)
    # Its own trials have to tell it, so none is left out; the simulation has it in the second trial alone.
    gain = verdict["gain"]
    assert not gain["validated"]
    assert cause["explained"]["held_out"] is None
    assert gain["held_out"]["before"]["chi2_per_n"] > 1e3
    assert gain["held_out"]["after"]["chi2_per_n"] < 10.0
    found.rig.write_extended(found.diagnosis.explanation, tmp_path / "model")
    (effect,) = load_extended(tmp_path / "model").effects
    assert effect.mass_kg == pytest.approx(named["mass_kg"])

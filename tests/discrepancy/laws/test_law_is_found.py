"""A sensor that reads its neighbour: located, put into a formula, told from its look-alike, simulated, written."""

import json

import numpy as np
import pytest

from discrepancy.engine.diagnose import diagnose
from discrepancy.laws.candidate import LawCandidate
from discrepancy.result.json import diagnosis_to_dict
from discrepancy.result.text import format_diagnosis
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import read_tolerances
from discrepancy.team.words import TeamWords
from estimator.estimate.payload import estimate_payload
from mocobot_sim.effects import apply_effects
from mocobot_sim.effects.law import Law
from mocobot_sim.extended.extended import load_extended
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.readings import Misreading, RobotReadings
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trajectories import random_vias, sphere_motion
from mocobot_sim.trial.trial import run_trial

SHARE = 0.04

pytestmark = pytest.mark.slow


class Neighbour(Misreading):
    """Robot 2's first torque sensor feels its second one's load: not the simulator's ``law``."""

    def __init__(self) -> None:
        super().__init__(2, self._mix)

    def _mix(self, readings: RobotReadings, seen: np.ndarray, time: float) -> None:
        readings.set_tau(seen, 1, readings.tau(seen, 1) + SHARE * readings.tau(seen, 2))


@pytest.fixture(scope="module")
def diagnosis():
    rng, nominal, home = np.random.default_rng(12), sensor_preset("nominal"), build_team("a")
    motions = [
        random_vias(home.wrist_home_b, rng, vias=6),
        sphere_motion(home.wrist_home_b, home.X_1i, duration_s=10.0, rng=rng),
    ]
    recordings = []
    for number, motion in enumerate(motions, start=1):
        # A tiny law, so that there is a reader to put another one in the place of.
        hidden = _Hidden("tau_2_1", "constant", "time", 0.0)
        team = apply_effects(build_team("a", timestep_s=1e-3), [hidden])
        recordings.append(
            measure(run_trial(team, motion, trial_number=number), nominal, rng, name=f"trial {number}")
        )
    rig = TeamRig.of(recordings, estimate_payload(recordings), read_tolerances(None))
    return diagnose(rig)


class _Hidden(Law):
    cause = "law"

    def readers(self, trial_number):
        return (Neighbour(),)


def test_place_signal_and_share(diagnosis):
    (found,) = diagnosis.causes
    law = found.candidate
    assert isinstance(law, LawCandidate)
    assert (law.at.name, law.robot, law.joint) == ("tau reading", 2, 1)
    assert (law.term.function, law.term.variables) == ("linear", ("tau_2_2",))
    assert found.values[0] == pytest.approx(SHARE, rel=0.1)
    assert abs(found.values[0] - SHARE) < 4.0 * np.sqrt(found.covariance[0, 0])
    assert all(gain > 0 for gain in found.folds)
    assert diagnosis.verdict == "explained"
    assert diagnosis.located[0].place.key == ("tau reading", 2, 1)


def test_the_closed_loop_tells_it_from_a_torque(diagnosis):
    """The rows are the same; the controller acts on what it reads."""
    (rivals,) = diagnosis.alternatives
    (twin,) = (r for r in rivals if r.candidate.key[0].startswith("law: driven torque"))
    assert twin.evidence_gap == pytest.approx(0.0, abs=1e-6)
    assert twin.chi2_per_n > 1.2 * np.mean([r.chi2_per_n for r in diagnosis.gain.after])
    assert not twin.ambiguous
    assert diagnosis.causes[0].probability > 0.9
    assert diagnosis.gain.removed()[0] > 0.4


def test_it_is_said_and_written(diagnosis, tmp_path):
    values = diagnosis_to_dict(diagnosis, diagnosis.rig, TeamWords())
    json.dumps(values, allow_nan=False)
    (cause,) = values["causes"]
    assert cause["law"]["targets"] == ["tau_2_1"]
    assert "contains 4.0" in cause["sentence"]
    assert "% of the torque of driven joint 2 of robot 2" in cause["sentence"]
    assert "cross-talk" in cause["sentence"]
    assert cause["separate"]
    shares = [
        cause["probability"],
        *cause["instead"].values(),
        *(r["probability"] for r in cause["alternatives"]),
    ]
    assert sum(shares) == pytest.approx(1.0, abs=0.02)
    assert "(law)" in format_diagnosis(values)
    diagnosis.rig.write_extended(diagnosis.explanation, tmp_path / "extended")
    (effect,) = load_extended(tmp_path / "extended").effects
    assert (effect.target, effect.of) == ("tau_2_1", "tau_2_2")
    assert effect.amplitude == pytest.approx(SHARE, rel=0.1)


def test_never_means_never(diagnosis):
    without = diagnose(diagnosis.rig, closed_loop=False, laws="never")
    assert not without.located
    assert not [found for found in without.causes if isinstance(found.candidate, LawCandidate)]
    assert without.verdict in ("unexplained", "partly_explained")

"""A team one of whose encoders holds its last value for a while, again and again."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from discrepancy.team.diagnosis import diagnose_team
from discrepancy.team.told import TeamDiagnosed
from estimator.recording.model import Recording
from hidden_team import recorded

ROBOT, JOINT = 2, 1
FIRST, EVERY, HELD = 331, 170, 13
"""Sample at which it holds its value first, and samples from each time to the next, and of each."""


def holding(recording: Recording) -> Recording:
    """Its second robot's first driven angle holds its value for 0.13 s every 1.7 s."""
    phi = recording.phi.copy()
    for start in range(FIRST, len(phi) - HELD, EVERY):
        phi[start : start + HELD, ROBOT - 1, JOINT - 1] = phi[start, ROBOT - 1, JOINT - 1]
    return replace(recording, phi=phi)


@pytest.fixture(scope="module")
def found() -> TeamDiagnosed:
    return diagnose_team([holding(r) for r in recorded("b", seed=6)], closed_loop=False)


def test_the_encoder_is_told_and_nothing_besides(found):
    values = found.to_dict()
    json.dumps(values, allow_nan=False)
    (cause,) = values["causes"]
    assert (cause["cause"], cause["robot"], cause["joint"]) == ("unlisted", ROBOT, JOINT)
    assert values["verdict"] == "explained"
    assert [place["joint"] for place in values["places"]] == [JOINT]
    assert 0.5 * HELD / EVERY < cause["shape"]["share"] < 1.2 * HELD / EVERY  # at rest none shows
    assert "held readings at driven joint 1 of robot 2" in str(found)


def test_times_are_told(found):
    (cause,) = found.to_dict()["causes"]
    time = found.verdict.rig.recordings[0].time
    near = np.abs(time[FIRST::EVERY] - cause["event"]["start_s"])
    assert near.min() < 0.03
    assert cause["event"]["trial"] == 1
    assert cause["event"]["duration_s"] == pytest.approx(HELD / 100.0, abs=0.03)
    assert any("holds its last value" in note for note in found.to_dict()["notes"])


def test_rows_that_held_readings_reach_are_left_out(found):
    """And no more than these: what is left is noise."""
    rig = found.verdict.rig
    for linear in rig.linear:
        held = np.arange(FIRST, len(linear.signals.time) - HELD, EVERY)
        rows = linear.reduction.sample[: linear.reduction.moving]
        moves = np.abs(np.gradient(linear.signals.phi[:, ROBOT - 1, JOINT - 1], linear.signals.time)) > 0.05
        assert not any(start + HELD // 2 in rows for start in held if moves[start : start + HELD].all())
    assert found.verdict.chi2_per_n[2] < 1.15

"""Replays and pictures of robots as a calibration has them: flanges meet their grasps, bases stand as they do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.arm.unit import AT
from estimator.estimate.payload import estimate_payload
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording
from mocobot_view.pictures import measured_team
from mocobot_view.replay_trial import ReplayTrial, replay_trial
from uncalibrated_team import knowing, uncalibrated


@pytest.fixture(scope="module")
def known() -> Recording:
    carried, units = uncalibrated(16.0)
    return knowing(carried.recording, units)


@pytest.fixture(scope="module")
def estimate(known: Recording) -> PayloadEstimate:
    return estimate_payload([known])


def gap_m(trial: ReplayTrial) -> float:
    assert trial.motion is not None
    return float(trial.motion.gap_position_m.max())


def test_flanges_meet_their_grasps(known: Recording, estimate: PayloadEstimate) -> None:
    bare = knowing(known, None)
    assert gap_m(replay_trial(known, "known", estimate)) < 1e-5
    # What an estimate was made of goes for a recording that does not say it itself ...
    assert gap_m(replay_trial(bare, "bare", estimate)) < 1e-5
    # ... and without either, robots are as designed.
    assert gap_m(replay_trial(bare, "bare", replace(estimate, units=None))) > 1e-3


def test_bases_are_drawn_as_they_stand(known: Recording, estimate: PayloadEstimate) -> None:
    trial, units = replay_trial(known, "known", estimate), known.metadata.units
    assert units is not None
    for R, tilt in zip(trial.bases.R_Wb, units.x[:, AT["tilt"]], strict=True):
        up = R.T @ [0.0, 0.0, 1.0]  # of the arm's own frame
        np.testing.assert_allclose(up, Rotation.from_rotvec([*-tilt, 0.0]).apply([0, 0, 1]), atol=1e-12)


def test_a_picture_has_the_wrists_of_robots_as_they_are(known: Recording, estimate: PayloadEstimate) -> None:
    """The platform of the drawn model, by MuJoCo's kinematics, is where the payload's grasp is."""
    import mujoco

    team = measured_team(known, estimate)
    assert team.R_W1 is not None
    assert team.p_W1 is not None
    assert estimate.grasps is not None
    data = mujoco.MjData(team.model)
    data.qpos[:] = team.qpos
    mujoco.mj_kinematics(team.model, data)
    for i, p_1i in enumerate(estimate.grasps.p_1i, start=1):
        flange = data.body(f"omnid{i}/flange").xpos
        np.testing.assert_allclose(flange, team.p_W1 + team.R_W1 @ p_1i, atol=1e-5)

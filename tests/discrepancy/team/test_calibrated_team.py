"""A team as a calibration has it: rows, their derivatives and the simulated team are of robots as they are."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from discrepancy.team.closed_loop import posture, team_of
from discrepancy.team.diagnosis import check_recordings
from discrepancy.team.linear.rows import Reduction
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.trial_linear import TrialLinear, linearise
from estimator.arm.unit import AT, ArmUnit
from estimator.errors import InputError
from estimator.recording.model import Recording
from estimator.rigid_team import poses, start_bases
from team_case import true_shared
from uncalibrated_team import knowing, uncalibrated


def linear(recording: Recording) -> TrialLinear:
    signals, shared = Signals.of(recording), true_shared()
    arms = recording.metadata.arms
    return linearise(
        signals,
        shared,
        start_bases(*poses(signals.phi, signals.theta, arms), shared),
        arms,
        Reduction.of(signals),
        full=True,
    )


@pytest.fixture(scope="module")
def known() -> Recording:
    carried, units = uncalibrated(16.0)
    return knowing(carried.recording, units)


@pytest.fixture(scope="module")
def rows(known: Recording) -> TrialLinear:
    return linear(known)


def test_nothing_is_left_of_an_exact_recording(known: Recording, rows: TrialLinear) -> None:
    left = np.abs(rows.residual).max(axis=0)
    assert left[:12].max() < 1e-5  # rad, m: bases from means
    assert left[12:].max() < 1e-4  # N, N m
    as_designed = np.abs(linear(knowing(known, None)).residual).max(axis=0)
    assert as_designed[:12].max() > 3e-3
    assert as_designed[12:].max() > 0.3


@pytest.mark.parametrize("robot", [0, 2])
def test_an_error_of_a_reading_is_what_the_derivatives_say(
    known: Recording, rows: TrialLinear, robot: int
) -> None:
    """Against the residual of readings with the error put in: of tilted robots, too."""
    error, size = np.zeros(known.phi.shape), 1e-4
    error[:, robot] = size * np.array([1.0, -0.5, 0.3])
    spoilt = replace(known, phi=known.phi + error, tau=known.tau + 10.0 * error)
    signals = Signals.of(spoilt)
    changed = linearise(signals, rows.shared, rows.bases, rows.arms, rows.reduction, full=False)
    stiff = 1.0 + known.metadata.arms.of("stiffness_ratio")[robot]  # type: ignore[union-attr]
    predicted = rows.of_signals(robot, phi=error[:, robot], tau=10.0 * error[:, robot] * stiff)
    scale = np.abs(predicted).max(axis=0) + 1e-9
    assert np.max(np.abs(changed.residual - rows.residual - predicted) / scale) < 5e-3


def test_the_simulated_team_is_the_calibrated_one(known: Recording, rows: TrialLinear) -> None:
    """MuJoCo's own bodies: arms stand tilted about {b}, and zeros and springs are those of the units."""
    initial, units = posture(known)
    assert isinstance(units, ArmUnit)
    np.testing.assert_allclose(initial[0], known.phi[0] - units.x[:, AT["phi_zero"]])
    scene = team_of(rows.shared, rows.bases, [], initial, units)
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    bodies = [data.body(f"omnid{i}/base") for i in (1, 2, 3)]
    for i, body in enumerate(bodies):
        tilt = Rotation.from_rotvec([*units.x[i, AT["tilt"]], 0.0]).as_matrix()
        np.testing.assert_allclose(body.xmat.reshape(3, 3), rows.bases.R[i] @ tilt, atol=1e-9)
        np.testing.assert_allclose(body.xpos - bodies[0].xpos, rows.bases.p[i], atol=1e-9)
        np.testing.assert_array_equal(scene.units[i].tau_zero_Nm, units.x[i, AT["tau_zero"]])
        np.testing.assert_array_equal(scene.units[i].stiffness_ratio, units.x[i, AT["stiffness_ratio"]])


def test_recordings_with_different_calibrations_are_refused(known: Recording) -> None:
    units = known.metadata.units
    assert units is not None
    check_recordings([known, knowing(known, ArmUnit(units.design, units.x.copy()))])
    for other in (None, ArmUnit(units.design, 1.1 * units.x)):
        with pytest.raises(InputError, match="carry different calibrations; give one to both"):
            check_recordings([known, knowing(known, other)])

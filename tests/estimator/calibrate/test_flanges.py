"""Zeros of theta_x from parallel flanges, against MuJoCo's grasp frames, Euler angles and scatter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.arm.unit import AT, COUNT
from estimator.arrays import Array
from estimator.calibrate.calibration import CalibratedPayload, Calibration
from estimator.calibrate.flanges import in_drawing_frames, parallel_flanges, turned
from estimator.calibrate.json import calibration_from_dict, calibration_to_dict
from estimator.estimate.grasps import GraspEstimate
from invented_calibration import invented_calibration
from mocobot_sim.scene.scene import build_team

ONE_DEG = float(np.deg2rad(1.0))
X = AT["theta_zero"].stop - 1


def as_encoders_say(R_1i: Array, zeros: Array) -> Array:
    """Frames turned about their own x axes by what the encoders read too much."""
    Rx = [Rotation.from_rotvec([z, 0.0, 0.0]).as_matrix() for z in zeros]
    return np.array([Rx[0].T @ R @ each for R, each in zip(R_1i, Rx, strict=True)])


def payload_of(R_1i: Array, p_1i: Array, sd_rad: float = 1e-5, sd_m: float = 1e-4) -> CalibratedPayload:
    N = len(R_1i)
    sd = np.r_[np.tile([sd_rad] * 3 + [sd_m] * 3, N - 1), np.full(10, 1e-3)]
    none, each = np.full((N, N), np.nan), np.full(N, np.nan)
    grasps = GraspEstimate(R_1i, p_1i, np.diag(sd[:-10] ** 2), none, none, each, each)
    parameters = np.array([11.6, 4.0, -6.0, 0.4, 4.5, 2.0, -0.1, 3.5, 0.2, 7.6])
    return CalibratedPayload("x", grasps, parameters, np.diag(sd**2), np.zeros(len(sd)))


def team_of(payload: str, zeros: Array) -> tuple[CalibratedPayload, Array]:
    """A payload as MuJoCo has it, in the frames of encoders with these zeros; and its true rotations."""
    X_1i = build_team(payload).X_1i
    R, p = X_1i.rotation.as_matrix(), X_1i.translation
    about = Rotation.from_rotvec([zeros[0], 0.0, 0.0]).as_matrix()
    return payload_of(as_encoders_say(R, zeros), p @ about), R


@pytest.mark.parametrize("payload", ["a", "b", "c", "d"])
def test_the_projects_payloads_have_parallel_flanges_that_decide_all_zeros(payload: str) -> None:
    truth = np.random.default_rng(3).normal(0.0, ONE_DEG, 3)
    held, R = team_of(payload, truth)
    found = parallel_flanges([held], ONE_DEG)
    np.testing.assert_allclose(found.zeros, truth, atol=5e-6)
    assert np.rad2deg(np.sqrt(np.diag(found.covariance))).max() < 0.002
    angles = Rotation.from_matrix(turned(held.grasps.R_1i, found.zeros) @ np.swapaxes(R, 1, 2)).magnitude()
    assert angles.max() < 1e-5
    assert found.misfit_rad < 1e-7


def test_two_robots_across_each_other_are_an_euler_angle_problem() -> None:
    """Rx(-z_1) Rz(90 deg) Rx(z_2): the zeros are the outer two of X-Z-X Euler angles."""
    truth = np.array([0.02, -0.015])
    turn = np.array([np.eye(3), Rotation.from_euler("z", 90.0, degrees=True).as_matrix()])
    R = as_encoders_say(turn, truth)
    first, _, last = Rotation.from_matrix(R[1]).as_euler("XZX")
    found = parallel_flanges([payload_of(R, np.array([[0.0, 0, 0], [1.0, 0, 0]]))], ONE_DEG)
    np.testing.assert_allclose(found.zeros, [-first, last], atol=1e-8)
    np.testing.assert_allclose(found.zeros, truth, atol=1e-8)


def test_a_common_turn_about_parallel_x_axes_stays_open() -> None:
    truth = np.array([0.02, -0.015, 0.01])
    R = as_encoders_say(np.tile(np.eye(3), (3, 1, 1)), truth)
    held = payload_of(R, np.random.default_rng(0).normal(size=(3, 3)))
    found = parallel_flanges([held], ONE_DEG)
    np.testing.assert_allclose(found.zeros - found.zeros[0], truth - truth[0], atol=1e-7)
    assert found.zeros.mean() == pytest.approx(0.0, abs=1e-7)  # the prior's
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), ONE_DEG / np.sqrt(3), rtol=1e-3)
    named = in_drawing_frames(replace(invented_calibration(3), payloads=(held,)))
    assert len(named.open) == 2
    assert named.open[1].startswith("Parallel flanges do not decide the zeros of theta_x of robots 1, 2, 3 (")
    # Turned about x with everything else, m c_z moves by m c_y.
    turned_by = np.hypot(6.0 * ONE_DEG / np.sqrt(3), 1e-3)
    assert np.sqrt(named.payloads[0].covariance[-7, -7]) == pytest.approx(turned_by, rel=0.02)
    # A second payload, held with one flange turned, decides it.
    more, _ = team_of("b", truth)
    np.testing.assert_allclose(parallel_flanges([held, more], ONE_DEG).zeros, truth, atol=5e-6)


def test_flanges_that_are_not_parallel_are_found_out() -> None:
    held, _ = team_of("b", np.array([0.01, -0.02, 0.015]))
    bent = held.grasps.R_1i.copy()
    bent[2] = bent[2] @ Rotation.from_euler("y", 1.0, degrees=True).as_matrix()
    made = replace(invented_calibration(3), payloads=(payload_of(bent, held.grasps.p_1i),))
    assert in_drawing_frames(replace(made, payloads=(held,))).findings == made.findings
    named = in_drawing_frames(made)
    assert len(named.findings) == 2
    assert "they are not parallel" in named.findings[1]
    # Errors grow with what is left over: nobody knows which of the flanges is bent.
    assert np.rad2deg(named.sd[:, X]).min() > 0.1


def test_results_move_into_the_frames_of_the_drawing() -> None:
    truth = np.array([0.015, -0.02, 0.01])
    held, _ = team_of("c", truth)
    made = replace(
        invented_calibration(3),
        payloads=(held,),
        open=("zeros of theta_x: turn the grasp frames", "arm masses"),
    )
    named = in_drawing_frames(made)
    assert named.open == ("arm masses",)
    np.testing.assert_allclose(named.units.of("theta_zero")[:, 2], truth, atol=5e-6)
    others = np.delete(np.arange(COUNT), X)
    np.testing.assert_array_equal(named.units.x[:, others], made.units.x[:, others])
    found = named.payloads[0]
    np.testing.assert_allclose(found.grasps.p_1i, build_team("c").X_1i.translation, atol=1e-5)
    Rx = Rotation.from_rotvec([truth[0], 0.0, 0.0])
    np.testing.assert_allclose(found.parameters[1:4], Rx.apply(held.parameters[1:4]), atol=1e-4)
    assert found.parameters[0] == held.parameters[0]
    assert found.covariance[-10, -10] == pytest.approx(held.covariance[-10, -10], rel=1e-6)
    back = calibration_from_dict(calibration_to_dict(named))
    np.testing.assert_array_equal(back.units.x, named.units.x)


def test_errors_cover_what_scatters() -> None:
    """Draws of zeros and of the grasps' errors, against the standard errors of zeros, grasps and centre of mass."""
    rng = np.random.default_rng(11)
    X_1i = build_team("b").X_1i
    R, p = X_1i.rotation.as_matrix(), X_1i.translation
    errors = []
    for _ in range(60):
        zeros = rng.normal(0.0, ONE_DEG, 3)
        about = Rotation.from_rotvec([zeros[0], 0.0, 0.0]).as_matrix()
        exact = payload_of(as_encoders_say(R, zeros), p @ about, 1e-3, 1e-3)
        drawn = np.linalg.cholesky(exact.covariance) @ rng.standard_normal(22)
        noisy = replace(
            exact, grasps=exact.grasps.moved(drawn[:12]), parameters=exact.parameters + drawn[12:]
        )
        done: Calibration = in_drawing_frames(replace(invented_calibration(3), payloads=(noisy,)))
        found = done.payloads[0]
        d = Rotation.from_matrix(R @ np.swapaxes(found.grasps.R_1i, 1, 2)).as_rotvec()[1:]
        e = (p - found.grasps.p_1i)[1:]
        mc = Rotation.from_rotvec([zeros[0], 0.0, 0.0]).apply(exact.parameters[1:4]) - found.parameters[1:4]
        each = np.r_[np.column_stack([d, e]).ravel(), mc]
        at = np.r_[0:12, 13:16]
        sd = np.sqrt(np.diag(found.covariance)[at])
        errors.append(np.r_[(zeros - done.units.of("theta_zero")[:, 2]) / done.sd[:, X], each / sd])
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert (rms > 0.75).all(), rms
    assert (rms < 1.25).all(), rms

"""The stacked residual and its derivatives on exact recordings, against brute force."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from estimator.arm.delta import forward_kinematics
from estimator.arm.motion import PHI
from estimator.rigid_team import balance, grasp_data, pose_error, poses, start_bases
from team_case import DESIGN, every_sample, exact, residual_of


@pytest.fixture(scope="module")
def case():
    return exact()


@pytest.fixture(scope="module")
def linear(case):
    return case.linear


def unfiltered(case, signals=None, shared=None, bases=None):
    """The residual's rows in full, from scratch."""
    return residual_of(case, signals or case.signals, shared or case.shared, bases or case.bases)


def test_residual_of_an_ideal_team_is_zero(linear):
    split = 12
    assert np.abs(linear.residual[:, :split]).max() < 2e-7  # rad, m
    assert np.abs(linear.residual[:, split:]).max() < 0.02  # of 115 N and some 60 N m: what the filters bend
    assert np.sqrt(np.mean(linear.residual[:, split:] ** 2)) < 5e-3


def test_bases_are_found_from_grasps_and_joints(case):
    found = start_bases(*poses(case.signals.phi, case.signals.theta, DESIGN), case.shared)
    np.testing.assert_allclose(found.R, case.bases.R, atol=1e-8)
    np.testing.assert_allclose(found.p, case.bases.p, atol=1e-8)


def test_derivative_by_shared_unknowns(case, linear):
    for k in range(linear.by_shared.shape[2]):
        step = np.zeros(linear.by_shared.shape[2])
        step[k] = 1e-4
        ends = [unfiltered(case, shared=case.shared.moved(sign * step)) for sign in (1.0, -1.0)]
        expected = (ends[0] - ends[1]) / 2e-4
        scale = np.abs(expected).max()
        np.testing.assert_allclose(linear.by_shared[:, :, k], expected, atol=2e-6 * scale)


def test_derivative_by_bases(case, linear):
    assert linear.by_bases.shape[2] == 8
    for k in range(8):
        step = np.zeros(8)
        step[k] = 1e-4
        ends = [unfiltered(case, bases=case.bases.moved(sign * step)) for sign in (1.0, -1.0)]
        expected = (ends[0] - ends[1]) / 2e-4
        np.testing.assert_allclose(linear.by_bases[:, :, k], expected, atol=1e-6 * np.abs(expected).max())
        np.testing.assert_array_equal(linear.by_bases[:, 12:, k], 0.0)


@pytest.mark.parametrize("robot", [0, 1, 2])
@pytest.mark.parametrize("field", ["phi", "theta", "tau"])
@pytest.mark.parametrize("kind", ["constant", "sway"])
def test_derivative_by_readings(case, linear, robot, field, kind):
    """Errors of one reading, constant and changing, against the full nonlinear residual."""
    size = {"phi": 1e-4, "theta": 1e-4, "tau": 1e-2}[field]
    time = case.signals.time
    for joint in ((robot + (kind == "sway")) % 3,):
        error = np.zeros((len(time), 3))
        error[:, joint] = size * (1.0 if kind == "constant" else np.sin(2 * np.pi * 0.4 * time + joint))
        full = np.zeros_like(case.signals.phi)
        full[:, robot] = error
        ends = []
        for sign in (1.0, -1.0):
            moved = replace(case.signals, **{field: getattr(case.signals, field) + sign * full})
            ends.append(unfiltered(case, moved))
        expected = (ends[0] - ends[1]) / 2
        argument = size * np.eye(3)[joint] if kind == "constant" else error
        got = linear.of_signals(robot, **{field: argument})
        for part in (slice(0, 12), slice(12, 15), slice(15, 18)):
            scale = max(np.abs(expected[:, part]).max(), 1e-9)
            np.testing.assert_allclose(got[:, part], expected[:, part], atol=6e-3 * scale)


def test_jacobian_is_one_of_filtered_signals(case, linear):
    """By brute force at single samples: one of the 21 signals moved, all formulas again."""

    def samples(s):
        data = grasp_data(s, DESIGN, 100.0)
        pose = pose_error(data.R_bi, data.p_bi, case.shared, case.bases)
        return np.concatenate([pose, balance(data, case.shared)[0]], axis=1)

    at = np.arange(200, len(linear.s) - 200, 100)  # every one a multiple of 4: no interpolation
    for robot in range(3):
        for k, step in zip(range(21), np.repeat([1e-5, 1e-4, 1e-3, 1e-5, 1e-4, 1e-3, 1e-3], 3), strict=True):
            ends = []
            for sign in (1.0, -1.0):
                s = linear.s[at].copy()
                s[:, robot, k] += sign * step
                ends.append(samples(s))
            expected = (ends[0] - ends[1]) / (2 * step)
            scale = max(np.abs(expected).max(), 1e-9)
            np.testing.assert_allclose(
                every_sample(linear.J)[robot, at][:, :, k], expected, atol=2e-4 * scale
            )


def test_outside_wrench_takes_from_what_robots_exert(case, linear):
    """With a force from outside the robots exert that much less, and their sum says so."""
    samples = len(case.signals.time)
    force = np.tile([1.0, -2.0, 0.5], (samples, 1))
    moment = np.tile([0.1, 0.3, -0.2], (samples, 1))
    x = linear.of_wrench(force, moment)
    np.testing.assert_array_equal(x[:, :12], 0.0)
    np.testing.assert_allclose(x[:, 12:], np.tile([-1.0, 2.0, -0.5, -0.1, -0.3, 0.2], (len(x), 1)), rtol=1e-9)


@pytest.mark.parametrize("robot", [0, 1, 2])
def test_moved_grasp_frames(case, linear, robot):
    """The frame truly lies displaced by d, turned by r: recordings of the very same joints then contradict."""
    samples = len(case.signals.time)
    turn, shift = np.array([2e-4, -1e-4, 3e-4]), np.array([1e-4, 2e-4, -3e-4])
    x = linear.of_pose(robot, np.tile(turn, (samples, 1)), np.tile(shift, (samples, 1)))
    # The rigid payload puts the joints where the displaced frame meets the others'; seen from the joints alone,
    # the assumed frame of robot i is then displaced the opposite way.
    R, h = linear.data.R_bi.copy(), linear.data.p_bi.copy()
    back = case.bases.R[robot].T
    R[:, robot] = Rotation.from_rotvec(-back @ turn).as_matrix() @ R[:, robot]
    h[:, robot] = h[:, robot] - back @ shift
    expected = pose_error(R, h, case.shared, case.bases) - pose_error(
        linear.data.R_bi, linear.data.p_bi, case.shared, case.bases
    )
    reduced = linear.reduction(expected)
    if robot:
        np.testing.assert_allclose(x[:, :12], reduced, atol=2e-7)
    else:
        # Robot 1's rotation turns its view of all other grasps too; ``of_pose`` leaves that to its caller.
        got, expected = (y[:, :12].reshape(-1, 2, 6)[..., :3] for y in (x, reduced))
        np.testing.assert_allclose(got, expected, atol=2e-7)
        plain = linear.of_pose(0, None, np.tile(shift, (samples, 1)))[:, :12].reshape(-1, 2, 6)
        np.testing.assert_allclose(plain[..., 3:], np.tile(shift, (len(x), 2, 1)), atol=1e-9)
        np.testing.assert_array_equal(plain[..., :3], 0.0)
    np.testing.assert_allclose(x[:, 12:], 0.0, atol=1e-12)


def test_wrists_are_accelerated_as_the_second_derivative_of_where_they_are(case, linear):
    """By forward kinematics of each sample, and central differences in time."""
    s, step = linear.signals, 1.0 / linear.signals.rate_hz
    for robot in range(3):
        # A spline through the joints' own filtered motion: the second difference of samples is too coarse.
        at = [
            make_interp_spline(s.time, linear.s[:, robot, PHI], k=5)(s.time + x * step / 8)
            for x in (-1, 0, 1)
        ]
        before, here, after = (forward_kinematics(phi, DESIGN) for phi in at)
        expected = (after - 2.0 * here + before) / (step / 8) ** 2
        inner = slice(200, -200)
        found = linear.wrist_accelerations[inner, robot]
        assert np.abs(expected[inner]).max() > 0.05
        np.testing.assert_allclose(found, expected[inner], atol=0.01 * np.abs(expected[inner]).max())

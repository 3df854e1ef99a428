import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.arm.dynamics import angular_motion, moment_about_axes, rate_matrix, rotation
from omnid_design import DESIGN

RNG = np.random.default_rng(3)
LIMIT = DESIGN.gimbal_limit_rad
# Ordinary angles, the corners of the range, and angles next to zero.
CORNERS = np.array(np.meshgrid([-LIMIT, LIMIT], [-LIMIT, LIMIT], [-LIMIT, LIMIT])).reshape(3, -1).T
ANGLES = np.concatenate(
    [RNG.uniform(-LIMIT, LIMIT, (40, 3)), CORNERS, RNG.normal(0, 1e-7, (5, 3)), [[0, 0, 0]]]
)
RATES = RNG.normal(0, 3, ANGLES.shape)
ACCELERATIONS = RNG.normal(0, 30, ANGLES.shape)


def derivative(function, step):
    """Fourth-order central difference of function(s) at s = 0."""
    f = [function(k * step) for k in (-2, -1, 1, 2)]
    return (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step)


def motion(s):
    return ANGLES + s * RATES + s**2 / 2 * ACCELERATIONS


def omega_of_motion(s):
    """Angular velocity in {i} from the rotations alone: the vector part of R^T dR/ds."""
    here = Rotation.from_euler("ZYX", motion(s))
    return derivative(lambda ds: (here.inv() * Rotation.from_euler("ZYX", motion(s + ds))).as_rotvec(), 1e-3)


def test_rotation_is_intrinsic_zyx():
    assert rotation(ANGLES) == pytest.approx(Rotation.from_euler("ZYX", ANGLES).as_matrix(), abs=1e-15)


def test_positive_angles_turn_the_right_way():
    quarter = np.pi / 2
    assert rotation([quarter, 0, 0]) @ [1, 0, 0] == pytest.approx([0, 1, 0])
    assert rotation([0, quarter, 0]) @ [0, 0, 1] == pytest.approx([1, 0, 0])
    assert rotation([0, 0, quarter]) @ [0, 1, 0] == pytest.approx([0, 0, 1])


def test_rate_matrix_holds_the_axes_of_the_gimbal_in_the_grasp_frame():
    for theta, axes in zip(ANGLES, rate_matrix(ANGLES), strict=True):
        z, y, x = theta
        assert axes[:, 0] == pytest.approx(Rotation.from_euler("ZYX", [z, y, x]).as_matrix().T @ [0, 0, 1])
        assert axes[:, 1] == pytest.approx(Rotation.from_euler("X", x).as_matrix().T @ [0, 1, 0])
        assert axes[:, 2] == pytest.approx([1, 0, 0])


def test_angular_motion_is_the_derivative_of_the_rotation():
    omega, omega_dot = angular_motion(ANGLES, RATES, ACCELERATIONS)
    assert omega == pytest.approx(omega_of_motion(0.0), abs=1e-7)
    assert omega_dot == pytest.approx(derivative(omega_of_motion, 1e-3), abs=2e-5)


def test_rate_matrix_is_singular_only_at_gimbal_lock():
    assert np.linalg.det(rate_matrix(ANGLES)) == pytest.approx(-np.cos(ANGLES[:, 1]))


def test_leading_axes_are_kept():
    theta = ANGLES[:24].reshape(2, 3, 4, 3)
    assert rotation(theta)[1, 2, 3] == pytest.approx(rotation(theta[1, 2, 3]), abs=0)
    omega, omega_dot = angular_motion(theta, RATES[:24].reshape(theta.shape), theta)
    assert omega.shape == omega_dot.shape == theta.shape


def test_moment_about_axes_has_the_given_components_about_them():
    torques = np.array([1.0, -2.0, 0.5]) + 0.1 * ANGLES
    moments = moment_about_axes(ANGLES, torques)
    about = np.einsum("qij,qi->qj", rate_matrix(ANGLES), moments)
    assert about == pytest.approx(torques, abs=1e-12)
    one = moment_about_axes(ANGLES, np.eye(3)[1])  # of all angles at once
    assert np.einsum("qij,qi->qj", rate_matrix(ANGLES), one) == pytest.approx(
        np.tile(np.eye(3)[1], (len(ANGLES), 1))
    )

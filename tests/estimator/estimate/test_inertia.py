"""Inertia and all ten inertial parameters, against Pinocchio and MuJoCo."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from estimator.arrays import inertia_matrix, inertia_parameters
from estimator.estimate.grasps import estimate_grasps
from estimator.estimate.inertia import estimate_inertia, principal_inertia, project_positive
from estimator.estimate.joint import estimate_joint
from estimator.rigid_team import inertia_regressor, newton_euler_regressor
from mocobot_sim.paper.scoring import PAYLOADS, payload_truth
from mujoco_body import mujoco_data
from rigid_body_data import make_body, moving, still

PIN_ORDER = [4, 5, 7, 6, 8, 9]  # Pinocchio lists xx, xy, yy, xz, yz, zz after m and m c; ours xx, xy, xz, ...


def random_inertia(rng):
    R = Rotation.random(rng=rng).as_matrix()
    return R @ np.diag(rng.uniform(1, 2, 3)) @ R.T


def printed_B(w):
    """Equation (22) as printed: six rows of three."""
    x, y, z = w
    return np.array(
        [
            [0, -x * z, x * y],
            [x * z, y * z, z**2 - x**2],
            [-x * y, -(y**2) + x**2, -y * z],
            [-y * z, -(z**2) + y**2, y * z],
            [0, -x * y, -x * z],
            [x * y, x * z, 0],
        ]
    )


def test_regressor_is_pinocchios():
    rng = np.random.default_rng(1)
    for omega, alpha in rng.normal(size=(20, 2, 3)):
        zero = np.zeros(3)
        Y = pin.bodyRegressor(pin.Motion(zero, omega), pin.Motion(zero, alpha))
        np.testing.assert_allclose(inertia_regressor(omega, alpha), Y[3:, PIN_ORDER], atol=1e-13)


def test_equation_22_is_right_when_rejoined_and_wrong_when_transposed():
    rng = np.random.default_rng(2)
    for omega in rng.normal(size=(10, 3)):
        B = inertia_regressor(omega, np.zeros(3))
        printed = printed_B(omega)
        np.testing.assert_allclose(np.hstack([printed[:3], printed[3:]]), B, atol=1e-14)
        assert np.max(np.abs(printed.T - B)) > 0.1 * np.max(np.abs(B))


@pytest.mark.parametrize("N", [1, 2, 5])
def test_exact_data_give_the_exact_inertia(N):
    body = make_body(N, seed=N)
    trials = [moving(body, 15, seed=k) for k in (1, 2)]
    grasps, _ = estimate_grasps(trials)
    estimate, report = estimate_inertia(trials, grasps, body.p_1c)
    assert report.determined
    np.testing.assert_allclose(estimate.inertia, body.inertia, atol=1e-10)
    np.testing.assert_allclose(estimate.principal.moments, np.linalg.eigvalsh(body.inertia), atol=1e-10)
    assert not estimate.projected


def test_mujoco_inverse_dynamics_give_the_inertia_back():
    body = make_body(3)
    data = mujoco_data(body, np.arange(0, 20, 0.05))
    grasps, _ = estimate_grasps([data])
    np.testing.assert_allclose(grasps.R_1i, body.R_1i, atol=1e-10)
    np.testing.assert_allclose(grasps.p_1i, body.p_1i, atol=1e-10)
    estimate, _ = estimate_inertia([data], grasps, body.p_1c)
    np.testing.assert_allclose(estimate.inertia, body.inertia, atol=2e-6)


def test_moments_at_the_grasps_count():
    body = make_body(3)
    data = moving(body, 15)
    assert np.max(np.abs(data.wrench[..., :3])) > 0.5
    grasps, _ = estimate_grasps([data])
    data.wrench[..., :3] = 0
    estimate, _ = estimate_inertia([data], grasps, body.p_1c)
    assert estimate is None or np.max(np.abs(estimate.inertia - body.inertia)) > 0.01


@pytest.mark.parametrize("name", PAYLOADS)
def test_axes_follow_the_sign_convention_of_table_i(name):
    truth = payload_truth(name)
    rng = np.random.default_rng(0)
    noise = rng.normal(0, 1e-9, (3, 3))  # whatever signs the eigenvectors come with
    result = principal_inertia(truth.inertia + noise + noise.T, 1e-10 * np.eye(6))
    np.testing.assert_allclose(result.moments, truth.principal_moments, atol=1e-7)
    np.testing.assert_allclose(result.R_1c, truth.R_1c, atol=1e-6)
    assert np.linalg.det(result.R_1c) == pytest.approx(1)


def test_axes_are_right_handed_and_of_smallest_angle_for_any_inertia():
    rng = np.random.default_rng(5)
    for _ in range(50):
        inertia = random_inertia(rng)
        R = principal_inertia(inertia, 1e-12 * np.eye(6)).R_1c
        assert np.linalg.det(R) == pytest.approx(1)
        np.testing.assert_allclose(R @ np.diag(np.linalg.eigvalsh(inertia)) @ R.T, inertia, atol=1e-12)
        angle = np.linalg.norm(Rotation.from_matrix(R).as_rotvec())
        for half_turn in np.diag([np.pi] * 3):
            other = R @ Rotation.from_rotvec(half_turn).as_matrix()
            assert angle <= np.linalg.norm(Rotation.from_matrix(other).as_rotvec()) + 1e-12


def test_principal_standard_errors_against_sampling():
    rng = np.random.default_rng(6)
    inertia = random_inertia(rng) + np.diag([0, 0.8, 2.0])
    root = rng.normal(0, 0.004, (6, 6))
    covariance = root @ root.T
    claimed = principal_inertia(inertia, covariance)
    moments, angles = [], []
    for sample in rng.multivariate_normal(inertia_parameters(inertia), covariance, 4000):
        one = principal_inertia(inertia_matrix(sample), covariance)
        moments.append(one.moments)
        angles.append(one.axis_angle_rad)
    np.testing.assert_allclose(claimed.moments_se, np.std(moments, axis=0), rtol=0.1)
    np.testing.assert_allclose(claimed.axis_angle_se_rad, np.std(angles, axis=0), rtol=0.1)


def test_negative_eigenvalues_are_projected_and_reported():
    R = Rotation.from_rotvec([0.3, 0.2, -1.0]).as_matrix()
    projected, acted = project_positive(R @ np.diag([-0.1, 1.0, 2.0]) @ R.T)
    assert acted
    np.testing.assert_allclose(projected, R @ np.diag([0.0, 1.0, 2.0]) @ R.T, atol=1e-14)
    same, acted = project_positive(np.diag([0.0, 1.0, 2.0]))
    assert not acted
    np.testing.assert_array_equal(same, np.diag([0.0, 1.0, 2.0]))


PIN_TEN = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]


def test_regressor_of_all_ten_is_pinocchios():
    rng = np.random.default_rng(0)
    for omega, alpha, v, v_dot in rng.normal(size=(20, 4, 3)):
        Y = pin.bodyRegressor(pin.Motion(v, omega), pin.Motion(v_dot, alpha))[:, PIN_TEN]
        ours = newton_euler_regressor(omega[None], alpha[None], (v_dot + np.cross(omega, v))[None])[0]
        np.testing.assert_allclose(ours, Y, atol=1e-13)


def test_regressor_times_parameters_is_pinocchios_inverse_dynamics():
    rng = np.random.default_rng(1)
    body = make_body(1)
    inertia = pin.Inertia(body.mass, body.p_1c, body.inertia)
    theta = inertia.toDynamicParameters()[PIN_TEN]
    for omega, alpha, v, v_dot in rng.normal(size=(20, 4, 3)):
        V = pin.Motion(v, omega)
        needed = inertia * pin.Motion(v_dot, alpha) + inertia.vxiv(V)
        ours = newton_euler_regressor(omega[None], alpha[None], (v_dot + np.cross(omega, v))[None])[0] @ theta
        np.testing.assert_allclose(ours, needed.vector, atol=1e-12)


@pytest.mark.parametrize("N", [1, 2, 5])
def test_exact_data_give_exact_parameters(N):
    body = make_body(N, seed=N)
    data = moving(body, 15)
    grasps, _ = estimate_grasps([data])
    estimate, reports = estimate_joint([data], grasps)
    assert all(report.determined for report in reports)
    assert estimate.mass.mass == pytest.approx(body.mass, abs=1e-10)
    np.testing.assert_allclose(estimate.com.p_1c, body.p_1c, atol=1e-11)
    np.testing.assert_allclose(estimate.inertia.inertia, body.inertia, atol=1e-10)


def test_mujoco_inverse_dynamics_give_the_payload_back():
    body = make_body(3)
    data = mujoco_data(body, np.arange(0, 20, 0.05))
    grasps, _ = estimate_grasps([data])
    estimate, _ = estimate_joint([data], grasps)
    assert estimate.mass.mass == pytest.approx(body.mass, abs=1e-6)
    np.testing.assert_allclose(estimate.com.p_1c, body.p_1c, atol=1e-7)
    np.testing.assert_allclose(estimate.inertia.inertia, body.inertia, atol=2e-6)


def test_holds_alone_give_mass_and_centre_of_mass_but_no_inertia():
    body = make_body(3)
    tilts = [(0, 0), (0.08, 0), (0, 0.08)]
    grasps, _ = estimate_grasps([moving(body, 10)])
    # Without the transitions there is no rotation at all, only noise that looks a little like one.
    noise = {"twist_noise": 1e-3, "linear_noise": 2e-4, "wrench_noise": 0.02}
    trials = [still(body, [tilt], **noise) for tilt in tilts]
    estimate, (com, inertia) = estimate_joint(trials, grasps)
    assert com.determined
    assert not inertia.determined
    assert estimate.inertia is None
    assert estimate.mass.mass == pytest.approx(body.mass, abs=5 * estimate.mass.se)
    assert estimate.mass.se < 0.01
    assert np.linalg.norm(estimate.com.p_1c - body.p_1c) < 0.01


def test_one_pose_gives_the_mass_only_and_names_the_direction():
    body = make_body(3)
    grasps, _ = estimate_grasps([moving(body, 10)])
    data = still(body, [(0, 0)], twist_noise=1e-3, wrench_noise=0.02)
    estimate, (com, inertia) = estimate_joint([data], grasps)
    assert estimate.mass.mass == pytest.approx(body.mass, abs=0.01)
    assert estimate.com is None
    assert estimate.inertia is None
    assert [weak.direction for weak in com.weak] == ["along z of {1}"]
    assert not inertia.determined


def test_turning_about_one_axis_leaves_the_inertia_open_and_nothing_else():
    """The moments that such a motion takes belong to its part of the inertia, not to wrong torques."""
    body = make_body(3)
    grasps, _ = estimate_grasps([moving(body, 15)])
    one_axis = moving(body, 15, pose_options={"angle_amplitude": (0.0, 0.0, 0.08)})
    estimate, (com_report, inertia_report) = estimate_joint([one_axis], grasps)
    assert com_report.determined
    assert not inertia_report.determined
    assert estimate.inertia is None
    assert estimate.mass.mass == pytest.approx(body.mass, abs=1e-9)
    np.testing.assert_allclose(estimate.com.p_1c, body.p_1c, atol=1e-8)
    assert estimate.com.residual_rms < 1e-8
    assert estimate.covariance.shape == (4, 4)

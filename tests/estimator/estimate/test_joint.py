"""Joint least squares of the ten inertial parameters: Pinocchio, MuJoCo, exact data, poor motion."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from estimator.errors import InputError
from estimator.estimate.grasps import estimate_grasps
from estimator.estimate.joint import estimate_joint
from estimator.estimate.uncertainty import standard_errors
from estimator.rigid_team import newton_euler_regressor
from mujoco_body import mujoco_data
from rigid_body_data import RATE, make_body, make_data, moving, still

PIN_ORDER = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]


def test_regressor_is_pinocchios():
    rng = np.random.default_rng(0)
    for omega, alpha, v, v_dot in rng.normal(size=(20, 4, 3)):
        Y = pin.bodyRegressor(pin.Motion(v, omega), pin.Motion(v_dot, alpha))[:, PIN_ORDER]
        ours = newton_euler_regressor(omega[None], alpha[None], (v_dot + np.cross(omega, v))[None])[0]
        np.testing.assert_allclose(ours, Y, atol=1e-13)


def test_regressor_times_parameters_is_pinocchios_inverse_dynamics():
    rng = np.random.default_rng(1)
    body = make_body(1)
    inertia = pin.Inertia(body.mass, body.p_1c, body.inertia)
    theta = inertia.toDynamicParameters()[PIN_ORDER]
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


def test_reversed_torques_are_an_error():
    body = make_body(2)
    data = moving(body, 10)
    grasps, _ = estimate_grasps([data])
    data.wrench[:] *= -1
    with pytest.raises(InputError, match=r"mass is -11 kg.*sign of the torques"):
        estimate_joint([data], grasps)


def yawing(body, tilt, seed=0, **noise):
    """Yaw about an axis 0.6 m off {1}, with tilts of that many rad at other frequencies."""
    t = np.arange(round(20 * RATE)) / RATE
    w = 2 * np.pi * np.array([0.37, 0.53, 0.6])
    turn = Rotation.from_euler("xyz", np.sin(np.outer(t, w)) * [tilt, tilt, 0.08])
    step = 1e-4  # derivatives by differences
    near = [np.sin(np.outer(t + k * step, w)) * [tilt, tilt, 0.08] for k in (-1, 0, 1)]
    before, R, after = (Rotation.from_euler("xyz", e) for e in near)
    omega = (before.inv() * after).as_rotvec() / (2 * step)
    alpha = ((R.inv() * after).as_rotvec() - (before.inv() * R).as_rotvec()) / step**2
    pivot = np.array([0.5, -0.3, 0.0])
    places = [pivot - r.apply(pivot) for r in (before, R, after)]
    v, a = (places[2] - places[0]) / (2 * step), (places[2] - 2 * places[1] + places[0]) / step**2
    return make_data(body, (turn.as_matrix(), omega, alpha, places[1], v, a), t, seed=seed, **noise)


def test_a_part_of_the_centre_that_goes_with_the_inertia_is_not_reported():
    """Level yaw about one axis: the height of the centre moves the moments as products of inertia do."""
    body = make_body(3)
    grasps, _ = estimate_grasps([moving(body, 15)])
    estimate, (com, _) = estimate_joint([yawing(body, 0.0)], grasps)
    assert estimate.mass.mass == pytest.approx(body.mass, abs=1e-3)
    assert estimate.com is None
    assert [weak.direction for weak in com.weak] == ["along z of {1}"]


def test_weak_directions_of_the_inertia_are_errors_of_the_centre():
    """Yaw with tilts that show the inertia hardly and the height of the centre a little, 40 times with noise."""
    body = make_body(3)
    grasps, _ = estimate_grasps([moving(body, 15)])
    off, claimed = [], []
    for seed in range(40):
        trial = yawing(body, 4e-4, seed, twist_noise=2e-4, linear_noise=2e-5, wrench_noise=0.02)
        estimate, (com, inertia) = estimate_joint([trial], grasps)
        assert com.determined
        assert not inertia.determined
        off.append(estimate.com.p_1c - body.p_1c)
        claimed.append(standard_errors(estimate.com.covariance[1:, 1:]))
    rms = np.sqrt(np.mean((np.array(off) / claimed) ** 2, axis=0))
    assert np.all((rms > 0.7) & (rms < 1.4)), rms
    assert np.min(claimed, axis=0)[2] > 1e-3


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

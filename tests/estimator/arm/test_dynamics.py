"""Gimbal and inverse dynamics of the arm, against their definitions, Pinocchio and MuJoCo."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from estimator.arm.delta import forward_kinematics, inverse_kinematics, jacobian
from estimator.arm.dynamics import (
    angular_motion,
    arm_torque,
    gimbal_torque,
    moment_about_axes,
    rate_matrix,
    rotation,
    wrench_on_payload,
)
from mujoco_arm import Arm, random_motion
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


def test_moment_about_axes_has_the_given_components_about_them():
    torques = np.array([1.0, -2.0, 0.5]) + 0.1 * ANGLES
    moments = moment_about_axes(ANGLES, torques)
    about = np.einsum("qij,qi->qj", rate_matrix(ANGLES), moments)
    assert about == pytest.approx(torques, abs=1e-12)
    one = moment_about_axes(ANGLES, np.eye(3)[1])  # of all angles at once
    assert np.einsum("qij,qi->qj", rate_matrix(ANGLES), one) == pytest.approx(
        np.tile(np.eye(3)[1], (len(ANGLES), 1))
    )


DRAWS = np.random.default_rng(11)
ZEROS = np.zeros(3)
UP = np.array([0.0, 0.0, 1.0])
SPOKES = [np.array([np.cos(a), np.sin(a), 0.0]) for a in np.deg2rad([0.0, 120.0, 240.0])]


def points(phi):
    """Knees (3, 3) and wrist (3,) of the Delta; the wrist by Newton's method on the rods' lengths."""
    knees = np.array(
        [
            DESIGN.base_radius_m * u + DESIGN.proximal_length_m * (np.cos(p) * u + np.sin(p) * UP)
            for u, p in zip(SPOKES, phi, strict=True)
        ]
    )
    tips = DESIGN.platform_radius_m * np.array(SPOKES)
    h = np.array([0.0, 0.0, 0.5])
    for _ in range(20):
        rods = h + tips - knees
        h = h - np.linalg.solve(2 * rods, np.sum(rods**2, axis=1) - DESIGN.rod_length_m**2)
    return knees, h


def energies_of_masses(phi):
    """Positions and masses of point masses that stand for rods and wrist, and the potential energy.

    A uniform rod's energy is an integral of a quadratic along it: two Gauss points are exact.
    """
    knees, h = points(phi)
    tips = h + DESIGN.platform_radius_m * np.array(SPOKES)
    positions = [knee + s * (tip - knee) for knee, tip in zip(knees, tips, strict=True) for s in GAUSS]
    masses = [DESIGN.rod_mass_kg / 2] * 6 + [DESIGN.wrist_mass_kg]
    return np.array([*positions, h]), np.array(masses)


GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3)


def derivative_along(function, x, direction, step):
    f = [function(x + k * step * direction) for k in (-3, -2, -1, 1, 2, 3)]
    return (-f[0] + 9 * f[1] - 45 * f[2] + 45 * f[3] - 9 * f[4] + f[5]) / (60 * step)


def mass_matrix(phi):
    columns = [derivative_along(lambda p: energies_of_masses(p)[0], phi, e, 2e-3) for e in np.eye(3)]
    masses = energies_of_masses(phi)[1]
    rods_and_wrist = np.array([[np.sum(masses[:, None] * a * b) for a in columns] for b in columns])
    return rods_and_wrist + DESIGN.proximal_inertia_kgm2 * np.eye(3)


def potential(phi):
    positions, masses = energies_of_masses(phi)
    links = DESIGN.proximal_mass_kg * DESIGN.proximal_com_m * np.sum(np.sin(phi))
    return DESIGN.gravity_mps2 * (masses @ positions[:, 2] + links)


def lagrange_torque(phi, phi_dot, phi_ddot):
    """d/dt (dT/dphi_dot) - dT/dphi + dV/dphi, every derivative_along of the energies numerical."""
    m_dot = derivative_along(mass_matrix, phi, phi_dot, 2e-3)
    t_gradient = [
        derivative_along(lambda p: phi_dot @ mass_matrix(p) @ phi_dot / 2, phi, e, 2e-3) for e in np.eye(3)
    ]
    v_gradient = [derivative_along(potential, phi, e, 2e-3) for e in np.eye(3)]
    return mass_matrix(phi) @ phi_ddot + m_dot @ phi_dot - np.array(t_gradient) + np.array(v_gradient)


@pytest.mark.parametrize("trial", range(12))
def test_arm_torque_is_euler_lagrange(trial):
    rng = np.random.default_rng(trial)
    phi = rng.uniform(0.0, 1.2, 3)
    phi_dot, phi_ddot = rng.normal(0, 3, 3), rng.normal(0, 30, 3)
    expected = lagrange_torque(phi, phi_dot, phi_ddot)
    assert arm_torque(phi, phi_dot, phi_ddot, DESIGN) == pytest.approx(expected, abs=1e-7)
    # Every part matters: a test at rest would not see the velocity terms.
    assert np.abs(expected - lagrange_torque(phi, ZEROS, phi_ddot)).max() > 1e-2


def test_arm_at_rest_carries_its_weight():
    """At home by virtual work: all legs alike, so three times tau is the gradient of the potential."""
    phi = inverse_kinematics([0, 0, DESIGN.home_height_m], DESIGN)
    tau = arm_torque(phi, ZEROS, ZEROS, DESIGN)
    run = DESIGN.base_radius_m - DESIGN.platform_radius_m + DESIGN.proximal_length_m * np.cos(phi[0])
    knee_rise = DESIGN.proximal_length_m * np.cos(phi[0])
    # Rod of fixed length, dz of the wrist: z dz = z knee_rise - run d(run).
    z = np.sqrt(DESIGN.rod_length_m**2 - run**2)
    wrist_rise = knee_rise + run * DESIGN.proximal_length_m * np.sin(phi[0]) / z
    weight = DESIGN.gravity_mps2 * np.array(
        [
            DESIGN.proximal_mass_kg * DESIGN.proximal_com_m * np.cos(phi[0]),
            DESIGN.rod_mass_kg * (knee_rise + wrist_rise) / 2,
            DESIGN.wrist_mass_kg * wrist_rise / 3,
        ]
    )
    assert tau == pytest.approx(np.full(3, weight.sum()))


def gimbal_in_pinocchio():
    model = pin.Model()
    model.gravity = pin.Motion.Zero()
    joint = 0
    parts = [
        (pin.JointModelRZ(), DESIGN.yoke_mass_kg, DESIGN.yoke_inertia_kgm2),
        (pin.JointModelRY(), DESIGN.ring_mass_kg, DESIGN.ring_inertia_kgm2),
        (pin.JointModelRX(), DESIGN.flange_mass_kg, DESIGN.flange_inertia_kgm2),
    ]
    for index, (kind, mass, inertia) in enumerate(parts):
        joint = model.addJoint(joint, kind, pin.SE3.Identity(), f"gimbal{index}")
        model.appendBodyToJoint(joint, pin.Inertia(mass, np.zeros(3), np.diag(inertia)), pin.SE3.Identity())
    return model


def random_gimbal_motion(count, limit=DESIGN.gimbal_limit_rad):
    return (
        DRAWS.uniform(-limit, limit, (count, 3)),
        DRAWS.normal(0, 5, (count, 3)),
        DRAWS.normal(0, 50, (count, 3)),
    )


def test_gimbal_torque_is_pinocchios_inverse_dynamics():
    model = gimbal_in_pinocchio()
    data = model.createData()
    motion = random_gimbal_motion(50)
    expected = np.array([pin.rnea(model, data, *state) for state in zip(*motion, strict=True)])
    assert gimbal_torque(*motion, DESIGN) == pytest.approx(expected, abs=1e-15)
    assert np.abs(expected).min(axis=0).max() < np.abs(expected).max()


def test_gimbal_moment_leaves_nothing_for_the_axes():
    """Pinocchio, with the payload's reaction -m applied to the flange: the passive axes feel no torque."""
    model = gimbal_in_pinocchio()
    data = model.createData()
    theta, theta_dot, theta_ddot = random_gimbal_motion(20)
    phi = np.full((20, 3), 0.6)
    still = np.zeros((20, 3))
    wrench = wrench_on_payload((phi, still, still), (theta, theta_dot, theta_ddot), still, DESIGN)
    for k in range(20):
        external = pin.StdVec_Force()
        external.extend([pin.Force.Zero(), pin.Force.Zero(), pin.Force.Zero()])
        external.append(pin.Force(np.zeros(3), -wrench[k, :3]))
        left = pin.rnea(model, data, theta[k], theta_dot[k], theta_ddot[k], external)
        assert left == pytest.approx(np.zeros(3), abs=1e-15)
    assert np.abs(wrench[:, :3]).max() > 1e-3


def test_wrench_moves_its_power_to_the_payload():
    """Spring power minus the growth of the arm's energy is what force and moment deliver at the grasp."""
    s = 1e-3
    phi0, a, b = np.array([0.5, 0.7, 0.6]), np.array([1.0, -2.0, 0.7]), np.array([20.0, 5.0, -9.0])
    theta0, c, d = np.array([0.3, -0.4, 0.5]), np.array([2.0, 3.0, -1.0]), np.array([9.0, -20.0, 7.0])
    tau = np.array([5.0, -2.0, 8.0])

    def energy(t):
        phi, phi_dot = phi0 + t * a + t**2 / 2 * b, a + t * b
        theta, theta_dot = theta0 + t * c + t**2 / 2 * d, c + t * d
        _, y, x = theta
        yoke = np.array([0.0, 0.0, theta_dot[0]])
        ring = Rotation.from_euler("Y", y).inv().apply(yoke) + np.array([0, theta_dot[1], 0])
        flange = Rotation.from_euler("X", x).inv().apply(ring) + np.array([theta_dot[2], 0, 0])
        inertias = DESIGN.yoke_inertia_kgm2, DESIGN.ring_inertia_kgm2, DESIGN.flange_inertia_kgm2
        spin = sum(np.array(i) @ w**2 / 2 for i, w in zip(inertias, (yoke, ring, flange), strict=True))
        return phi_dot @ mass_matrix(phi) @ phi_dot / 2 + potential(phi) + spin

    growth = derivative_along(energy, 0.0, 1.0, s)
    wrench = wrench_on_payload((phi0, a, b), (theta0, c, d), tau, DESIGN)
    h_dot = derivative_along(lambda t: points(phi0 + t * a)[1], 0.0, 1.0, s)
    R = Rotation.from_euler("ZYX", theta0)
    omega = derivative_along(
        lambda t: (R.inv() * Rotation.from_euler("ZYX", theta0 + t * c)).as_rotvec(), 0.0, 1.0, s
    )
    twist = np.concatenate([omega, R.inv().apply(h_dot)])
    assert wrench @ twist == pytest.approx(tau @ a - growth, abs=1e-7)
    assert abs(wrench[:3] @ omega) > 1e-4


def test_static_load_hangs_upward_on_the_robot():
    """Three equal raising torques at home push the payload up, whatever the gimbal's attitude."""
    massless = {
        f"{part}_mass_kg": 1e-12 for part in ("proximal", "rod", "platform", "yoke", "ring", "flange")
    }
    design = dataclasses.replace(DESIGN, **massless)
    phi = inverse_kinematics([0, 0, DESIGN.home_height_m], DESIGN)
    theta = np.array([0.3, -0.5, 0.8])
    still = (ZEROS, ZEROS)
    wrench = wrench_on_payload((phi, *still), (theta, *still), np.full(3, 4.0), design)
    assert wrench[:3] == pytest.approx(ZEROS, abs=1e-15)
    f_b = Rotation.from_euler("ZYX", theta).apply(wrench[3:])
    assert f_b[:2] == pytest.approx([0, 0], abs=1e-9)
    # Power balance of a slow rise: 3 tau dphi = f dz, with dz/dphi from the positions themselves.
    rise = derivative_along(lambda p: points(p)[1][2], phi, np.ones(3), 1e-3)
    assert f_b[2] == pytest.approx(12.0 / rise)


@pytest.fixture(scope="module")
def arm():
    return Arm()


@pytest.mark.parametrize("seed", range(20))
def test_pose_and_jacobian(arm, seed):
    rng = np.random.default_rng(seed)
    phi, theta = random_motion(rng)
    arm.set_motion(phi, theta, rng)
    base, grasp = arm.data.site("base"), arm.data.site("grasp")
    assert base.xmat.reshape(3, 3) == pytest.approx(np.eye(3), abs=1e-15)
    assert grasp.xpos - base.xpos == pytest.approx(forward_kinematics(phi[0], DESIGN), abs=1e-12)
    assert grasp.xmat.reshape(3, 3) == pytest.approx(rotation(theta[0]), abs=1e-12)
    assert arm.site_jacobian("grasp")[0] @ arm.data.qvel == pytest.approx(jacobian(phi[0], DESIGN) @ phi[1])


@pytest.mark.parametrize("seed", range(20))
def test_wrench_on_the_payload(arm, seed):
    rng = np.random.default_rng(100 + seed)
    phi, theta = random_motion(rng)
    arm.set_motion(phi, theta, rng)
    f_b = rng.normal(0, 30, 3)
    tau, m_i = arm.balance(f_b)
    wrench = wrench_on_payload(phi, theta, tau, DESIGN)
    assert wrench[3:] == pytest.approx(rotation(theta[0]).T @ f_b, abs=1e-8)
    assert wrench[:3] == pytest.approx(m_i, abs=1e-11)
    assert np.abs(m_i).max() > 1e-4


def test_gravity_of_the_resting_arm(arm):
    rng = np.random.default_rng(7)
    phi, theta = random_motion(rng)
    still = np.zeros(3), np.zeros(3)
    arm.set_motion((phi[0], *still), (theta[0], *still), rng)
    arm.data.qvel[:], arm.data.qacc[:] = 0, 0
    tau, _ = arm.balance(np.zeros(3))
    wrench = wrench_on_payload((phi[0], *still), (theta[0], *still), tau, DESIGN)
    assert wrench == pytest.approx(np.zeros(6), abs=1e-9)
    assert tau.min() > 0.3

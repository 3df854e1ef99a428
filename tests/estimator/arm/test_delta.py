"""Kinematics of the Delta, and the wrist level that says the same of springs and positions."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from estimator.arm.delta import (
    forward_kinematics,
    inverse_kinematics,
    is_reachable,
    jacobian,
    joints_of,
    leg_geometry,
    wrist_fault,
    wrist_motion,
    wrist_of,
)
from estimator.errors import InputError
from mujoco_arm import Arm, random_motion
from omnid_design import DESIGN

RNG = np.random.default_rng(5)
AZIMUTHS = np.deg2rad([0.0, 120.0, 240.0])


def wrists_in_workspace(count):
    """Random wrist positions, a third of them on the very edge of the commanded sphere."""
    direction = RNG.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    radius = DESIGN.workspace_radius_m * RNG.uniform(0, 1.5, (count, 1)).clip(max=1.0) ** (1 / 3)
    return radius * direction + [0, 0, DESIGN.home_height_m]


def rod_lengths(phi, h):
    """Knee to platform joint, spelled out in Cartesian coordinates leg by leg, shape (3,)."""
    lengths = []
    for azimuth, angle in zip(AZIMUTHS, phi, strict=True):
        u = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        axis = DESIGN.base_radius_m * u
        knee = axis + DESIGN.proximal_length_m * (np.cos(angle) * u + np.sin(angle) * np.array([0, 0, 1]))
        lengths.append(np.linalg.norm(knee - (h + DESIGN.platform_radius_m * u)))
    return np.array(lengths)


HS = wrists_in_workspace(200)
PHIS = inverse_kinematics(HS, DESIGN)


def test_forward_kinematics_gives_every_rod_its_length():
    phis = np.concatenate([PHIS, RNG.uniform(DESIGN.phi_min_rad, DESIGN.phi_max_rad, (300, 3))])
    phis = phis[is_reachable(phis, DESIGN)]
    assert len(phis) > 400
    for phi, h in zip(phis, forward_kinematics(phis, DESIGN), strict=True):
        assert rod_lengths(phi, h) == pytest.approx(np.full(3, DESIGN.rod_length_m), abs=1e-13)


def test_forward_kinematics_takes_the_higher_solution():
    """The lower solution is the mirror image in the plane of the sphere centres."""
    # In the last one, far outside the joints' range, the centres go round the other way.
    phis = np.concatenate([PHIS, [[0.3, 2.6, 2.2]]])
    for phi, h in zip(phis, forward_kinematics(phis, DESIGN), strict=True):
        centres = [
            (DESIGN.base_radius_m - DESIGN.platform_radius_m + DESIGN.proximal_length_m * np.cos(p))
            * np.array([np.cos(a), np.sin(a), 0])
            + [0, 0, DESIGN.proximal_length_m * np.sin(p)]
            for a, p in zip(AZIMUTHS, phi, strict=True)
        ]
        normal = np.cross(centres[1] - centres[0], centres[2] - centres[0])
        normal /= np.linalg.norm(normal)
        mirrored = h - 2 * normal * (normal @ (h - centres[0]))
        assert rod_lengths(phi, mirrored) == pytest.approx(np.full(3, DESIGN.rod_length_m), abs=1e-12)
        assert h[2] > mirrored[2] + 0.01


def test_knees_point_outward():
    """The one of two knees that fit which is farther from the robot's centre line through the leg's plane."""
    below = HS * [1, 1, -1]  # the same with the robot hanging: a mirror image
    assert inverse_kinematics(below, DESIGN) == pytest.approx(-PHIS, abs=1e-12)
    for phi, h in zip(PHIS, HS, strict=True):
        for azimuth, angle in zip(AZIMUTHS, phi, strict=True):
            u = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
            reach = h + DESIGN.platform_radius_m * u - DESIGN.base_radius_m * u
            # The other knee mirrors this one in the line from the driven axis to the platform joint.
            line = np.arctan2(reach[2], reach @ u)
            other = 2 * line - angle
            assert np.cos(angle) > np.cos(other)


def differences(function, x, step):
    """Fourth-order central differences of function along each axis of x, shape (..., outputs, 3)."""
    columns = []
    for axis in np.eye(3):
        f = [function(x + k * step * axis) for k in (-2, -1, 1, 2)]
        columns.append((f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step))
    return np.stack(columns, axis=-1)


def test_jacobian_is_the_derivative_of_forward_kinematics():
    numerical = differences(lambda phi: forward_kinematics(phi, DESIGN), PHIS, 1e-3)
    assert jacobian(PHIS, DESIGN) == pytest.approx(numerical, abs=2e-8)


def test_wrist_motion_is_the_derivative_along_a_path():
    rates, accelerations = RNG.normal(0, 2, PHIS.shape), RNG.normal(0, 20, PHIS.shape)

    def h(s):
        return forward_kinematics(PHIS + s * rates + s**2 / 2 * accelerations, DESIGN)

    velocity, acceleration = wrist_motion(leg_geometry(PHIS, DESIGN), rates, accelerations)
    e = 1e-3
    f = [h(k * e) for k in (-2, -1, 0, 1, 2)]
    assert velocity == pytest.approx((f[0] - 8 * f[1] + 8 * f[3] - f[4]) / (12 * e), abs=2e-7)
    numerical = (-f[0] + 16 * f[1] - 30 * f[2] + 16 * f[3] - f[4]) / (12 * e**2)
    assert acceleration == pytest.approx(numerical, abs=2e-4)
    assert np.abs(acceleration).max() > 5.0


def test_forces_at_the_wrist_and_driven_torques_follow_the_jacobian():
    """By virtual work: tau = (dh/dphi)^T f, and back."""
    legs, force = leg_geometry(PHIS, DESIGN), RNG.normal(0, 30, PHIS.shape)
    torque = np.einsum("qij,qi->qj", jacobian(PHIS, DESIGN), force)
    assert legs.along_rods(force) == pytest.approx(torque, abs=1e-11)
    assert legs.at_wrist(torque) == pytest.approx(force, abs=1e-10)


def test_leverage_vanishes_where_the_leg_is_stretched():
    """With knee, driven axis and platform joint in line, raising the knee cannot lengthen the leg."""
    direction = np.deg2rad(110.0)
    axis = np.array([DESIGN.base_radius_m - DESIGN.platform_radius_m, 0.0, 0.0])
    reach = DESIGN.proximal_length_m + DESIGN.rod_length_m - 1e-9
    h = axis + reach * np.array([np.cos(direction), 0.0, np.sin(direction)])
    phi = inverse_kinematics(h, DESIGN)
    assert phi[0] == pytest.approx(direction, abs=1e-3)
    legs = leg_geometry(phi, DESIGN)
    l1_l2 = DESIGN.proximal_length_m * DESIGN.rod_length_m
    assert legs.leverage[0] == pytest.approx(0.0, abs=1e-3 * l1_l2)
    assert np.all(legs.leverage[1:] > 0.01 * l1_l2)


def test_rods_that_cannot_meet_are_refused_with_their_angles():
    short = dataclasses.replace(DESIGN, rod_length_m=0.25)
    phi = np.array([[1.4, 1.4, 1.4], [0.1, 0.2, 0.3]])
    assert is_reachable(phi, short).tolist() == [True, False]
    with pytest.raises(InputError, match=r"no wrist position .* phi = \(0\.1, 0\.2, 0\.3\) rad"):
        forward_kinematics(phi, short)
    with pytest.raises(InputError, match="no wrist position"):
        forward_kinematics([np.nan, 0.6, 0.6], DESIGN)


@pytest.mark.parametrize("h", [[0.0, 0.0, 0.7], [0.9, 0.0, 0.3], [np.nan, 0, 0.3]])
def test_unreachable_wrists_are_refused_with_leg_and_position(h):
    with pytest.raises(InputError, match=r"leg [123] cannot reach the wrist position \(.*\) m"):
        inverse_kinematics(h, DESIGN)


HOME_Z = DESIGN.home_height_m


@pytest.fixture(scope="module")
def arm() -> Arm:
    return Arm()


@pytest.fixture(scope="module")
def weightless() -> Arm:
    """An arm that weighs nothing once it does not move: the springs' torques are all for the wrist."""
    arm = Arm()
    arm.model.opt.gravity[:] = 0.0
    return arm


def anywhere(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Driven angles all over their range and torques up to their limit."""
    rng = np.random.default_rng(seed)
    phi = rng.uniform(DESIGN.phi_min_rad, DESIGN.phi_max_rad, (count, 3))
    return phi, rng.uniform(-DESIGN.torque_limit_Nm, DESIGN.torque_limit_Nm, (count, 3))


# The formulas


@pytest.mark.parametrize("seed", range(10))
def test_the_force_is_mujocos_static_equilibrium(weightless: Arm, seed: int) -> None:
    rng, still = np.random.default_rng(seed), (np.zeros(3), np.zeros(3))
    (phi, *_), (theta, *_) = random_motion(rng)
    weightless.set_motion((phi, *still), (theta, *still), rng)
    weightless.data.qvel[:], weightless.data.qacc[:] = 0.0, 0.0
    f_b = rng.normal(0.0, 30.0, 3)
    tau, _ = weightless.balance(f_b)
    h, force = wrist_of(phi, tau, DESIGN)
    assert force == pytest.approx(f_b, abs=1e-9)
    assert h == pytest.approx(
        weightless.data.site("grasp").xpos - weightless.data.site("base").xpos, abs=1e-12
    )
    back_phi, back_tau = joints_of(h, f_b, DESIGN)
    assert back_phi == pytest.approx(phi, abs=1e-12)
    assert back_tau == pytest.approx(tau, abs=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_power_goes_through_the_wrist_of_mujocos_chain(arm: Arm, seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    phi, theta = random_motion(rng)
    arm.set_motion(phi, theta, rng)
    h_dot = arm.site_jacobian("grasp")[0] @ arm.data.qvel
    tau = rng.normal(0.0, 5.0, 3)
    _, force = wrist_of(phi[0], tau, DESIGN)
    assert force @ h_dot == pytest.approx(tau @ phi[1], abs=1e-11)


def test_round_trip() -> None:
    phi, tau = (array.reshape(50, 10, 4, 3) for array in anywhere(2000, seed=3))
    h, force = wrist_of(phi, tau, DESIGN)
    assert h.shape == force.shape == phi.shape
    back_phi, back_tau = joints_of(h, force, DESIGN)
    assert np.abs(back_phi - phi).max() < 1e-12
    assert np.abs(back_tau - tau).max() < 1e-12 * np.abs(force).max()
    assert wrist_of(np.zeros((0, 3)), np.zeros((0, 3)), DESIGN)[0].shape == (0, 3)
    assert joints_of(np.zeros((0, 3)), np.zeros((0, 3)), DESIGN)[1].shape == (0, 3)


# What has no driven angles


def stretched(gap: float) -> np.ndarray:
    """Leg 1 in line up to ``gap`` [m], pointing 110 deg up from outward."""
    axis = np.array([DESIGN.base_radius_m - DESIGN.platform_radius_m, 0.0, 0.0])
    reach = DESIGN.proximal_length_m + DESIGN.rod_length_m - gap
    return axis + reach * np.array([np.cos(np.deg2rad(110.0)), 0.0, np.sin(np.deg2rad(110.0))])


@pytest.mark.parametrize(
    ("h", "words"),
    [
        ([0.0, 0.0, 0.7], "leg 1 cannot reach the wrist position (0, 0, 0.7) m"),
        ([0.0, 0.5, 0.3], "cannot reach the wrist position (0, 0.5, 0.3) m"),
        ([np.nan, 0.0, 0.3], "cannot reach the wrist position (nan, 0, 0.3) m"),
        ([0.0, 0.0, np.inf], "leg 1 cannot reach"),
        ([1e300, 0.0, 0.3], "leg 1 cannot reach"),
        # The wrist on a driven axis: its direction from there is undefined.
        ([DESIGN.base_radius_m - DESIGN.platform_radius_m, 0.0, 0.0], "leg 1 cannot reach"),
        ([0.0, 0.0, -HOME_Z], "lies below the arm"),
        (stretched(1e-12), "the arm is singular at the wrist position"),
    ],
)
def test_wrist_positions_without_driven_angles(h: list[float], words: str) -> None:
    good = np.array([0.0, 0.0, HOME_Z])
    many = np.stack([[good, good], [good, np.array(h)], [np.array(h), good]])
    fault = wrist_fault(many, DESIGN)
    assert fault is not None
    assert fault[0] == (1, 1)
    assert words in fault[1]
    with pytest.raises(InputError) as caught:
        joints_of(many, np.zeros_like(many), DESIGN)
    assert str(caught.value) == fault[1]


def test_driven_angles_without_a_wrist_position() -> None:
    short = dataclasses.replace(DESIGN, rod_length_m=0.25)
    with pytest.raises(InputError, match=r"no wrist position reaches .* phi = \(0\.1, 0\.2, 0\.3\) rad"):
        wrist_of([[1.4, 1.4, 1.4], [0.1, 0.2, 0.3]], np.zeros((2, 3)), short)
    with pytest.raises(InputError, match=r"no wrist position .* phi = \(nan, 0\.2, 0\.3\) rad"):
        wrist_of([np.nan, 0.2, 0.3], np.zeros(3), DESIGN)
    with pytest.raises(
        InputError, match=r"a leg is folded past its stretched position at phi = \(3, 0\.6, 0\.6\) rad"
    ):
        wrist_of([3.0, 0.6, 0.6], np.zeros(3), DESIGN)
    long = dataclasses.replace(DESIGN, base_radius_m=0.113, rod_length_m=0.6614)
    with pytest.raises(InputError, match="the wrist lies below the driven axes at phi"):
        wrist_of([2.795, 2.5894, -1.4641], np.zeros(3), long)
    with pytest.raises(InputError, match="the arm is singular at phi"):
        wrist_of(
            inverse_kinematics(stretched(1e-12), DESIGN) - 1e-7 * np.array([1, 0, 0]), np.zeros(3), DESIGN
        )

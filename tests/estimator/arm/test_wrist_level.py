"""Wrist level against MuJoCo's compiled arm, power and finite differences."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from estimator.arm.delta import (
    driven_motion,
    forward_kinematics,
    inverse_kinematics,
    is_in_reach,
    joints_of,
    leg_geometry,
    wrist_fault,
    wrist_of,
)
from estimator.errors import InputError
from mujoco_arm import Arm, random_motion
from omnid_design import DESIGN

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


def test_power_by_finite_differences_all_over_the_joints_range() -> None:
    phi, tau = anywhere(500, seed=1)
    rate = np.random.default_rng(2).normal(size=phi.shape)
    step = 1e-3
    h = [forward_kinematics(phi + k * step * rate, DESIGN) for k in (-2, -1, 1, 2)]
    h_dot = (h[0] - 8 * h[1] + 8 * h[2] - h[3]) / (12 * step)
    power = np.sum(tau * rate, axis=-1)
    assert np.sum(wrist_of(phi, tau, DESIGN)[1] * h_dot, axis=-1) == pytest.approx(power, abs=1e-6)
    assert np.abs(power).max() > 20.0


def test_round_trip() -> None:
    phi, tau = (array.reshape(50, 10, 4, 3) for array in anywhere(2000, seed=3))
    h, force = wrist_of(phi, tau, DESIGN)
    assert h.shape == force.shape == phi.shape
    back_phi, back_tau = joints_of(h, force, DESIGN)
    assert np.abs(back_phi - phi).max() < 1e-12
    assert np.abs(back_tau - tau).max() < 1e-12 * np.abs(force).max()
    assert wrist_of(np.zeros((0, 3)), np.zeros((0, 3)), DESIGN)[0].shape == (0, 3)
    assert joints_of(np.zeros((0, 3)), np.zeros((0, 3)), DESIGN)[1].shape == (0, 3)


def test_driven_motion_of_a_wrist_along_a_path() -> None:
    """By fourth-order differences of inverse kinematics alone."""
    rng = np.random.default_rng(6)
    h = np.array([0.0, 0.0, HOME_Z]) + rng.uniform(-0.07, 0.07, (50, 3))
    velocity, acceleration = rng.normal(0.0, 0.3, h.shape), rng.normal(0.0, 2.0, h.shape)
    step = 1e-3
    phi = [
        inverse_kinematics(h + t * velocity + t**2 / 2 * acceleration, DESIGN)
        for t in step * np.arange(-2, 3)
    ]
    rate, rate_dot = driven_motion(leg_geometry(phi[2], DESIGN), velocity, acceleration)
    assert rate == pytest.approx((phi[0] - 8 * phi[1] + 8 * phi[3] - phi[4]) / (12 * step), abs=1e-8)
    second = (-phi[0] + 16 * phi[1] - 30 * phi[2] + 16 * phi[3] - phi[4]) / (12 * step**2)
    assert rate_dot == pytest.approx(second, abs=1e-6)
    assert np.abs(second).max() > 10.0


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


def test_only_the_singular_posture_is_refused_not_its_neighbours() -> None:
    h = stretched(1e-5)
    phi, _ = joints_of(h, np.zeros(3), DESIGN)
    assert forward_kinematics(phi, DESIGN) == pytest.approx(h, abs=1e-12)


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


def test_rods_that_lie_flat_are_singular() -> None:
    """All three in one plane: they cannot carry a load across it."""
    phi = np.full(3, 0.6)
    radius = DESIGN.base_radius_m - DESIGN.platform_radius_m + DESIGN.proximal_length_m * np.cos(0.6)
    for longer, flat in ((1e-12, True), (1e-4, False)):
        design = dataclasses.replace(DESIGN, rod_length_m=radius + longer)
        if flat:
            with pytest.raises(InputError, match=r"the arm is singular at phi = \(0\.6, 0\.6, 0\.6\) rad"):
                wrist_of(phi, np.ones(3), design)
        else:
            assert joints_of(*wrist_of(phi, np.ones(3), design), design)[1] == pytest.approx(np.ones(3))
    exactly = dataclasses.replace(DESIGN, rod_length_m=radius)
    with pytest.raises(InputError, match="the arm is singular at the wrist position"):
        joints_of([0.0, 0.0, DESIGN.proximal_length_m * np.sin(0.6)], np.zeros(3), exactly)


def test_reach_says_which_leg() -> None:
    assert is_in_reach([[0.0, 0.0, HOME_Z], [0.25, 0.0, 0.45]], DESIGN).tolist() == [
        [True] * 3,
        [True, False, False],
    ]

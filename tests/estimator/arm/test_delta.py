import dataclasses

import numpy as np
import pytest

from estimator.arm.delta import (
    forward_kinematics,
    inverse_kinematics,
    is_reachable,
    jacobian,
    leg_geometry,
    wrist_motion,
)
from estimator.errors import InputError
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


def test_home_is_at_36_degrees():
    phi = inverse_kinematics([0, 0, DESIGN.home_height_m], DESIGN)
    # In the leg's plane: (r + L1 cos phi)^2 + (z - L1 sin phi)^2 = L2^2, solved by hand.
    r, z = DESIGN.base_radius_m - DESIGN.platform_radius_m, DESIGN.home_height_m
    l1, l2 = DESIGN.proximal_length_m, DESIGN.rod_length_m
    assert (r + l1 * np.cos(phi)) ** 2 + (z - l1 * np.sin(phi)) ** 2 == pytest.approx(np.full(3, l2**2))
    assert np.rad2deg(phi) == pytest.approx(np.full(3, 35.7), abs=0.1)


def test_inverse_kinematics_is_the_inverse():
    assert forward_kinematics(PHIS, DESIGN) == pytest.approx(HS, abs=1e-13)


def test_knees_point_outward():
    """Of the two knees that fit, the one farther from the robot's centre line through the leg's plane."""
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


def test_a_raised_knee_raises_the_wrist():
    h_low, h_high = forward_kinematics([[0.5, 0.5, 0.5], [0.6, 0.6, 0.6]], DESIGN)
    assert h_high[2] > h_low[2] + 0.01
    assert h_high[:2] == pytest.approx([0, 0], abs=1e-15)


def test_leg_one_lies_along_x():
    """Raising knee 1 alone moves the wrist in the leg's own plane, up and away from that leg."""
    h = forward_kinematics([0.8, 0.6, 0.6], DESIGN) - forward_kinematics([0.6, 0.6, 0.6], DESIGN)
    assert h[1] == pytest.approx(0.0, abs=1e-15)
    assert h[0] < -0.005
    turned = forward_kinematics([0.6, 0.8, 0.6], DESIGN) - forward_kinematics([0.6, 0.6, 0.6], DESIGN)
    assert np.arctan2(turned[1], turned[0]) == pytest.approx(np.deg2rad(120 - 180))


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


def test_jacobian_where_the_rods_lie_almost_flat():
    """Next to the limit of intersection the derivatives grow; smaller steps, the same agreement."""
    phi = np.array([0.6, 0.6, 0.6])
    design = dataclasses.replace(DESIGN, rod_length_m=0.2835)
    assert is_reachable(phi, design)
    h = forward_kinematics(phi, design)
    assert h[2] - DESIGN.proximal_length_m * np.sin(0.6) < 0.02
    numerical = differences(lambda p: forward_kinematics(p, design), phi, 2e-6)
    assert jacobian(phi, design) == pytest.approx(numerical, rel=1e-5, abs=1e-5)
    assert np.abs(numerical).max() > 0.7


def test_jacobian_at_home_has_the_known_singular_values():
    """From the symmetric closed form: vertical L1 cos(phi) (tan-free) and horizontal sensitivities."""
    phi = inverse_kinematics([0, 0, DESIGN.home_height_m], DESIGN)
    values = np.linalg.svd(jacobian(phi, DESIGN), compute_uv=False)
    # One leg's constraint: -(r dr-component) ... rod (x, z), knee direction (-s, c): x dr + z dz = q dphi.
    x = -(DESIGN.base_radius_m - DESIGN.platform_radius_m + DESIGN.proximal_length_m * np.cos(phi[0]))
    z = DESIGN.home_height_m - DESIGN.proximal_length_m * np.sin(phi[0])
    q = DESIGN.proximal_length_m * (-x * np.sin(phi[0]) + z * np.cos(phi[0]))
    horizontal, vertical = q * np.sqrt(2 / 3) / -x, q / (np.sqrt(3) * z)
    assert values == pytest.approx(sorted([horizontal, horizontal, vertical], reverse=True))


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


def test_shapes_follow_the_input():
    phi = PHIS[:24].reshape(2, 3, 4, 3)
    assert forward_kinematics(phi, DESIGN).shape == (2, 3, 4, 3)
    assert jacobian(phi, DESIGN).shape == (2, 3, 4, 3, 3)
    assert jacobian(phi, DESIGN)[1, 2, 3] == pytest.approx(jacobian(phi[1, 2, 3], DESIGN), abs=1e-15)
    assert is_reachable(phi, DESIGN).shape == (2, 3, 4)
    assert forward_kinematics(np.zeros((0, 3)), DESIGN).shape == (0, 3)


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

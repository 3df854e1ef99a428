"""Kinematics of the three-legged Delta: forward and inverse kinematics, and derivatives of the wrist position.

Leg k lies at azimuth 0, 120, 240 deg. u_k is the horizontal unit vector of the leg, and z points up. The platform only
translates, so every platform joint can be shifted onto the wrist. The rods then become three spheres |h - c_k(phi_k)|
= rod_length about c_k = (base_radius - platform_radius + L1 cos phi_k) u_k + L1 sin phi_k z. Everything here follows
from that constraint; docs/method-arm.md has the derivation. Lengths may differ between legs.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import Arms
from estimator.arrays import Array, apart, matrices
from estimator.errors import InputError
from estimator.so3 import cross, times

# Exact values: the floating-point cos(2 pi / 3) is off by 2e-16, which would break the legs' symmetry.
_HALF_SQRT_3 = np.sqrt(3.0) / 2.0
LEG_DIRECTIONS: Array = np.array([[1.0, 0.0, 0.0], [-0.5, _HALF_SQRT_3, 0.0], [-0.5, -_HALF_SQRT_3, 0.0]])
_Z: Array = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class LegGeometry:
    """Rods and knees of one Delta at given driven angles; vectors in {b}, axis -2 is the leg.

    Attributes:
        h: wrist position [m], shape (..., 3).
        rod: wrist minus sphere centre, that is platform joint minus knee [m], shape (..., 3, 3).
        knee_d1: derivative of the knee position with respect to phi_k [m/rad], shape (..., 3, 3).
        knee_d2: second derivative [m/rad^2], shape (..., 3, 3).
        leverage: rod . knee_d1 [m^2/rad], shape (..., 3); positive while the knee points outward, zero if proximal
            link and rod are in line (singular).
    """

    h: Array
    rod: Array
    knee_d1: Array
    knee_d2: Array
    leverage: Array

    @cached_property
    def across_rods(self) -> Array:
        """Displacement of the wrist per rod_k . dh_k: inverse of the rod matrix [1/m], shape (..., 3, 3)."""
        return apart(np.asarray(np.linalg.inv(self.rod), dtype=np.float64), 2)

    def along_rods(self, force: Array) -> Array:
        """Return the driven torques [N m] of a force at the wrist in {b} [N]: (dh/dphi)^T force, shape (..., 3)."""
        return self.leverage * times(np.swapaxes(self.across_rods, -1, -2), force)

    def at_wrist(self, torque: Array) -> Array:
        """Return the wrist force in {b} [N] of driven torques [N m]: (dh/dphi)^-T torque, shape (..., 3)."""
        return times(np.swapaxes(self.rod, -1, -2), torque / self.leverage)


def forward_kinematics(phi: ArrayLike, design: Arms) -> Array:
    """Return the wrist position h(phi) in {b} [m], shape (..., 3): equation (28), the higher of the two solutions.

    Driven angles phi [rad] have shape (..., 3); 0 is horizontal outward, positive raises the knee.

    Raises:
        InputError: the three spheres of the rods do not intersect at some configuration.
    """
    phi = np.asarray(phi, dtype=float)
    return _wrist(phi, *_sphere_intersection(_sphere_centres(phi, design), design))


def _wrist(phi: Array, foot: Array, normal: Array, square: Array) -> Array:
    """Return the wrist position from the result of ``_sphere_intersection``; errors as in ``forward_kinematics``."""
    if not np.all(square > 0):
        where = np.unravel_index(np.argmin(square > 0), square.shape)
        angles = ", ".join(f"{value:.4g}" for value in phi[where])
        raise InputError(f"no wrist position reaches all three rods at phi = ({angles}) rad")
    return foot + np.sqrt(square)[..., None] * normal


def is_reachable(phi: ArrayLike, design: Arms) -> NDArray[np.bool_]:
    """Whether a wrist position exists for driven angles ``phi`` [rad], shape (..., 3) -> (...)."""
    return _sphere_intersection(_sphere_centres(np.asarray(phi, dtype=float), design), design)[2] > 0


def stretches(phi: ArrayLike, design: Arms) -> tuple[NDArray[np.bool_], Array]:
    """Return ``is_reachable`` and the legs' leverage (..., 3), which is valid only if the wrist position exists."""
    phi = np.asarray(phi, dtype=float)
    centres = _sphere_centres(phi, design)
    foot, normal, square = _sphere_intersection(centres, design)
    h = foot + np.sqrt(np.maximum(square, 0.0))[..., None] * normal
    return square > 0, _legs(phi, h, centres, design).leverage


def leg_geometry(phi: ArrayLike, design: Arms) -> LegGeometry:
    """Return the wrist, rods and knee derivatives at driven angles ``phi`` [rad], shape (..., 3).

    Raises:
        InputError: the three spheres of the rods do not intersect at some configuration.
    """
    phi = np.asarray(phi, dtype=float)
    centres = _sphere_centres(phi, design)
    h = _wrist(phi, *_sphere_intersection(centres, design))
    return _legs(phi, h, centres, design)


def _legs(phi: Array, h: Array, centres: Array, design: Arms) -> LegGeometry:
    cos, sin = np.cos(phi), np.sin(phi)
    rod, proximal = h[..., None, :] - centres, np.asarray(design.proximal_length_m)[..., None]
    knee_d1, knee_d2 = proximal * _in_leg_planes(-sin, cos), -proximal * _in_leg_planes(cos, sin)
    return LegGeometry(h, rod, knee_d1, knee_d2, np.sum(rod * knee_d1, axis=-1))


def jacobian(phi: ArrayLike, design: Arms) -> Array:
    """Return dh/dphi [m/rad], shape (..., 3, 3): rows x, y, z of {b}, columns phi_1..3.

    Raises:
        InputError: the three spheres of the rods do not intersect at some configuration.
    """
    return jacobian_of(leg_geometry(phi, design))


def jacobian_of(legs: LegGeometry) -> Array:
    """Return dh/dphi [m/rad], shape (..., 3, 3), from rod_k . dh = leverage_k dphi_k."""
    return np.asarray(legs.across_rods * legs.leverage[..., None, :])


def length_jacobians(legs: LegGeometry, phi: ArrayLike, design: Arms) -> tuple[Array, Array, Array]:
    """Return derivatives of h by each leg's radius, proximal length and rod length, shape (..., 3, 3) each.

    They follow from rod_k . (dh - dc_k) = rod_length_k d(rod_length_k). Rows are x, y, z of {b}, columns are legs.
    ``legs`` is the geometry at the driven angles phi [rad], shape (..., 3).
    """
    phi = np.asarray(phi, dtype=float)
    along = np.cos(phi)[..., None] * LEG_DIRECTIONS + np.sin(phi)[..., None] * _Z
    inverse = legs.across_rods
    length = np.broadcast_to(np.asarray(design.rod_length_m, dtype=np.float64), phi.shape)
    by_radius: Array = inverse * np.sum(legs.rod * LEG_DIRECTIONS, axis=-1)[..., None, :]
    by_proximal: Array = inverse * np.sum(legs.rod * along, axis=-1)[..., None, :]
    return by_radius, by_proximal, inverse * length[..., None, :]


def wrist_motion(legs: LegGeometry, phi_dot: ArrayLike, phi_ddot: ArrayLike) -> tuple[Array, Array]:
    """Return velocity [m/s] and acceleration [m/s^2] of the wrist in {b}, each of shape (..., 3).

    Differentiating the constraint twice gives rod_k . h_ddot = leverage_k phi_ddot_k + rod_k . knee_d2_k phi_dot_k^2 -
    |d(rod_k)/dt|^2. Driven rates are in [rad/s] and accelerations in [rad/s^2], shape (..., 3).
    """
    phi_dot, phi_ddot = np.asarray(phi_dot, dtype=float), np.asarray(phi_ddot, dtype=float)
    h_dot = times(legs.across_rods, legs.leverage * phi_dot)
    rod_dot = h_dot[..., None, :] - legs.knee_d1 * phi_dot[..., None]
    curvature = np.sum(legs.rod * legs.knee_d2, axis=-1) * phi_dot**2 - np.sum(rod_dot**2, axis=-1)
    return h_dot, times(legs.across_rods, legs.leverage * phi_ddot + curvature)


def inverse_kinematics(h: ArrayLike, design: Arms) -> Array:
    """Return driven angles phi(h) [rad] with every knee outward, from wrist positions in {b} [m], shape (..., 3).

    Raises:
        InputError: a leg is too long or too short for some position.
    """
    h = np.asarray(h, dtype=float)
    outward, up, cosine = _leg_triangles(h, design)
    outside = ~(np.abs(cosine) <= 1.0)
    if np.any(outside):
        *where, leg = np.unravel_index(np.argmax(outside), outside.shape)
        position = ", ".join(f"{value:.4g}" for value in h[tuple(where)])
        raise InputError(f"leg {int(leg) + 1} cannot reach the wrist position ({position}) m")
    # The outward knee lies clockwise of the line to the wrist if that line points up, else counter-clockwise.
    return np.arctan2(up, outward) - np.copysign(np.arccos(cosine), up)


def is_in_reach(h: ArrayLike, design: Arms) -> NDArray[np.bool_]:
    """Return whether each leg reaches the wrist position ``h`` in {b} [m], shape (..., 3) -> (..., 3)."""
    return np.abs(_leg_triangles(np.asarray(h, dtype=float), design)[2]) <= 1.0


def _leg_triangles(h: Array, design: Arms) -> tuple[Array, Array, Array]:
    """Return the wrist from each driven axis, outward and up [m], and the cosine of the angle there, (..., 3)."""
    l1, l2 = design.proximal_length_m, design.rod_length_m
    # On the driven axis itself, or at infinity, the cosine is not finite: out of reach.
    with np.errstate(all="ignore"):
        # The platform joint is shifted onto the wrist.
        reach = h[..., None, :] - np.asarray(design.radius_m)[..., None] * LEG_DIRECTIONS
        outward, up = np.sum(reach * LEG_DIRECTIONS, axis=-1), reach[..., 2]
        distance = np.hypot(outward, up)
        return outward, up, (l1**2 + np.sum(reach**2, axis=-1) - l2**2) / (2.0 * l1 * distance)


def _sphere_centres(phi: Array, design: Arms) -> Array:
    radius = design.radius_m + design.proximal_length_m * np.cos(phi)
    return _in_leg_planes(radius, design.proximal_length_m * np.sin(phi))


def _in_leg_planes(outward: Array, up: Array) -> Array:
    """Return the vectors outward u_k + up z of the three legs, shapes (..., 3) -> (..., 3, 3)."""
    return matrices([
        [outward[..., k] * x, outward[..., k] * y, up[..., k]] for k, (x, y, _) in enumerate(LEG_DIRECTIONS)
    ])  # fmt: skip


def _sphere_intersection(centres: Array, design: Arms) -> tuple[Array, Array, Array]:
    """Return the foot of the wrist on the plane of sphere centres, its upward unit normal, and the squared height."""
    rod = np.asarray(design.rod_length_m)
    a, b = centres[..., 1, :] - centres[..., 0, :], centres[..., 2, :] - centres[..., 0, :]
    normal = cross(a, b)
    normal_square = np.sum(normal**2, axis=-1, keepdims=True)
    a_square, b_square = np.sum(a**2, axis=-1, keepdims=True), np.sum(b**2, axis=-1, keepdims=True)
    if rod.ndim:  # unequal radii shift the radical plane of two spheres off the middle
        a_square = a_square + (rod[..., :1] ** 2 - rod[..., 1:2] ** 2)
        b_square = b_square + (rod[..., :1] ** 2 - rod[..., 2:] ** 2)
        rod = rod[..., 0]
    offset = cross(a_square * b - b_square * a, normal) / (2.0 * normal_square)
    upward = normal / np.sqrt(normal_square) * np.where(normal[..., 2:] < 0, -1.0, 1.0)
    return centres[..., 0, :] + offset, upward, rod**2 - np.sum(offset**2, axis=-1)


MAX_CONDITION = 1e4
"""Condition number of dh/dphi above which the arm counts as singular. It stays below 20 within the Omnid's joint
limits. At the bound, rounding errors grow from 1e-16 to 1e-12."""
_SAME_M = 1e-6  # wrist positions closer than this are equal


def wrist_of(phi: ArrayLike, tau: ArrayLike, design: OmnidDesign) -> tuple[Array, Array]:
    """Convert joint level to wrist level: wrist position h [m] and spring force on the wrist [N] in {b}, (..., 3).

    By virtual work, tau . phi_dot = force . h_dot, so force = (dh/dphi)^-T tau (paper, section IV.B, for an arm
    without mass). The force still includes weight and inertia of the arm. The conversion is exact both ways.

    Args:
        phi: driven angles [rad], shape (..., 3).
        tau: spring torques on the proximal links, positive raising them [N m], shape (..., 3).
        design: design parameters of the robot.

    Raises:
        InputError: at some configuration the rods cannot meet, a leg is past its stretched position, the wrist is not
            above the driven axes, or the arm is singular.
    """
    phi, tau = np.asarray(phi, dtype=float), np.asarray(tau, dtype=float)
    legs = leg_geometry(phi, design)  # raises if no wrist position exists
    faults = {
        "a leg is folded past its stretched position": np.any(legs.leverage <= 0.0, axis=-1),
        "the wrist lies below the driven axes": legs.h[..., 2] <= 0.0,
        "the arm is singular": _is_singular(legs),
    }
    for fault, bad in faults.items():
        if np.any(bad):
            where = phi[np.unravel_index(np.argmax(bad), bad.shape)]
            raise InputError(f"{fault} at phi = ({_numbers(where)}) rad")
    # rod_k . h_dot = leverage_k phi_dot_k: leg k pushes along its rod with tau_k / leverage_k.
    force = np.sum(legs.rod * (tau / legs.leverage)[..., None], axis=-2)
    return legs.h, force


def joints_of(h: ArrayLike, force: ArrayLike, design: OmnidDesign) -> tuple[Array, Array]:
    """Return driven angles [rad] and spring torques [N m], shape (..., 3) each: the inverse of ``wrist_of``.

    Raises:
        InputError: ``wrist_of`` does not return some position (see ``wrist_fault``).
    """
    h, force = np.asarray(h, dtype=float), np.asarray(force, dtype=float)
    if (fault := wrist_fault(h, design)) is not None:
        raise InputError(fault[1])
    phi = inverse_kinematics(h, design)
    legs = leg_geometry(phi, design)
    return phi, legs.along_rods(force)


def driven_motion(legs: LegGeometry, h_dot: ArrayLike, h_ddot: ArrayLike) -> tuple[Array, Array]:
    """Invert ``wrist_motion``: driven rates [rad/s] and accelerations [rad/s^2], valid if no leg is stretched."""
    h_dot, h_ddot = np.asarray(h_dot, dtype=float), np.asarray(h_ddot, dtype=float)
    phi_dot = np.einsum("...kj,...j->...k", legs.rod, h_dot) / legs.leverage
    rod_dot = h_dot[..., None, :] - legs.knee_d1 * phi_dot[..., None]
    curvature = np.sum(legs.rod * legs.knee_d2, axis=-1) * phi_dot**2 - np.sum(rod_dot**2, axis=-1)
    return phi_dot, (np.einsum("...kj,...j->...k", legs.rod, h_ddot) - curvature) / legs.leverage


def wrist_fault(h: ArrayLike, design: OmnidDesign) -> tuple[tuple[int, ...], str] | None:
    """Find the first wrist position in {b} [m], shape (..., 3), without driven angles; None if all have them.

    Returns:
        Its index in the leading axes, and a sentence that describes the fault.
    """
    h = np.asarray(h, dtype=float)
    within = is_in_reach(h, design)
    if (index := _first(~np.all(within, axis=-1))) is not None:
        leg = int(np.argmin(within[index])) + 1
        return index, f"leg {leg} cannot reach the wrist position ({_numbers(h[index])}) m"
    phi = inverse_kinematics(h, design)
    # The spheres about the knees meet at the position itself; the arm is singular if they only touch.
    if (index := _first(~is_reachable(phi, design))) is not None:
        return index, f"the arm is singular at the wrist position ({_numbers(h[index])}) m"
    legs = leg_geometry(phi, design)
    below = (h[..., 2] <= 0.0) | np.any(np.abs(legs.h - h) > _SAME_M, axis=-1)
    if (index := _first(below)) is not None:
        return index, f"the wrist position ({_numbers(h[index])}) m lies below the arm"
    if (index := _first(_is_singular(legs))) is not None:
        return index, f"the arm is singular at the wrist position ({_numbers(h[index])}) m"
    return None


def _is_singular(legs: LegGeometry) -> NDArray[np.bool_]:
    """Return whether dphi/dh, whose rows are rod_k / leverage_k, is too badly conditioned."""
    stretched = np.any(legs.leverage <= 0.0, axis=-1)
    leverage = np.where(stretched[..., None], 1.0, legs.leverage)
    return stretched | ~(np.linalg.cond(legs.rod / leverage[..., None]) < MAX_CONDITION)


def _first(bad: NDArray[np.bool_]) -> tuple[int, ...] | None:
    if not np.any(bad):
        return None
    return tuple(int(k) for k in np.unravel_index(np.argmax(bad), bad.shape))


def _numbers(vector: Array) -> str:
    return ", ".join(f"{value:.4g}" for value in vector)

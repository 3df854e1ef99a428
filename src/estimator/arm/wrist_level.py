"""Wrist level: the same sensors told as wrist position and force of the springs on the wrist.

The springs' torques balance a force on the wrist by virtual work, tau . phi_dot = force . h_dot, so
force = (dh/dphi)^-T tau (paper, section IV.B, for a massless arm). Weight and inertia of the arm stay in it, which
makes it the torques in other words and the conversion exact both ways.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimator.arm.delta import LegGeometry, inverse_kinematics, is_in_reach, is_reachable, leg_geometry
from estimator.arm.design import OmnidDesign
from estimator.arrays import Array
from estimator.errors import InputError

MAX_CONDITION = 1e4
"""Of dh/dphi: beyond it the arm counts as singular. Within the Omnid's joint limits it stays below 20; at the bound,
rounding grows from 1e-16 to 1e-12."""
_SAME_M = 1e-6  # wrist positions closer than this are one


def wrist_of(phi: ArrayLike, tau: ArrayLike, design: OmnidDesign) -> tuple[Array, Array]:
    """Wrist position and force of the springs on it.

    Args:
        phi: driven angles [rad], shape (..., 3).
        tau: spring torques on the proximal links, positive raising them [N m], shape (..., 3).
        design: the robot's numbers.

    Returns:
        h in {b} [m] and force in {b} [N], arm weight and inertia not removed, each of shape (..., 3).

    Raises:
        InputError: at some configuration the rods cannot meet, a leg is past its stretched position, the wrist is not
            above the driven axes, or the arm is singular.
    """
    phi, tau = np.asarray(phi, dtype=float), np.asarray(tau, dtype=float)
    legs = leg_geometry(phi, design)  # refuses what no wrist position reaches
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
    """Driven angles and spring torques, the inverse of ``wrist_of``.

    Args:
        h: wrist position in {b} [m], shape (..., 3).
        force: what the springs put on the wrist, in {b} [N], shape (..., 3).
        design: the robot's numbers.

    Returns:
        phi [rad] and tau [N m], each of shape (..., 3).

    Raises:
        InputError: some position is not one that ``wrist_of`` returns (see ``wrist_fault``).
    """
    h, force = np.asarray(h, dtype=float), np.asarray(force, dtype=float)
    if (fault := wrist_fault(h, design)) is not None:
        raise InputError(fault[1])
    phi = inverse_kinematics(h, design)
    legs = leg_geometry(phi, design)
    return phi, legs.along_rods(force)


def driven_motion(legs: LegGeometry, h_dot: ArrayLike, h_ddot: ArrayLike) -> tuple[Array, Array]:
    """Driven rates [rad/s] and accelerations [rad/s^2], each of shape (..., 3): the inverse of ``wrist_motion``.

    Args:
        legs: geometry at the driven angles, no leg stretched.
        h_dot: velocity of the wrist in {b} [m/s], shape (..., 3).
        h_ddot: its acceleration [m/s^2], shape (..., 3).
    """
    h_dot, h_ddot = np.asarray(h_dot, dtype=float), np.asarray(h_ddot, dtype=float)
    phi_dot = np.einsum("...kj,...j->...k", legs.rod, h_dot) / legs.leverage
    rod_dot = h_dot[..., None, :] - legs.knee_d1 * phi_dot[..., None]
    curvature = np.sum(legs.rod * legs.knee_d2, axis=-1) * phi_dot**2 - np.sum(rod_dot**2, axis=-1)
    return phi_dot, (np.einsum("...kj,...j->...k", legs.rod, h_ddot) - curvature) / legs.leverage


def wrist_fault(h: ArrayLike, design: OmnidDesign) -> tuple[tuple[int, ...], str] | None:
    """The first wrist position that has no driven angles, or None where all have.

    Args:
        h: wrist position in {b} [m], shape (..., 3).
        design: the robot's numbers.

    Returns:
        Its index in the leading axes, and a sentence that says what is wrong with it.
    """
    h = np.asarray(h, dtype=float)
    within = is_in_reach(h, design)
    if (index := _first(~np.all(within, axis=-1))) is not None:
        leg = int(np.argmin(within[index])) + 1
        return index, f"leg {leg} cannot reach the wrist position ({_numbers(h[index])}) m"
    phi = inverse_kinematics(h, design)
    # The position itself is where the spheres about the knees meet, unless they only touch there.
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
    """Whether dphi/dh, whose rows are rod_k / leverage_k, is too badly conditioned."""
    stretched = np.any(legs.leverage <= 0.0, axis=-1)
    leverage = np.where(stretched[..., None], 1.0, legs.leverage)
    return stretched | ~(np.linalg.cond(legs.rod / leverage[..., None]) < MAX_CONDITION)


def _first(bad: NDArray[np.bool_]) -> tuple[int, ...] | None:
    if not np.any(bad):
        return None
    return tuple(int(k) for k in np.unravel_index(np.argmax(bad), bad.shape))


def _numbers(vector: Array) -> str:
    return ", ".join(f"{value:.4g}" for value in vector)

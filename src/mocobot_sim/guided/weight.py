"""Who carries how much of a payload's weight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from estimator.arm import dynamics as gimbal
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from mocobot_sim.trial.truth import GroundTruth


@dataclass(frozen=True)
class Payload:
    """What is believed of a payload.

    Attributes:
        mass_kg: mass; 0 if its weight is not to be carried.
        p_1c: centre of mass in {1} [m], shape (3,).
        p_1i: grasps in {1} [m], shape (N, 3).
        R_1i: grasp orientations in {1}, shape (N, 3, 3).
    """

    mass_kg: float
    p_1c: Array
    p_1i: Array
    R_1i: Array

    @classmethod
    def of_estimate(cls, estimate: PayloadEstimate) -> Payload:
        """What an estimate says.

        Raises:
            InputError: it does not determine grasps, mass and centre of mass.
        """
        if estimate.grasps is None or estimate.mass is None or estimate.p_1c is None:
            known = {"grasps": estimate.grasps, "mass": estimate.mass, "centre of mass": estimate.p_1c}
            missing = ", ".join(name for name, value in known.items() if value is None)
            raise InputError(f"the estimate has no {missing}; carrying a payload's weight needs it")
        return cls(estimate.mass.mass, estimate.p_1c, estimate.grasps.p_1i, estimate.grasps.R_1i)

    @classmethod
    def of_truth(cls, truth: GroundTruth) -> Payload:
        """What is so."""
        return cls(truth.mass_kg, truth.p_1c, truth.p_1i, truth.R_1i)


def weight_shares(payload: Payload, up_1: ArrayLike, gravity_mps2: float) -> Array:
    """Upward forces at the grasps that carry the payload's weight without turning it [N], shape (N,).

    They add up to the weight, and their moment about the centre of mass is zero. With three grasps they are unique,
    with more the smallest are taken; with one or two a moment stays that cannot be balanced.

    Args:
        payload: what is believed of it.
        up_1: direction away from the ground in {1}, unit length, shape (3,).
        gravity_mps2: g [m/s^2].
    """
    up = np.asarray(up_1, dtype=float)
    arms = payload.p_1i - payload.p_1c
    # Of the moment, only what is across ``up`` can be balanced by forces along it: two directions.
    across = np.linalg.svd(up[None])[2][1:]
    scale = max(np.linalg.norm(arms, axis=1).max(), 1e-9)
    rows = np.vstack([np.ones(len(arms)), across @ np.cross(arms, up).T / scale])
    shares = np.linalg.lstsq(rows, np.array([payload.mass_kg * gravity_mps2, 0.0, 0.0]))[0]
    return np.asarray(shares, dtype=np.float64)


def up_in_payload(theta: Array, R_1i: Array) -> Array:
    """Up, in {1}, as a level robot sees it through its own gimbal, shapes (..., 3), (..., 3, 3) -> (..., 3).

    Args:
        theta: gimbal angles (z, y, x) [rad].
        R_1i: orientation of its grasp in {1}.
    """
    up_i = gimbal.rotation(theta)[..., 2, :]  # the third row of R_bi is z of {b} in {i}
    return (R_1i @ up_i[..., None])[..., 0]

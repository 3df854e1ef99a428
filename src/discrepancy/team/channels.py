"""Channels of a team's rows, and what a misfit in them may depend on or point along."""

from __future__ import annotations

import numpy as np

from discrepancy.result.traces import Channel
from discrepancy.team.linear.rows import Whitening
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arrays import Array
from estimator.rigid_team.slots import PHI, TAU, THETA


def channels_of(robots: int) -> list[Channel]:
    """Channels of N robots, 6 N."""
    out = []
    for i in range(2, robots + 1):
        out += [Channel(f"grasp {i} rotation {a}", "kinematic", i, "rad") for a in "xyz"]
        out += [Channel(f"grasp {i} position {a}", "kinematic", i, "m") for a in "xyz"]
    out += [Channel(f"force {a}", "balance", None, "N") for a in "xyz"]
    return out + [Channel(f"moment {a}", "balance", None, "N m") for a in "xyz"]


def quantities_of(linear: TrialLinear) -> dict[str, Array]:
    """Speed of the payload [m/s], its distance from where it started [m], load [N m]: shape (n,) each."""
    at = linear.reduction.sample
    twist = linear.data.twist[at]
    h = linear.data.p_bi[at]
    return {
        "speed": np.sqrt(np.mean(twist[..., 3:] ** 2, axis=(1, 2))),
        "position": np.sqrt(np.mean((h - h.mean(axis=0)) ** 2, axis=(1, 2))),
        "load": np.sqrt(np.mean(linear.s[at, :, TAU] ** 2, axis=(1, 2))),
    }


def directions_of(linear: TrialLinear, white: Whitening) -> dict[str, Array]:
    """Unit directions in the whitened rows of every spring torque and angle, shape (n, C, 1) each."""
    out = {}
    for robot in range(linear.robots):
        J = linear.J.at(robot, slice(None), linear.reduction.sample)
        whose = f"robot {robot + 1}'s"
        tau, phi, theta = (J[:, :, kind] for kind in (TAU, PHI, THETA))
        for k in range(3):
            out[f"{whose} torque channel {k + 1}"] = _unit(white.rows_only(tau[..., k]))
            out[f"{whose} driven angle {k + 1}"] = _unit(white.rows_only(phi[..., k]))
            out[f"{whose} gimbal angle {'zyx'[k]}"] = _unit(white.rows_only(theta[..., k]))
    return out


def _unit(x: Array) -> Array:
    """Rows (n, C) to unit length, as one direction each, shape (n, C, 1)."""
    return (x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300))[..., None]

"""Signals at their adjusted values: where all is linearised, and what columns are made of.

A spring's scale adds a function of the torque to the residual, a payload's mass one of its motion, a length one of the
pose. With signals as measured, their noise is in column and residual alike, and they correlate. The scales of all
springs together, which only the arms' own weight tells from the payload's mass, came out 1.5 % low for noise of the
torques, 13 standard errors; for that of 12-bit encoders, whose accelerations are in the mass's column, mass and all
springs shrank by half; and all lengths together, which no angle tells, shrank with the noise of the loops. Of the
signals as least squares adjusts them to closed loops and balanced wrenches, the noise is independent of the residual;
to linearise at adjusted observations is the rule for such models (W. E. Deming, Statistical Adjustment of Data, 1943).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from discrepancy.team.linear.by_unknowns import by_bases, by_shared
from discrepancy.team.linear.jacobian import by_signals
from discrepancy.team.linear.reduction import Reduction
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.trial_linear import TrialLinear, filtered
from estimator.arm.motion import PHI, TAU, THETA
from estimator.arrays import Array
from estimator.rigid_team import Bases, Shared, balance, grasp_data, pose_error
from estimator.signals import GraspData


@dataclass(frozen=True, eq=False)
class SignalNoise:
    """What a residual tells of the noise of every signal in a trial.

    Attributes:
        told: regression of the signals' noise on the residual's channels, in motion and in holds, (N, 21, C) each.
    """

    told: tuple[Array, Array]

    @classmethod
    def of(cls, rows: Array, signals: Array, moving: int) -> SignalNoise:
        """From draws of the noise alone: residuals (D, n, C), reduced signals (D, n, N, 21)."""
        kinds = slice(None, moving), slice(moving, None)
        moves, holds = (_regression(rows[:, at], signals[:, at]) for at in kinds)
        return cls((moves, holds))


def _regression(rows: Array, signals: Array) -> Array:
    """E[s r^T] E[r r^T]^-1, shape (N, 21, C); few draws tell of every channel by itself, none of nothing."""
    r, s = rows.reshape(-1, rows.shape[2]), signals.reshape(-1, *signals.shape[2:])
    squares, weight = r.T @ r, min(1.0, r.shape[1] / max(len(r), 1))
    size = np.sqrt(np.maximum(np.diag(squares), 1e-300))
    alike = (1.0 - weight) * squares / np.outer(size, size) + weight * np.diag(np.diag(squares) / size**2)
    inverse = np.linalg.pinv(alike, hermitian=True) / np.outer(size, size)
    return np.asarray(np.einsum("kns,kc->nsc", s, r, optimize=True) @ inverse)


def with_adjusted_signals(
    linear: TrialLinear, noise: SignalNoise, explained: Array | float = 0.0
) -> TrialLinear:
    """The trial linear at its signals moved the likeliest way that leaves no residual but what causes explain.

    Args:
        linear: the trial.
        noise: what its residual tells of its signals.
        explained: what causes put into every sample's residual, shape (Q, C).
    """
    shared, bases, arms = linear.shared, linear.bases, linear.arms
    s = linear.s - _noise_in(linear.data, shared, bases, linear.reduction, noise, explained)
    data = grasp_data(s, arms, linear.signals.rate_hz)
    return replace(
        linear,
        s=s,
        data=data,
        J=by_signals(s, data, shared, bases, arms),
        by_shared=linear.reduction(by_shared(data, shared, bases)),
        by_bases=linear.reduction(by_bases(data, shared, bases)),
    )


def noise_of(
    signals: Signals, shared: Shared, bases: Bases, linear: TrialLinear, noise: SignalNoise
) -> Signals:
    """What residuals tell of the noise in signals without any error, angles and torques of shape (Q, N, 3)."""
    data = grasp_data(filtered(signals), linear.arms, signals.rate_hz)
    each = _noise_in(data, shared, bases, linear.reduction, noise)
    phi, theta, tau = (each[..., kind] for kind in (PHI, THETA, TAU))
    return Signals(signals.time, phi, theta, tau, signals.rate_hz)


def as_loud(signals: Signals, shared: Shared, bases: Bases, linear: TrialLinear, noise: SignalNoise) -> Array:
    """What has to be added to a residual so that its noise is as loud as where the trial is linear, rows (n, C).

    Noise of accelerations is in the residual as often as there is mass, and that of a spring's reading at the lever of
    its robot. Elsewhere it would be louder or quieter than its whitening says, and the quieter the likelier.
    """
    s = filtered(signals)
    data = grasp_data(s, linear.arms, signals.rate_hz)
    each = _noise_in(data, shared, bases, linear.reduction, noise)
    quiet = grasp_data(s - each, linear.arms, signals.rate_hz)
    here = _residual(data, shared, bases) - _residual(quiet, shared, bases)
    there = sum(linear.J(robot, slice(None), each[:, robot]) for robot in range(linear.robots))
    return linear.reduction(there - here)


def _residual(data: GraspData, shared: Shared, bases: Bases) -> Array:
    """Of every sample, shape (Q, 6 N)."""
    return np.concatenate([pose_error(data.R_bi, data.p_bi, shared, bases), balance(data, shared)[0]], axis=1)


def _noise_in(
    data: GraspData,
    shared: Shared,
    bases: Bases,
    reduction: Reduction,
    noise: SignalNoise,
    explained: Array | float = 0.0,
) -> Array:
    """Of every sample's signals, shape (Q, N, 21)."""
    residual = _residual(data, shared, bases) - explained
    held = np.zeros(len(residual), dtype=bool)
    held[reduction.operator[reduction.moving :].indices] = True
    moves, holds = (np.einsum("nsc,qc->qns", told, residual, optimize=True) for told in noise.told)
    return np.where(held[:, None, None], holds, moves)

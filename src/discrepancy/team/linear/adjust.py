"""Signals at their adjusted values, for columns that are made of them.

A spring's scale adds a function of the torque to the residual, a payload's mass one of its motion. With signals as
measured, their noise is in column and residual alike, and they correlate. The scales of all springs together, which
only the arms' own weight tells from the payload's mass, came out 1.5 % low for noise of the torques, 13 standard
errors; for that of 12-bit encoders, whose accelerations are in the mass's column, mass and all springs shrank by half.
Of the signals as least squares adjusts them to the balance of the wrenches, the noise is independent of the residual;
to linearise at adjusted observations is the rule for such models (W. E. Deming, Statistical Adjustment of Data, 1943).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from discrepancy.team.linear.trial_linear import TrialLinear, payload_columns
from estimator.arrays import Array
from estimator.rigid_team.residual import balance, grasp_data


@dataclass(frozen=True, eq=False)
class SignalNoise:
    """What a wrench balance that does not close tells of the noise of every signal in a trial.

    Attributes:
        told: regression of the signals' noise on the balance's six channels, in motion and in holds, (N, 21, 6) each.
    """

    told: tuple[Array, Array]

    @classmethod
    def of(cls, rows: Array, signals: Array, moving: int) -> SignalNoise:
        """From draws of the noise alone: residuals (D, n, C), reduced signals (D, n, N, 21)."""
        kinds = slice(None, moving), slice(moving, None)
        moves, holds = (_regression(rows[:, at, -6:], signals[:, at]) for at in kinds)
        return cls((moves, holds))


def _regression(balances: Array, signals: Array) -> Array:
    """E[s r^T] E[r r^T]^-1, shape (N, 21, 6); nothing is told where there are no such rows."""
    r, s = balances.reshape(-1, 6), signals.reshape(-1, *signals.shape[2:])
    return np.asarray(np.einsum("kns,kc->nsc", s, r, optimize=True) @ np.linalg.pinv(r.T @ r))


def with_adjusted_signals(linear: TrialLinear, noise: SignalNoise) -> TrialLinear:
    """The trial with its signals moved the likeliest way that makes the wrenches balance, and the payload's columns."""
    residual = balance(linear.data, linear.shared)[0]
    held = np.zeros(len(residual), dtype=bool)
    held[linear.reduction.operator[linear.reduction.moving :].indices] = True
    s = linear.s.copy()
    for rows, told in zip((~held, held), noise.told, strict=True):
        s[rows] -= np.einsum("nsc,qc->qns", told, residual[rows], optimize=True)
    data = grasp_data(s, linear.arms, linear.signals.rate_hz)
    by_shared = linear.by_shared.copy()
    by_shared[:, -6:] = linear.reduction(payload_columns(data, linear.shared))
    return replace(linear, s=s, data=replace(data, time=linear.data.time), by_shared=by_shared)

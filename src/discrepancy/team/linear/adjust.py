"""Torques at their adjusted values, for columns that are made of them.

A spring's scale or hardening adds a function of the torque to the residual. With the torque as measured, its noise is
in column and residual alike, and they correlate: the scales of all springs together, which only the arms' own weight
tells from the payload's mass, came out 1.5 % low, 13 standard errors. Of the torques as least squares adjusts them to
the payload's motion, the noise is independent of the residual; to linearise at adjusted observations is the rule for
such models (W. E. Deming, Statistical Adjustment of Data, 1943).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arrays import Array
from estimator.rigid_team.residual import balance
from estimator.rigid_team.slots import TAU


@dataclass(frozen=True, eq=False)
class TorqueNoise:
    """What the sensors' noise leaves in rows of one trial, those in motion first and the holds second.

    Attributes:
        variance: of the reduced torques [N^2 m^2], two arrays (N, 3).
        information: inverse covariance of the wrench balance's six channels, two arrays (6, 6).
    """

    variance: tuple[Array, Array]
    information: tuple[Array, Array]

    @classmethod
    def of(cls, rows: Array, torques: Array, moving: int) -> TorqueNoise:
        """From draws of the noise alone: residuals (D, n, C), reduced torques (D, n, N, 3)."""
        parts = [(x[:, :moving], x[:, moving:]) for x in (rows[..., -6:], torques)]
        information = []
        for x in parts[0]:
            flat = x.reshape(-1, 6)
            # Nothing to adjust where there are no such rows.
            information.append(np.linalg.pinv(flat.T @ flat / len(flat)) if len(flat) else np.zeros((6, 6)))
        variance = [np.mean(x**2, axis=(0, 1)) if x.shape[1] else np.zeros(x.shape[2:]) for x in parts[1]]
        return cls((variance[0], variance[1]), (information[0], information[1]))


def with_adjusted_torques(linear: TrialLinear, noise: TorqueNoise) -> TrialLinear:
    """The trial with its torques (in ``s``) moved the likeliest way that makes the wrenches balance.

    By S J^T C^-1 r: S the torques' variance, J the balance's derivative by them, C its covariance, r what it leaves.
    Accelerations, which are noisy, too, take their share of r.
    """
    residual = balance(linear.data, linear.shared)[0]
    held = np.zeros(len(residual), dtype=bool)
    held[linear.reduction.operator[linear.reduction.moving :].indices] = True
    s, by_torque = linear.s.copy(), linear.J.dense(TAU)[:, :, -6:]
    for rows, variance, information in zip((~held, held), noise.variance, noise.information, strict=True):
        weighed = residual[rows] @ information
        moved = np.einsum("iqcs,qc->qis", by_torque[:, rows], weighed, optimize=True)
        s[rows, :, TAU] -= variance * moved
    return replace(linear, s=s)

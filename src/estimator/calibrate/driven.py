"""Rows of a trial whose bases drive: errors of their odometry as unknowns that are eliminated row by row.

The pose of base i, by its odometry, is wrong by a small motion d_i = (a, b): a rotation a and a displacement b of the
base's place on the floor, in its frame at the start. In x, y and yaw d_i is a random walk, which slip drives. A wrong
yaw turns later displacements, too. About x, about y and along z a base rocks on its wheels: a first-order
autoregression. Slip also makes the accelerations of every row wrong, independently from row to row. Three scales of
each odometry (yaw, x, y) are wrong for the whole trial, and a base tilts in proportion to its load.

Given all other unknowns, the states of successive rows form a chain, so the normal equations are block tridiagonal.
Eliminating the states (block LDL^T, as in a Kalman smoother) leaves the sum of squares by the other unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from estimator.arrays import Array
from estimator.calibrate import rules

STATES = 6
"""Errors of one base in a row: rotation about x, y and z [rad], displacement along x, y and z [m]."""
SCALES, PATHS = 5, 3
"""Constants of one base: errors of scale of its odometry (yaw, x, y), which change its path, and how it rocks: tilt by
its acceleration [rad s^2/m] and by the moment of the load [rad/(N m)].
"""
_WALKS, _ROCKS = np.array([2, 3, 4]), np.array([0, 1, 5])


class Drift(NamedTuple):
    """Standard deviations of the errors of bases that drive.

    ``slip`` is the growth of a random walk in one second, ``rock`` a deviation in any row, and ``jolt`` the error of a
    row's mean acceleration. The defaults are measured on the shipped base.
    """

    slip_rad: float = 3e-4
    slip_m: float = 1.3e-4
    rock_rad: float = 5e-5
    rock_m: float = 4e-6
    jolt_radps2: float = 5e-3
    jolt_mps2: float = 2e-3


@dataclass(frozen=True, eq=False)
class Driven:
    """Derivatives of a trial's rows by errors of the bases.

    Attributes:
        by_states: shape (n, C, 6 N).
        by_scales: by the constants of every base, shape (n, C, 5 N).
        by_jolts: of the balance by errors of acceleration (x, y, yaw), shape (n, 6, 3 N); zero in holds.
        moved: displacement of every base since the row before [m], shape (n, N, 2).
        time: middle of every row [s], shape (n,).
        first: whether the rows are the first of the trial, before which no base has slipped.
    """

    by_states: Array
    by_scales: Array
    by_jolts: Array
    moved: Array
    time: Array
    first: bool

    def with_noise(self, covariance: Array, drift: Drift) -> Array:
        """Add errors of acceleration to the covariance of rows, shape (n, C, C)."""
        sd = np.tile([drift.jolt_mps2, drift.jolt_mps2, drift.jolt_radps2], self.moved.shape[1])
        part, out = self.by_jolts * sd, covariance.copy()
        out[:, -6:, -6:] += part @ np.swapaxes(part, 1, 2)
        return out

    def in_time(self) -> Driven:
        """Return the rows in order of time."""
        k = np.argsort(self.time)
        parts = self.by_states[k], self.by_scales[k], self.by_jolts[k], self.moved[k], self.time[k]
        return Driven(*parts, self.first)

    def chain(self, drift: Drift) -> tuple[Array, Array]:
        """Return transition from the row before (n, 6 N, 6 N) and precision of what is new in a row (n, 6 N).

        The rows must be in order of time.
        """
        n, N = self.moved.shape[:2]
        after = np.maximum(np.diff(self.time, prepend=self.time[0] - rules.DRIVEN_ROW_S), 1e-3)
        same = np.exp(-after / rules.ROCKING_S)
        step, variance = np.zeros((n, N, STATES, N, STATES)), np.zeros((n, N, STATES))
        for i in range(N):
            step[:, i, _WALKS, i, _WALKS] = 1.0
            step[:, i, 3, i, 2], step[:, i, 4, i, 2] = -self.moved[:, i, 1], self.moved[:, i, 0]
            step[:, i, _ROCKS, i, _ROCKS] = same[:, None]
        walk, rock = (
            np.array([drift.slip_rad, *[drift.slip_m] * 2]),
            np.array([*[drift.rock_rad] * 2, drift.rock_m]),
        )
        variance[..., _WALKS] = (walk**2 * after[:, None])[:, None]
        variance[..., _ROCKS] = (rock**2 * (1.0 - same[:, None] ** 2))[:, None]
        variance[0, :, _ROCKS] = rock[:, None] ** 2
        if not self.first:
            variance[0, :, _WALKS] = rules.LOST**2
        return step.reshape(n, STATES * N, -1), 1.0 / np.maximum(variance.reshape(n, -1), 1e-18)


class Eliminated(NamedTuple):
    """Sum of squares without the errors of the bases.

    Attributes:
        gram: of the other unknowns and the residual, shape (K + 1, K + 1).
        states: the errors at zero change of the other unknowns, shape (n, 6 N).
        scales: the constants of every base, shape (5 N,).
        log_evidence: logarithm of the density of the residual, up to a constant.
    """

    gram: Array
    states: Array
    scales: Array
    log_evidence: float


def eliminated(
    J: Array, residual: Array, covariance: Array, driven: Driven, drift: Drift, at: slice
) -> Eliminated:
    """Eliminate the bases' errors from whitened rows.

    Args:
        J: derivative by the other unknowns, shape (n, c, K).
        residual: shape (n, c).
        covariance: of the rows' noise, with that of ``Driven.with_noise``, shape (n, c, c).
        driven: derivatives by the bases' errors, of all channels.
        drift: standard deviations.
        at: the channels.
    """
    n, K, order = len(J), J.shape[2], np.argsort(driven.time)
    J, residual, covariance, driven = J[order], residual[order], covariance[order], driven.in_time()
    factor = np.linalg.cholesky(covariance)
    B, by_scales = driven.by_states[:, at], driven.by_scales[:, at]
    m, S = B.shape[2], by_scales.shape[2]
    white = np.linalg.solve(factor, np.concatenate([B, J, by_scales, residual[..., None]], axis=2))
    B, rest = white[..., :m], white[..., m:]
    flat = rest.reshape(-1, rest.shape[2])
    gram, right = flat.T @ flat, np.swapaxes(B, 1, 2) @ rest
    step, precision = driven.chain(drift)
    own = np.swapaxes(B, 1, 2) @ B
    own[:, range(m), range(m)] += precision
    ahead = precision[1:, :, None] * step[1:]  # Q^-1 Phi of the row after
    own[:-1] += np.swapaxes(step[1:], 1, 2) @ ahead
    log_det, solved = 0.0, []
    for k in range(n):
        lower = cho_factor(own[k], lower=True, check_finite=False)
        log_det += 2.0 * np.log(np.diag(lower[0])).sum()
        both = right[k] if k == n - 1 else np.concatenate([right[k], -ahead[k].T], axis=1)
        x = cho_solve(lower, both, check_finite=False)
        gram -= right[k].T @ x[:, : rest.shape[2]]
        if k < n - 1:
            own[k + 1] += ahead[k] @ x[:, rest.shape[2] :]
            right[k + 1] += ahead[k] @ x[:, : rest.shape[2]]
        solved.append(x)
    scale = slice(K, K + S)
    sd = np.tile([*[rules.ODOMETRY_RATIO] * 3, *rules.ROCKS], S // SCALES)
    gram[range(K, K + S), range(K, K + S)] += 1.0 / sd**2
    kept = np.r_[0:K, K + S]
    lower = cho_factor(gram[scale, scale])
    x = cho_solve(lower, gram[scale][:, kept])
    left = gram[np.ix_(kept, kept)] - gram[kept][:, scale] @ x
    scales = -x[:, -1]
    states = np.zeros((n, m))
    for k in reversed(range(n)):
        own_part = solved[k][:, K : K + S] @ scales + solved[k][:, K + S]
        states[k] = -own_part - (solved[k][:, rest.shape[2] :] @ states[k + 1] if k < n - 1 else 0.0)
    states[order] = states.copy()
    log_det += 2.0 * np.log(np.diag(lower[0])).sum() + 2.0 * np.log(sd).sum()
    log_det += 2.0 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum() - np.log(precision).sum()
    return Eliminated(left, states, scales, -0.5 * (float(left[-1, -1]) + float(log_det)))


def learnt(residual: Array, covariance: Array, driven: Driven, drift: Drift) -> Drift:
    """Return the standard deviations of the bases' errors that make a residual most likely.

    Args:
        residual: rows near the solution, as of bases without errors, shape (n, C).
        covariance: of the sensors' noise, shape (n, C, C).
        driven: derivatives by the bases' errors.
        drift: start.
    """
    none, every = np.zeros((*residual.shape, 0)), slice(None)

    def cost(x: Array) -> float:
        tried = Drift(*np.exp(x))
        found = eliminated(none, residual, driven.with_noise(covariance, tried), driven, tried, every)
        # A weak prior holds what a trial does not tell.
        return -found.log_evidence + 0.5 * float(np.sum(((x - np.log(Drift())) / rules.DRIFT_LOG) ** 2))

    best = minimize(cost, np.log(drift), method="L-BFGS-B", options={"maxiter": 15, "eps": 1e-3})
    return Drift(*np.exp(best.x).tolist())

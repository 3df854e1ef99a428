"""Least squares of closed loops, joint and, with torques, the balance of wrenches of two bodies.

Rows, their noise and the adjustment of the signals are those of ``estimator.calibrate`` (Gauss-Helmert). Derivatives by
the unknowns are central differences of the rows, so they average the motion within a row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from estimator.arm.motion import STEPS, ArmData
from estimator.arm.unit import ArmUnit
from estimator.arrays import Array
from estimator.calibrate.equations import adjustment_of, corrected, covariance_of, noise_of
from estimator.calibrate.rows import Rows, Sensing
from estimator.errors import InputError
from estimator.rigid_team import robot_data
from estimator.two_bodies.team import Law, Pair, balance

STEP = 1e-5
"""Step of central differences by the unknowns [rad, m]. Derived: their relative error is below 1e-9."""
MOST_STEPS, CONVERGED, RISE = 40, 0.01, 0.01
"""Most Gauss-Newton steps; largest step in standard errors at convergence; relative rise of chi2 that a step may cause
because the covariance of the rows depends on the point. Chosen."""
FAR = 100.0
"""chi2/n above which signals are not adjusted. Chosen: ten times the noise."""


@dataclass(eq=False)
class TrialRows:
    """Rows of one trial and their sensors.

    ``fine_time`` are the instants of ``fine`` [s]; ``adjustment`` is kept between evaluations.
    """

    name: str
    rows: Rows
    units: ArmUnit
    sensing: Sensing
    fine_time: Array
    adjustment: Array | float = 0.0
    fine: ArmData = field(init=False)
    mean: Array = field(init=False)
    noise: Array = field(init=False)

    def __post_init__(self) -> None:
        """Convert the signals once: the robots are held."""
        rows = self.rows
        self.fine = robot_data(corrected(rows.s, self.units), self.units)
        mean = rows(rows.s)
        mean[rows.moving :, :, 3:9] = mean[rows.moving :, :, 12:18] = 0.0
        self.mean = corrected(mean, self.units)
        self.noise = noise_of(rows, self.sensing.variances(rows))


@dataclass(frozen=True, eq=False)
class Point:
    """Unknowns: grasps, joint and bases; the inertial parameters and the law's terms (empty without torques)."""

    pair: Pair
    pi: Array
    law: Law = ()

    @property
    def torques(self) -> bool:
        """Whether the balance of wrenches belongs to the fit."""
        return bool(len(self.pi))

    @property
    def size(self) -> int:
        """Number of all unknowns."""
        return self.pair.size + len(self.pi)

    def moved(self, x: Array) -> Point:
        """Change all unknowns: those of ``Pair.moved``, then the parameters."""
        k = self.pair.size
        return Point(self.pair.moved(x[:k]), self.pi + x[k:], self.law)


def residual(point: Point, trial: int, data: ArmData, gravity: float) -> tuple[Array, Array, Array, Array]:
    """Return residuals (Q, C), columns of the parameters (Q, C, K), q (Q,) and the unknown share of friction (Q,).

    Channels: loops within the halves, the joint, and with torques the seven of ``team.Balance``.
    """
    pair = point.pair
    left, (q, off), pose = pair.loops(data.R_bi, data.h, pair.bases[trial])
    out = np.concatenate([left, off], axis=1)
    columns, stick = np.zeros((len(q), out.shape[1], len(point.pi))), np.zeros(len(q))
    if point.torques:
        found = balance(pair, data, pose, q, point.law, gravity)
        out = np.concatenate([out, found.wrench - found.columns @ point.pi], axis=1)
        columns, stick = np.concatenate([columns, -found.columns], axis=1), found.stick
    return out, columns, q, stick


@dataclass(frozen=True, eq=False)
class Evaluated:
    """One trial at a point: residual (n, C), derivative (n, C, K), covariances, coordinate q (n,) and its gradient.

    ``noise`` is the sensors' part of ``covariance``; ``extended`` is that of (residual, q), shape (n, C+1, C+1).
    """

    residual: Array
    J: Array
    covariance: Array
    extended: Array
    q: Array


def evaluate(point: Point, k: int, trial: TrialRows, *, derivatives: bool = True) -> Evaluated:
    """Evaluate one trial; updates its adjustment."""
    gravity, rows = trial.units.gravity_mps2, trial.rows
    left, columns, q, stick = residual(point, k, trial.fine, gravity)
    r, n = rows(left), len(rows.time)
    s = trial.mean + trial.adjustment
    data = robot_data(s, trial.units)
    base, adjusted, q_s, _ = residual(point, k, data, gravity)
    C, N = r.shape[1], s.shape[1]
    by_signals = np.zeros((n, C + 1, N, s.shape[2]))
    for slot in range(s.shape[2]) if point.torques else (*range(3), *range(9, 12)):
        moved = s.copy()
        moved[..., slot] += STEPS[slot]
        changed = robot_data(moved, trial.units)
        for i in range(N):
            one = np.arange(N) == i
            parts = (
                np.where(one.reshape(1, -1, *(1,) * (old.ndim - 2)), new, old)
                for old, new in zip(data, changed, strict=True)
            )
            there = residual(point, k, ArmData(*parts), gravity)
            by_signals[:, :C, i, slot] = (there[0] - base) / STEPS[slot]
            by_signals[:, C, i, slot] = (there[2] - q_s) / STEPS[slot]
    extended = covariance_of(by_signals, trial.noise)
    covariance = extended[:, :C, :C].copy()
    if point.pair.joint.motion == "loose":  # the relative pose is free: weigh it by its own scatter
        free = np.arange(C - 6, C)
        covariance[:, free, free] += np.mean(r[:, free] ** 2, axis=0)
    misfit = np.mean(np.sum(r * np.linalg.solve(covariance, r[..., None])[..., 0], axis=1)) / C
    # Far from the solution, an adjustment would leave the linear range.
    trial.adjustment = adjustment_of(by_signals[:, :C], trial.noise, covariance, r) if misfit < FAR else 0.0
    if point.torques and "friction" in point.law:
        friction = point.pi[len(point.pi) - len(point.law) + point.law.index("friction")]
        covariance[:, -1, -1] += (friction * rows(stick[:, None])[:, 0]) ** 2
    J = np.zeros((n, C, point.size))
    if derivatives:
        of_pi = slice(point.pair.size, None)
        mean = robot_data(trial.mean, trial.units)
        # Derivatives of the balance are those at the adjusted signals, plus the motion within the row.
        balance = slice(C - 7 if point.torques else C, C)
        still = np.arange(n)[:, None, None] >= rows.moving

        def shifted(average: Array, at: Array, raw: Array) -> Array:
            return np.where(still.reshape(n, *(1,) * (average.ndim - 1)), at, average + at - raw)

        if point.torques:
            raw = residual(point, k, mean, gravity)[1][:, balance]
            J[:, balance, of_pi] = shifted(rows(columns)[:, balance], adjusted[:, balance], raw)
        for column in point.pair.seen_by(k):
            x = np.zeros(point.size)
            x[column] = STEP
            there, back = point.moved(x), point.moved(-x)

            def slope(data: ArmData, there: Point = there, back: Point = back) -> Array:
                return (residual(there, k, data, gravity)[0] - residual(back, k, data, gravity)[0]) / (
                    2.0 * STEP
                )

            J[..., column] = rows(slope(trial.fine))
            if point.torques:
                J[:, balance, column] = shifted(
                    J[:, balance, column], slope(data)[:, balance], slope(mean)[:, balance]
                )
    return Evaluated(r, J, covariance, extended, rows(q[:, None])[:, 0])


@dataclass(frozen=True, eq=False)
class Fitted:
    """Solution of the least squares.

    Attributes:
        point: the solution.
        covariance: of all unknowns (``Point.moved``), shape (K, K).
        trials: every trial at the solution.
        chi2, rows: sum of squares, and number of equations.
        converged: whether the last step was small.
    """

    point: Point
    covariance: Array
    trials: tuple[Evaluated, ...]
    chi2: float
    rows: int
    converged: bool


def solve(point: Point, trials: Sequence[TrialRows], *, gain: float = 0.0) -> Fitted:
    """Minimize the sum of squares from a starting point.

    ``gain`` also ends the steps where one lowers chi2, over its mean per row, by no more than this.

    Raises:
        InputError: the equations are singular.
    """
    lowest, halvings, dx = np.inf, 0, np.zeros(point.size)
    H = np.eye(point.size)
    at: list[Evaluated] = []
    settled, last = False, point
    for _ in range(MOST_STEPS):
        at = [evaluate(point, k, trial) for k, trial in enumerate(trials)]
        H, g, value = normal(at, point.size)
        if value > lowest * (1.0 + RISE) and halvings < 6:
            dx, halvings = 0.5 * dx, halvings + 1
            point = last.moved(dx)
            continue
        flat = gain > 0.0 and lowest - value < gain * value / _count(at)
        lowest, halvings, last = value, 0, point
        scale = 1.0 / np.sqrt(np.maximum(np.diag(H), 1e-300))
        scaled = H * np.outer(scale, scale)
        values, vectors = np.linalg.eigh(scaled)
        good = values > 1e-13 * values[-1]
        dx = -scale * (vectors[:, good] / values[good] @ (vectors[:, good].T @ (scale * g)))
        se = scale * np.sqrt(np.sum(vectors[:, good] ** 2 / values[good], axis=1))
        settled = bool(np.max(np.abs(dx) / se) < CONVERGED * max(1.0, np.sqrt(value / _count(at))))
        if settled or flat:
            break
        point = point.moved(dx)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(H), 1e-300))
    inverse = np.linalg.pinv(H * np.outer(scale, scale), rcond=1e-13, hermitian=True)
    if not np.isfinite(inverse).all():
        raise InputError("the equations of two bodies cannot be solved")
    return Fitted(last, inverse * np.outer(scale, scale), tuple(at), lowest, _count(at), settled)


def _count(at: Sequence[Evaluated]) -> int:
    return sum(one.residual.size for one in at)


def normal(at: Sequence[Evaluated], size: int) -> tuple[Array, Array, float]:
    """Return normal equations H (K, K), g (K,) and chi2 of all trials."""
    H, g, value = np.zeros((size, size)), np.zeros(size), 0.0
    for one in at:
        L = np.linalg.cholesky(one.covariance)
        white = np.linalg.solve(L, np.concatenate([one.J, one.residual[..., None]], axis=2)).reshape(
            -1, size + 1
        )
        gram = white.T @ white
        H, g, value = H + gram[:-1, :-1], g + gram[:-1, -1], value + float(gram[-1, -1])
    return H, g, value

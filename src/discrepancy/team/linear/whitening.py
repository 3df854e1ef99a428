"""Make a residual's rows independent and of unit variance, from draws of the noise alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_toeplitz, solve_triangular

from discrepancy.team.linear.patches import Patch, Patches
from estimator.arrays import Array

SHRINKAGE_SHARE = 0.05
"""By which the channels' covariance is drawn to its diagonal at least. Chosen."""

LOUD_POWER = 2.25
"""Noise of a row, in squares of that of the others, above which it has a weight of its own. Derived: four standard
deviations of a mean square of 24 draws (a team's ``NOISE_DRAWS``), sqrt(2/24) = 0.29, above 1."""

ROWS_PER_COEFFICIENT = 10
"""A series must have more rows than so many for each coefficient, or stays as it is. Chosen."""

AR_ORDER = 2
"""Autoregression of whitened channels, unless a rig says otherwise. Chosen: rows are nearly white already."""


@dataclass(frozen=True, eq=False)
class Whitening:
    """Channels are decorrelated at each row, then every channel of the moving rows along time (autoregressive).

    Attributes:
        moving: number of leading rows that follow each other at one rate; the rest stand alone.
        chol_moving, chol_alone: lower Cholesky factors of the channels' covariance, shape (C, C).
        ar: autoregressive coefficients of every whitened channel, shape (C, p).
        innovation: standard deviation of what they leave, shape (C,).
        loudness: standard deviation of every moving row's noise over that of the quiet ones, shape (moving, C); or
            (1, C), all 1.
    """

    moving: int
    chol_moving: Array
    chol_alone: Array
    ar: Array
    innovation: Array
    loudness: Array

    @classmethod
    def of(cls, draws: Array, moving: int, order: int = AR_ORDER, *, uneven: bool = False) -> Whitening:
        """Whitening from noise draws, shape (D, n, C), of which the first ``moving`` rows are a series.

        Args:
            draws: of the noise alone.
            moving: number of leading rows that follow each other.
            order: of the autoregression.
            uneven: whether some moving rows may be louder than the others, as where a motion begins and encoders
                repeat a rounding error that the filter averages out later. They are found in the draws and divided by
                their own standard deviation first.
        """
        channels = draws.shape[2]
        loudness = np.ones((1, channels))
        if uneven and moving:
            power = np.mean(draws[:, :moving] ** 2, axis=0)
            power /= np.maximum(np.median(power, axis=0), 1e-300)
            loudness = np.where(power > LOUD_POWER, np.sqrt(power), 1.0)
        even = draws[:, :moving] / loudness
        chol_moving, chol_alone = _cholesky(even), _cholesky(draws[:, moving:])
        ar, innovation = np.zeros((channels, order)), np.ones(channels)
        if order and moving > ROWS_PER_COEFFICIENT * order:
            flat = _per_row(_inverse(chol_moving), even.reshape(-1, channels))
            white = flat.reshape(len(draws), moving, channels)
            lag = np.array(
                [np.mean(white[:, k:] * white[:, : moving - k], axis=(0, 1)) for k in range(order + 1)]
            )
            for c in range(channels):
                if lag[0, c] < 1e-12:  # a channel without noise
                    continue
                ar[c] = solve_toeplitz(lag[:order, c], lag[1:, c])  # Yule and Walker
                innovation[c] = np.sqrt(max(lag[0, c] - ar[c] @ lag[1:, c], 1e-6))
        return cls(moving, chol_moving, chol_alone, ar, innovation, loudness)

    def __call__(self, x: Array) -> Array:
        """Whiten rows and channels, shape (n, C, ...) -> the same."""
        y = self.rows_only(x)
        y[: self.moving] = self._series(y[: self.moving])
        return y

    def _series(self, z: Array, start: int = 0, first: int = 0) -> Array:
        """Moving rows made independent, from a row and a channel on before which there is nothing."""
        shape = (1, -1) + (1,) * (z.ndim - 2)
        out, order = z.copy(), self.ar.shape[1]
        for k in range(order):
            out[k + 1 :] -= self.ar[first:, k].reshape(shape) * z[: len(z) - k - 1]
        # The first rows have no past to predict them from; they keep their own variance of one.
        early = max(order - start, 0)
        out[:early] = z[:early]
        out[early:] /= self.innovation[first:].reshape(shape)
        return out

    def of_patches(self, patches: Patches) -> Patches:
        """The same of columns that are there for a while."""
        return Patches(patches.shape, tuple(map(self._of_patch, patches.each)))

    def _of_patch(self, patch: Patch) -> Patch:
        moves, first = patch.rows < self.moving, patch.first
        alone, rows = patch.rows[~moves], patch.rows[moves]
        if len(rows):  # what comes after them is told by them, too
            rows = np.arange(rows[0], min(rows[-1] + 1 + self.ar.shape[1], self.moving))
        series = np.zeros((len(rows), *patch.values.shape[1:]))
        series[patch.rows[moves] - patch.rows[0]] = patch.values[moves]
        if len(self.loudness) > 1:
            series /= self.loudness[rows, first:, None]
        # Triangular: a channel is told by itself and those before it.
        series = self._whiten_moving[first:, first:] @ series
        if len(rows):
            series = self._series(series, int(rows[0]), first)
        others = self._whiten_alone[first:, first:] @ patch.values[~moves]
        return Patch(np.concatenate([rows, alone]), first, np.concatenate([series, others]))

    def rows_only(self, x: Array) -> Array:
        """Decorrelate the channels of every row, not the rows, shape (n, C, ...) -> the same."""
        y = np.empty_like(x, dtype=float)
        even = x[: self.moving] / self.loudness.reshape(*self.loudness.shape, *(1,) * (x.ndim - 2))
        y[: self.moving] = _per_row(self._whiten_moving, even)
        y[self.moving :] = _per_row(self._whiten_alone, x[self.moving :])
        return y

    @cached_property
    def _whiten_moving(self) -> Array:
        return _inverse(self.chol_moving)

    @cached_property
    def _whiten_alone(self) -> Array:
        return _inverse(self.chol_alone)


def _cholesky(draws: Array) -> Array:
    channels = draws.shape[2]
    rows = draws.reshape(-1, channels)
    if not len(rows):
        return np.eye(channels)
    covariance = rows.T @ rows / len(rows)
    weight = SHRINKAGE_SHARE + (1.0 - SHRINKAGE_SHARE) * min(1.0, channels / len(rows))
    diagonal = np.diag(np.diag(covariance) + 1e-30)
    factor = np.linalg.cholesky((1.0 - weight) * covariance + weight * diagonal)
    return np.array(factor, dtype=np.float64)


def _inverse(chol: Array) -> Array:
    return np.array(solve_triangular(chol, np.eye(len(chol)), lower=True), dtype=np.float64)


def _per_row(whiten: Array, x: Array) -> Array:
    """A matrix (C, C) applied to the channels of every row, shape (n, C, ...)."""
    if not x.size:
        return np.array(x, dtype=np.float64)
    return (whiten @ x.reshape(*x.shape[:2], -1)).reshape(x.shape) if x.ndim > 2 else x @ whiten.T


def whitened(whitening: Callable[[Array], Array], columns: Array) -> Array:
    """A cause's columns whitened, shape (n, C, k): some of its shapes have fewer parameters than others."""
    there = columns.any(axis=(0, 1))
    if there.all():
        return whitening(columns)
    out = np.zeros(columns.shape)
    out[..., there] = whitening(columns[..., there])
    return out

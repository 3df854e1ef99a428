"""Reduce the samples of a trial to rows, keep sparse columns as patches, and whiten rows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz, solve_triangular
from scipy.sparse import csc_array, csr_array, eye_array

from discrepancy.team.linear.signals import Signals
from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from estimator.quantisation import doubtful

PATCH_COLUMNS = 48
"""Columns of a latent state that one patch holds. Chosen: few calls against few stored zeros."""

PATCH_SHOWS = 1e-6
"""Size of a latent column over the largest, below which it is dropped. Chosen."""


@dataclass(frozen=True, eq=False)
class Patch:
    """A block of columns, restricted to the rows and channels where they are not zero.

    Attributes:
        rows: indices of the rows, increasing.
        first: first channel.
        values: shape (rows, C - first, k).
    """

    rows: NDArray[np.intp]
    first: int
    values: Array

    @cached_property
    def where(self) -> slice | NDArray[np.intp]:
        """The rows as an index. It is a slice, which copies nothing, if the rows are contiguous."""
        whole = len(self.rows) and self.rows[-1] - self.rows[0] + 1 == len(self.rows)
        return slice(int(self.rows[0]), int(self.rows[-1]) + 1) if whole else self.rows

    @property
    def flat(self) -> Array:
        """The values as a matrix, shape (rows (C - first), k)."""
        return self.values.reshape(-1, self.values.shape[2])


@dataclass(frozen=True, eq=False)
class Patches:
    """Sparse columns of one trial; their dense shape would be (n, C, k).

    Attributes:
        shape: n, C.
        each: patches of successive columns.
    """

    shape: tuple[int, int]
    each: tuple[Patch, ...] = ()

    @classmethod
    def of(cls, x: Array) -> Patches:
        """Make a patch from dense columns, shape (n, C, k)."""
        rows = np.flatnonzero(x.any(axis=(1, 2)))
        if not len(rows):
            return cls(x.shape[:2])
        first = int(np.argmax(x.any(axis=(0, 2))))
        return cls(x.shape[:2], (Patch(rows, first, np.ascontiguousarray(x[rows, first:])),))

    @property
    def width(self) -> int:
        """Number of columns k."""
        return sum(patch.values.shape[2] for patch in self.each)

    def beside(self, others: Iterable[Patches]) -> Patches:
        """Append columns of the same trial."""
        return Patches(self.shape, (*self.each, *(patch for other in others for patch in other.each)))

    def together(self, least: int = PATCH_COLUMNS) -> Patches:
        """Merge neighbouring patches until each holds at least ``least`` columns."""
        out: list[Patch] = []
        some: list[Patch] = []
        for patch in self.each:
            some.append(patch)
            if sum(p.values.shape[2] for p in some) >= least:
                out.append(_joined(some))
                some = []
        return Patches(self.shape, (*out, *([_joined(some)] if some else [])))

    def fewer(self) -> Patches:
        """Reduce the number of columns and keep the covariance that they imply.

        Independent unknowns of equal variance stay so under rotation. The rotation lets negligible columns be dropped,
        for example those of knots that are closer than the rows.
        """
        turned = [np.linalg.eigh(patch.flat.T @ patch.flat) for patch in self.each]
        most = max((squares[-1] for squares, _ in turned), default=0.0)
        pairs = zip(self.each, turned, strict=True)
        kept = ((patch, V[:, squares > PATCH_SHOWS**2 * most]) for patch, (squares, V) in pairs)
        each = (Patch(patch.rows, patch.first, patch.values @ V) for patch, V in kept if V.shape[1])
        return Patches(self.shape, tuple(each))


def _joined(patches: Sequence[Patch]) -> Patch:
    if len(patches) == 1:
        return patches[0]
    rows = np.unique(np.concatenate([patch.rows for patch in patches]))
    first, C = min(p.first for p in patches), patches[0].first + patches[0].values.shape[1]
    values = np.zeros((len(rows), C - first, sum(p.values.shape[2] for p in patches)))
    at = 0
    for patch in patches:
        stop = at + patch.values.shape[2]
        values[np.searchsorted(rows, patch.rows), patch.first - first :, at:stop] = patch.values
        at = stop
    return Patch(rows, first, values)


SHORTEST_HOLD_S = 1.2
"""Shortest duration of a hold, without its ends, that makes a row [s]. Chosen."""

SETTLING_S = 0.3
"""Time left out at both ends of a hold [s]. Chosen."""

HOLD_CUTOFF_HZ = 2.0
"""Cut-off of the joint speed that detects rest [Hz]. Chosen."""

STILL_RAD_PER_S = 1e-3
"""Joint speed below which a joint rests [rad/s]. Derived: 20 times the rounding noise below ``HOLD_CUTOFF_HZ``."""

TEAM_ROWS_HZ = 12.5
"""Rate of moving rows [Hz]. Chosen: with the cut-off it leaves filtered noise nearly white."""

TEAM_CUTOFF_HZ = 5.0
"""Cut-off of the filter before the rows [Hz]. Chosen."""

TOGETHER = 16
"""Moving rows computed by one dense matrix. Chosen: a larger matrix would mostly contain zeros."""


@dataclass(frozen=True, eq=False)
class Reduction:
    """Linear map from the samples of a trial to its rows; the same for residuals and columns.

    During motion the rows are the residual, filtered at 5 Hz and sampled at 12.5 Hz, so their noise is nearly white.
    During a hold an encoder repeats one rounding error for seconds, so the mean of a hold counts as one row. Shorter
    rests are left out. Rows are also left out if repeated readings may distort them by more than the noise.

    Attributes:
        operator: samples to rows, shape (n, Q); moving rows first.
        time: middle of every row [s], shape (n,).
        moving: number of rows in motion.
        step: samples between moving rows.
        sample: sample index of the middle of every row, shape (n,).
    """

    operator: csr_array
    time: Array
    moving: int
    step: int
    sample: NDArray[np.intp]

    @classmethod
    def none(cls, time: Array) -> Reduction:
        """Make every sample a row; ``time`` has shape (Q,) [s]."""
        return cls(csr_array(eye_array(len(time), format="csr")), time, len(time), 1, np.arange(len(time)))

    def __call__(self, x: Array) -> Array:
        """Reduce samples to rows, shape (Q, ...) -> (n, ...). Blocks of rows where the samples are zero are skipped."""
        flat = x.reshape(len(x), int(np.prod(x.shape[1:])))
        rows = np.zeros((len(self.time), flat.shape[1]))
        first, last = 0, self.moving
        if flat.size and not (flat[0].any() or flat[-1].any()):
            there = np.flatnonzero(flat.any(axis=1))
            first = np.searchsorted(self._last, there[:1], side="left").sum()
            last = np.searchsorted(self._first, there[-1:], side="right").sum()
        for at, start in self._blocks:
            if at.stop > first and at.start < last:
                count = at.stop - at.start
                band = self._band[:count, : self._band.shape[1] - (TOGETHER - count) * self.step]
                rows[at] = band @ flat[start : start + band.shape[1]]
        rows[self.moving :] = self._alone @ flat
        return rows.reshape(len(self.time), *x.shape[1:])

    @cached_property
    def _blocks(self) -> list[tuple[slice, int]]:
        """Blocks of at most ``TOGETHER`` consecutive moving rows, and the first sample of each block."""
        gaps = np.flatnonzero(np.diff(self.sample[: self.moving]) != self.step) + 1
        out = []
        for start, stop in pairwise([0, *gaps.tolist(), self.moving]):
            for row in range(start, stop, TOGETHER):
                out.append((slice(row, min(row + TOGETHER, stop)), int(self._first[row])))
        return out

    @cached_property
    def _band(self) -> Array:
        """Reduction of one block as a dense matrix, shape (TOGETHER, samples); much faster than a sparse one."""
        kernel = np.asarray(self.operator.data[: self.operator.indptr[1]], dtype=np.float64)
        return np.array(
            [np.pad(kernel, (k * self.step, (TOGETHER - 1 - k) * self.step)) for k in range(TOGETHER)]
        )

    @cached_property
    def _alone(self) -> csr_array:
        """Reduction to the rows of holds."""
        return self.operator[self.moving :]

    @cached_property
    def _first(self) -> NDArray[np.intp]:
        """First sample of every moving row, shape (moving,)."""
        return np.asarray(self.operator.indices[self.operator.indptr[: self.moving]], dtype=np.intp)

    @cached_property
    def _last(self) -> NDArray[np.intp]:
        """Last sample of every moving row, shape (moving,)."""
        return np.asarray(self.operator.indices[self.operator.indptr[1 : self.moving + 1] - 1], dtype=np.intp)

    def of_pieces(self, direction: Array, pieces: Iterable[tuple[slice, Array]]) -> Patches:
        """Reduce values that are not zero during an interval only.

        Args:
            direction: residual per unit value in every sample, shape (Q, C).
            pieces: samples of each interval, and k columns of values there, shape (s, k). Columns without effect are
                dropped.
        """
        blocks = ((at, direction[at, :, None] * values[:, None]) for at, values in pieces)
        return self.of_blocks(blocks, direction.shape[1])

    def of_blocks(self, blocks: Iterable[tuple[slice, Array]], channels: int) -> Patches:
        """Reduce residual samples that are not zero during an interval only.

        Args:
            blocks: samples of each interval, and the residual there, shape (s, C, k). Columns without effect are
                dropped.
            channels: C.
        """
        shape, each = (len(self.time), channels), []
        for at, samples in blocks:
            block = self._by_sample[:, at]
            rows, here = np.unique(block.indices, return_inverse=True)
            weights = np.zeros((len(rows), len(samples)))
            weights[here, np.repeat(np.arange(len(samples)), np.diff(block.indptr))] = block.data
            first = int(np.argmax(samples.any(axis=(0, 2))))
            samples = samples[:, first:]
            values = (weights @ samples.reshape(len(samples), -1)).reshape(-1, *samples.shape[1:])
            values = values[..., values.any(axis=(0, 1))]
            if values.size:
                each.append(Patch(rows, first, values))
        return Patches(shape, tuple(each)).together()

    @cached_property
    def _by_sample(self) -> csc_array:
        return csc_array(self.operator)

    @classmethod
    def of(cls, signals: Signals) -> Reduction:
        """Build the reduction of one trial from the motion of its joints."""
        rate, keep = signals.rate_hz, signals.keep
        kernel = _kernel(rate)
        half = len(kernel) // 2
        step = max(1, round(rate / TEAM_ROWS_HZ))
        holds, in_hold = _holds(signals)
        left_out = in_hold.copy()
        if signals.doubt is not None:
            left_out |= doubtful(signals.doubt, rate, TEAM_CUTOFF_HZ)
        rows, columns, values, sample = [], [], [], []
        first, last = max(keep.start, half), min(keep.stop, len(signals.time) - half)
        for centre in range(first, last, step):
            if not left_out[centre]:
                rows.append(np.full(len(kernel), len(sample)))
                columns.append(np.arange(centre - half, centre + half + 1))
                values.append(kernel)
                sample.append(centre)
        moving = len(sample)
        for start, stop in holds:
            rows.append(np.full(stop - start, len(sample)))
            columns.append(np.arange(start, stop))
            values.append(np.full(stop - start, 1.0 / (stop - start)))
            sample.append((start + stop - 1) // 2)
        shape = (len(sample), len(signals.time))
        join = [np.concatenate(part) if part else np.zeros(0) for part in (values, rows, columns)]
        operator = csr_array((join[0], (join[1].astype(int), join[2].astype(int))), shape=shape)
        index = np.array(sample, dtype=np.intp)
        return cls(operator, signals.time[index], moving, step, index)


def _kernel(rate_hz: float) -> Array:
    """Impulse response of the zero-phase filter, cut where it has decayed to 1e-4 of its peak."""
    half = round(0.8 * rate_hz)
    impulse = np.zeros(4 * half + 1)
    impulse[2 * half] = 1.0
    response = low_pass(impulse, rate_hz, TEAM_CUTOFF_HZ)[half : 3 * half + 1]
    return response / response.sum()


def _holds(signals: Signals) -> tuple[list[tuple[int, int]], NDArray[np.bool_]]:
    """Sample ranges during which all joints of all robots rest, and all samples at rest, shape (Q,)."""
    rate = signals.rate_hz
    # Rounding also moves a resting joint, but below 2 Hz only by a twentieth of the threshold.
    angles = np.concatenate([signals.phi, signals.theta], axis=1).reshape(len(signals.time), -1)
    speed = np.abs(differentiate(low_pass(angles, rate, HOLD_CUTOFF_HZ), rate)).max(axis=1)
    still = speed < STILL_RAD_PER_S
    keep = signals.keep
    still[: keep.start] = still[keep.stop :] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    settle, shortest = round(SETTLING_S * rate), round(SHORTEST_HOLD_S * rate)
    spans = [(start + settle, stop - settle) for start, stop in edges.reshape(-1, 2)]
    return [(start, stop) for start, stop in spans if stop - start >= shortest], still


SHRINKAGE_SHARE = 0.05
"""Least weight of the diagonal in the shrunk covariance of the channels. Chosen."""

LOUD_POWER = 2.25
"""Noise power over the median row's, above which a row gets its own weight. Derived: 4 standard errors of 24 draws."""

ROWS_PER_COEFFICIENT = 10
"""Least number of rows per autoregressive coefficient; shorter series are not whitened along time. Chosen."""

AR_ORDER = 2
"""Order of the autoregression, unless a rig says otherwise. Chosen: rows are nearly white already."""


@dataclass(frozen=True, eq=False)
class Whitening:
    """Whitening of rows: decorrelate the channels within each row, then each channel along time (autoregression).

    Attributes:
        moving: number of leading rows that form a time series; the others are independent.
        chol_moving, chol_alone: lower Cholesky factors of the channels' covariance, shape (C, C).
        ar: autoregressive coefficients of every decorrelated channel, shape (C, p).
        innovation: standard deviation of the autoregression's residual, shape (C,).
        loudness: noise standard deviation of every moving row over that of a typical row, shape (moving, C); or ones,
            shape (1, C).
    """

    moving: int
    chol_moving: Array
    chol_alone: Array
    ar: Array
    innovation: Array
    loudness: Array

    @classmethod
    def of(cls, draws: Array, moving: int, order: int = AR_ORDER, *, uneven: bool = False) -> Whitening:
        """Estimate the whitening from draws of the noise.

        Args:
            draws: residual rows of noise alone, shape (D, n, C).
            moving: number of leading rows that form a time series.
            order: order of the autoregression.
            uneven: whether to detect moving rows with more noise than the others and divide them by their own standard
                deviation. Such rows occur where motion begins, because resting encoders repeat a rounding error that
                the filter averages out later.
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
                ar[c] = solve_toeplitz(lag[:order, c], lag[1:, c])  # Yule-Walker equations
                innovation[c] = np.sqrt(max(lag[0, c] - ar[c] @ lag[1:, c], 1e-6))
        return cls(moving, chol_moving, chol_alone, ar, innovation, loudness)

    def __call__(self, x: Array) -> Array:
        """Whiten rows and channels, shape (n, C, ...) -> the same."""
        y = self.rows_only(x)
        y[: self.moving] = self._series(y[: self.moving])
        return y

    def _series(self, z: Array, start: int = 0, first: int = 0) -> Array:
        """Whiten moving rows along time.

        Args:
            z: rows with decorrelated channels; what precedes them is zero.
            start: index of the first row.
            first: index of the first channel.
        """
        shape = (1, -1) + (1,) * (z.ndim - 2)
        out, order = z.copy(), self.ar.shape[1]
        for k in range(order):
            out[k + 1 :] -= self.ar[first:, k].reshape(shape) * z[: len(z) - k - 1]
        # The first rows have no past that predicts them; they keep unit variance.
        early = max(order - start, 0)
        out[:early] = z[:early]
        out[early:] /= self.innovation[first:].reshape(shape)
        return out

    def of_patches(self, patches: Patches) -> Patches:
        """Whiten sparse columns."""
        return Patches(patches.shape, tuple(map(self._of_patch, patches.each)))

    def _of_patch(self, patch: Patch) -> Patch:
        moves, first = patch.rows < self.moving, patch.first
        alone, rows = patch.rows[~moves], patch.rows[moves]
        if len(rows):  # the autoregression also affects the rows that follow
            rows = np.arange(rows[0], min(rows[-1] + 1 + self.ar.shape[1], self.moving))
        series = np.zeros((len(rows), *patch.values.shape[1:]))
        series[patch.rows[moves] - patch.rows[0]] = patch.values[moves]
        if len(self.loudness) > 1:
            series /= self.loudness[rows, first:, None]
        # The factor is lower triangular: channels before the first stay zero.
        series = self._whiten_moving[first:, first:] @ series
        if len(rows):
            series = self._series(series, int(rows[0]), first)
        others = self._whiten_alone[first:, first:] @ patch.values[~moves]
        return Patch(np.concatenate([rows, alone]), first, np.concatenate([series, others]))

    def rows_only(self, x: Array) -> Array:
        """Decorrelate the channels of every row but not the rows, shape (n, C, ...) -> the same."""
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
    """Apply a matrix (C, C) to the channels of every row, shape (n, C, ...)."""
    if not x.size:
        return np.array(x, dtype=np.float64)
    return (whiten @ x.reshape(*x.shape[:2], -1)).reshape(x.shape) if x.ndim > 2 else x @ whiten.T


def whitened(whitening: Callable[[Array], Array], columns: Array) -> Array:
    """Whiten a cause's columns, shape (n, C, k), and skip those that are zero because a shape lacks the parameter."""
    there = columns.any(axis=(0, 1))
    if there.all():
        return whitening(columns)
    out = np.zeros(columns.shape)
    out[..., there] = whitening(columns[..., there])
    return out

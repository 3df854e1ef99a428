"""From 100 rows a second to nearly independent ones: low-pass and decimation in motion, one mean per hold."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, eye_array

from discrepancy.team.linear.patches import Patch, Patches
from discrepancy.team.linear.signals import Signals
from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from estimator.quantisation import doubtful

SHORTEST_HOLD_S = 1.2
"""Left of a hold, to be one row. Chosen."""

SETTLING_S = 0.3
"""Left out at both ends of a hold. Chosen."""

HOLD_CUTOFF_HZ = 2.0
"""Cut-off of the speed that tells rest. Chosen."""

STILL_RAD_PER_S = 1e-3
"""Joints slower than that rest. Derived: twenty times what rounding does below ``HOLD_CUTOFF_HZ``."""

TEAM_ROWS_HZ = 12.5
"""Chosen with the cut-off: it leaves filtered noise nearly white."""

TEAM_CUTOFF_HZ = 5.0
"""Cut-off of the rows. Chosen."""

TOGETHER = 16
"""Moving rows that are made at once; of more, a dense matrix would be zero for the most part."""


@dataclass(frozen=True, eq=False)
class Reduction:
    """A linear map from the samples of a trial to its rows, the same for residuals and all their columns.

    In motion the residual is filtered at 5 Hz and taken at 12.5 Hz, which leaves it nearly white. While
    everything rests, an encoder repeats one rounding error for seconds, so a hold counts as one row: its mean; rests
    too short for that are left out, and so is every row to which held readings may give more than noise does.

    Attributes:
        operator: rows from samples, shape (n, Q); moving rows first.
        time: middle of every row [s], shape (n,).
        moving: how many rows are in motion.
        step: samples between moving rows.
        sample: middle of every row, index into the samples, shape (n,).
    """

    operator: csr_array
    time: Array
    moving: int
    step: int
    sample: NDArray[np.intp]

    @classmethod
    def none(cls, time: Array) -> Reduction:
        """Every sample a row, times (Q,) in s."""
        return cls(csr_array(eye_array(len(time), format="csr")), time, len(time), 1, np.arange(len(time)))

    def __call__(self, x: Array) -> Array:
        """Reduce samples, shape (Q, ...) -> (n, ...); what is there for a while only takes as long as that."""
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
        """Moving rows that follow each other at once, ``TOGETHER`` at most, and the first sample of each such block."""
        gaps = np.flatnonzero(np.diff(self.sample[: self.moving]) != self.step) + 1
        out = []
        for start, stop in pairwise([0, *gaps.tolist(), self.moving]):
            for row in range(start, stop, TOGETHER):
                out.append((slice(row, min(row + TOGETHER, stop)), int(self._first[row])))
        return out

    @cached_property
    def _band(self) -> Array:
        """Such a block as a dense matrix, shape (TOGETHER, samples): several times as fast as a sparse one."""
        kernel = np.asarray(self.operator.data[: self.operator.indptr[1]], dtype=np.float64)
        return np.array(
            [np.pad(kernel, (k * self.step, (TOGETHER - 1 - k) * self.step)) for k in range(TOGETHER)]
        )

    @cached_property
    def _alone(self) -> csr_array:
        """Means of the holds, rows that stand alone."""
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
        """Rows of values that are there for a while each, as many columns as show in any.

        Args:
            direction: what a value of 1 is in the samples, shape (Q, C).
            pieces: samples of an interval, and k columns of values there, shape (s, k).
        """
        blocks = ((at, direction[at, :, None] * values[:, None]) for at, values in pieces)
        return self.of_blocks(blocks, direction.shape[1])

    def of_blocks(self, blocks: Iterable[tuple[slice, Array]], channels: int) -> Patches:
        """The same of samples of an interval with all their channels, shape (s, C, k)."""
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
        """Reduction of one trial, from where its joints move."""
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
    """Impulse response of the zero-phase filter, cut where it has died to 1e-4 of its peak."""
    half = round(0.8 * rate_hz)
    impulse = np.zeros(4 * half + 1)
    impulse[2 * half] = 1.0
    response = low_pass(impulse, rate_hz, TEAM_CUTOFF_HZ)[half : 3 * half + 1]
    return response / response.sum()


def _holds(signals: Signals) -> tuple[list[tuple[int, int]], NDArray[np.bool_]]:
    """Spans of samples during which no joint of any robot moves, and all samples at rest, shape (Q,)."""
    rate = signals.rate_hz
    # Rounding moves a resting joint too; below 2 Hz that is a twentieth of the threshold.
    angles = np.concatenate([signals.phi, signals.theta], axis=1).reshape(len(signals.time), -1)
    speed = np.abs(differentiate(low_pass(angles, rate, HOLD_CUTOFF_HZ), rate)).max(axis=1)
    still = speed < STILL_RAD_PER_S
    keep = signals.keep
    still[: keep.start] = still[keep.stop :] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    settle, shortest = round(SETTLING_S * rate), round(SHORTEST_HOLD_S * rate)
    spans = [(start + settle, stop - settle) for start, stop in edges.reshape(-1, 2)]
    return [(start, stop) for start, stop in spans if stop - start >= shortest], still

"""From samples to rows: the same low-pass for the residual and all its columns, then decimation."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from discrepancy.rules import serial as rules
from discrepancy.serial.rows.signals import Signals, smoothing_hz
from estimator.arrays import Array
from estimator.filtering import low_pass


@dataclass(frozen=True, eq=False)
class Reduction:
    """A linear map from the samples of one log to rows of its blocks.

    Attributes:
        filter: shape (rows, W).
        samples: middle of every row, per block, indices into the samples.
        step: samples between rows.
    """

    filter: csr_array
    samples: tuple[NDArray[np.intp], ...]
    step: int

    @classmethod
    def of(cls, signals: Signals, blocks: list[slice], channels: NDArray[np.intp]) -> Reduction:
        """Rows of blocks; one is left out where the filter would see an unusable sample of a channel's joint."""
        cutoff = signals.cutoff_hz
        kernel = _kernel(signals.rate_hz, cutoff)
        half = len(kernel) // 2
        step = max(1, round(signals.rate_hz / (rules.ROWS_RATIO * cutoff)))
        bad = ~signals.usable[:, channels].all(axis=1)
        spoilt = np.convolve(bad, np.ones(len(kernel)), mode="same") > 0.5
        centres = [np.arange(b.start + half, b.stop - half, step) for b in blocks]
        centres = [c[~spoilt[c]] for c in centres]
        every = np.concatenate([*centres, np.zeros(0, dtype=np.intp)]).astype(np.intp)
        columns = every[:, None] + np.arange(-half, half + 1)
        starts = np.arange(len(every) + 1) * len(kernel)
        weights = np.tile(kernel, len(every))
        matrix = csr_array((weights, columns.ravel(), starts), shape=(len(every), len(signals.time)))
        return cls(matrix, tuple(centres), step)

    def __call__(self, x: Array) -> list[Array]:
        """Rows of every block, shape (W, ...) -> (n, ...); what is nowhere but zero is not filtered."""
        flat = x.reshape(len(x), -1)
        rows = np.zeros((sum(len(s) for s in self.samples), flat.shape[1]))
        seen = np.flatnonzero(flat.any(axis=0))
        rows[:, seen] = self.filter @ np.ascontiguousarray(flat[:, seen])
        ends = np.cumsum([len(s) for s in self.samples])[:-1]
        return [part.reshape(len(part), *x.shape[1:]) for part in np.split(rows, ends)]

    def of_block(self, block: int, samples: slice) -> csr_array:
        """The map from the samples of one block, which are all that its rows see, to its rows."""
        starts = np.cumsum([0, *(len(s) for s in self.samples)])
        return self.filter[starts[block] : starts[block + 1], samples]


def _kernel(rate_hz: float, cutoff: float) -> Array:
    """The zero-phase filter's impulse response, odd length."""
    half = math.ceil(rules.HALF_PERIODS / cutoff * rate_hz)
    wide = np.zeros(8 * half + 17)
    middle = len(wide) // 2
    wide[middle] = 1.0
    kernel = low_pass(wide, rate_hz, cutoff)[middle - half : middle + half + 1]
    return np.asarray(kernel / kernel.sum())


def blocks(signals: Signals, logs: int = 1) -> list[slice]:
    """Samples of every block of a log: some seconds each, without the ends that smoothing spoils.

    Args:
        signals: of the log.
        logs: how many there are; all together have three blocks at least.
    """
    edge = math.ceil(rules.EDGE_PERIODS / smoothing_hz(signals.log.rate_hz) * signals.rate_hz)
    first, last = edge, len(signals.time) - edge
    count = max(
        math.ceil(rules.FEWEST_BLOCKS / logs), round((last - first) / signals.rate_hz / rules.BLOCK_S)
    )
    cuts = np.linspace(first, last, count + 1).astype(int)
    return [slice(int(a), int(b)) for a, b in itertools.pairwise(cuts)]

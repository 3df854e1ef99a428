"""From a thousand samples a second to rows: the same low-pass for the residual and all its columns, then decimation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import oaconvolve

from discrepancy import rules
from estimator.arrays import Array
from estimator.filtering import low_pass


@dataclass(frozen=True, eq=False)
class Reduction:
    """A linear map from samples to the rows of every block.

    Attributes:
        kernel: the zero-phase filter's impulse response, odd length.
        samples: middle of every row, per block, indices into the samples.
        step: samples between rows.
    """

    kernel: Array
    samples: tuple[NDArray[np.intp], ...]
    step: int

    @classmethod
    def of(cls, rate_hz: float, blocks: Sequence[slice], usable: NDArray[np.bool_]) -> Reduction:
        """Rows of blocks of samples; a row is left out where the filter would see an unusable sample."""
        half, step = round(rules.HALF_S * rate_hz), max(1, round(rate_hz / rules.EMPS_ROWS_HZ))
        wide = np.zeros(8 * half + 1)
        wide[4 * half] = 1.0
        kernel = low_pass(wide, rate_hz, min(rules.EMPS_CUTOFF_HZ, 0.15 * rate_hz))[3 * half : 5 * half + 1]
        # Differentiating smooths too, over about the edge's length.
        reach = half + round(0.1 * rules.EDGE_S * rate_hz)
        spoilt = np.convolve(~usable, np.ones(2 * reach + 1), mode="same") > 0.5
        rows = []
        for block in blocks:
            centres = np.arange(block.start + half, block.stop - half, step)
            rows.append(centres[~spoilt[centres]])
        return cls(kernel / kernel.sum(), tuple(rows), step)

    def __call__(self, x: Array) -> list[Array]:
        """Filter samples, shape (Q, ...), and take the rows of every block, shape (n, ...)."""
        flat = x.reshape(len(x), -1)
        smooth = oaconvolve(flat, self.kernel[:, None], mode="same", axes=0)
        return [smooth[rows].reshape(len(rows), *x.shape[1:]) for rows in self.samples]

    def of_block(self, block: int, x: Array, start: int) -> Array:
        """The rows of one block from its samples alone, shape (Q, k) -> (n, k).

        Args:
            block: which.
            x: samples of the block.
            start: the first of them.
        """
        smooth = oaconvolve(x, self.kernel[:, None], mode="same", axes=0)
        return smooth[self.samples[block] - start]

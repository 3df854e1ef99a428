"""Gaps and jitter of a robot's stamps."""

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from mocobot_logs.log import NS, Array, Stamps
from mocobot_logs.resample.grid import Grid

MOST_MISSING = 0.1
"""Largest share of samples that may be missing; the same for samples that crowd."""
_STAMP_S = 1e-6  # gaps are measured no finer


def beyond_s(interval_ns: Stamps, period_ns: float) -> Array:
    """How much longer than one period the intervals are in which samples are missing [s], 0 for the others."""
    return np.where(np.rint(interval_ns / period_ns) > 1, (interval_ns - period_ns) * NS, 0.0)


def is_hole(interval_ns: Stamps, period_ns: float, max_gap_s: float) -> NDArray[np.bool_]:
    """Whether intervals between stamps are too long to be filled."""
    return beyond_s(interval_ns, period_ns) > max_gap_s + _STAMP_S


class Tally:
    """Counts what the intervals between stamps say.

    Attributes:
        gaps, filled, longest_gap_s, jitter_max_s: as in ``StreamReport``.
    """

    def __init__(self, where: str, grid: Grid, max_gap_s: float) -> None:
        """``where`` names file and robot in messages; grid and gaps as in ``resample``.

        Where samples are many and uneven, no interval tells how many are missing, and none counts as missing.
        """
        self._uneven = grid.uneven
        self.gaps = self.filled = 0
        self.longest_gap_s = self.jitter_max_s = 0.0
        self._where, self._period_ns, self._max_gap_s = where, grid.period_ns, max_gap_s
        self._intervals, self._squares, self._span_ns = 0, 0.0, 0

    @property
    def jitter_rms_s(self) -> float:
        """As in ``StreamReport`` [s]."""
        return float(np.sqrt(self._squares / max(1, self._intervals)))

    def add(self, time_ns: Stamps) -> None:
        """Count the intervals between consecutive times after the first stamp [ns].

        Raises:
            InputError: one is too long.
        """
        interval = np.diff(time_ns)
        if not len(interval):
            return
        periods = np.maximum(np.rint(interval / self._period_ns), 1.0)
        if self._uneven:
            periods[:] = 1.0
        bad = np.flatnonzero(is_hole(interval, self._period_ns, self._max_gap_s))
        if len(bad):
            raise InputError(
                f"{self._where}: no samples for {interval[bad[0]] * NS:.6g} s, from "
                f"{time_ns[bad[0]] * NS:.9g} s after its first sample on; they usually come "
                f"{self._period_ns * NS:.6g} s apart, and at most {self._max_gap_s:g} s more may pass; "
                "rows with NaN or that repeat the one before count as missing (convert --split-at-gaps makes "
                "trials of the parts between gaps, --crop keeps one part)"
            )
        jitter_s = (interval - periods * self._period_ns) * NS
        self._intervals += len(interval)
        self._span_ns += int(np.sum(interval))
        self.filled += int(np.sum(periods - 1))
        self.gaps += int(np.sum(periods > 1))
        self.longest_gap_s = max(
            self.longest_gap_s, float(np.max(np.where(periods > 1, beyond_s(interval, self._period_ns), 0.0)))
        )
        self._squares += float(np.sum(jitter_s**2))
        self.jitter_max_s = max(self.jitter_max_s, float(np.max(np.abs(jitter_s))))

    def check(self, rows: int, merged: int) -> None:
        """Judge a stream's ``rows``, of which ``merged`` crowd.

        Raises:
            InputError: too many are missing, or crowd.
        """
        # Uneven stamps leave intervals that are long, and as many that are short; samples that are lost leave fewer.
        missing = min(self.filled, round(self._span_ns / self._period_ns) + 1 - rows)
        expected = rows + missing
        if missing > MOST_MISSING * expected:
            raise InputError(
                f"{self._where}: {missing} of {expected} samples are missing "
                f"({100 * missing / expected:.3g} %); at most {100 * MOST_MISSING:g} % may be "
                "(convert --crop keeps a part of the log)"
            )
        if merged > MOST_MISSING * rows:
            raise InputError(
                f"{self._where}: {merged} of {rows} samples come within a quarter of the usual "
                f"{self._period_ns * NS:.6g} s of the one before; at most {100 * MOST_MISSING:g} % may "
                "(does the rate change, or do stamps tell when messages arrived?)"
            )

"""From a robot's rows to evenly spaced samples, block by block, whatever pieces the rows come in."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

from estimator.recording.metadata import Method
from mocobot_logs.log import NS, Array, Stamps
from mocobot_logs.resample.fill import fill_gaps, polynomial_weights, side

BLOCK = 4096
_DECAY = 48  # rows; in a quintic spline a sample's weight falls by 0.43 per row, to 1e-18 here
TOLERANCE_NS = 1000
"""Stamps this close to the grid are on it: time that is read from decimals or floats is no more exact."""
_DEGREE = 5


@dataclass(frozen=True)
class Grid:
    """Evenly spaced instants after a robot's first stamp.

    Attributes:
        spacing_ns: of the instants [ns].
        period_ns: of the robot's samples [ns].
        fits: whether the samples lie on the grid, with ``period_ns`` equal to ``spacing_ns``.
        fitted_rows: so many nearest samples, to which a polynomial is fitted at every instant; 0 for a spline through
            all samples. A spline through samples of which some are a moment apart would swing with their noise.
        uneven: whether intervals scatter so that none tells how many samples are missing.
    """

    spacing_ns: float
    period_ns: float
    fits: bool = False
    fitted_rows: int = 0
    uneven: bool = False

    @property
    def method(self) -> Method:
        """What is done to samples that do not fit."""
        return "fitted" if self.fitted_rows else "interpolated"

    def holds(self, time_ns: Stamps) -> bool:
        """Whether all times [ns] are within ``TOLERANCE_NS`` of instants of the grid, no two at the same."""
        index = self.index(time_ns)
        off = np.abs(time_ns - index * self.spacing_ns)
        return bool(np.all(off <= TOLERANCE_NS + 0.5) and np.all(np.diff(index) > 0))

    def index(self, time_ns: Stamps) -> Stamps:
        """The nearest instants' numbers."""
        return np.rint(time_ns / self.spacing_ns).astype(np.int64)


class Interpolator:
    """Fills gaps and interpolates onto a grid.

    Blocks of ``BLOCK`` rows are worked on with enough rows on either side that the result is that of the whole
    stream, to rounding. Where blocks begin depends on the rows alone, so that the pieces in which they come
    change nothing at all.
    """

    def __init__(self, grid: Grid, max_gap_s: float) -> None:
        """Gaps are at most ``max_gap_s`` beyond one period [s]."""
        self._grid = grid
        self._around = _DECAY + grid.fitted_rows + 2 * side(math.ceil(max_gap_s / NS / grid.period_ns))
        self._time: list[Stamps] = []
        self._values: list[Array] = []
        self._rows = 0
        self._done = 0  # rows at the beginning of the buffer whose samples are given out
        self._next = 0  # number of the next instant

    def push(self, time_ns: Stamps, values: Array) -> list[Array]:
        """Blocks that are complete now, each (n, C), after the next rows."""
        self._time.append(time_ns)
        self._values.append(values)
        self._rows += len(time_ns)
        blocks = []
        while self._rows - self._done >= BLOCK + self._around:
            self._join()
            blocks.append(self._block(self._done + BLOCK))
            self._done += BLOCK
            drop = max(0, self._done - self._around)
            self._time, self._values = [self._time[0][drop:]], [self._values[0][drop:]]
            self._rows, self._done = self._rows - drop, self._done - drop
        return blocks

    def finish(self) -> Array:
        """The last block."""
        self._join()
        return self._block(self._rows)

    def _join(self) -> None:
        self._time, self._values = [np.concatenate(self._time)], [np.concatenate(self._values)]

    def _block(self, end: int) -> Array:
        """Samples at the instants from the last block's end to before row ``end``, or to the last row's."""
        grid, rows = self._grid, slice(0, end + self._around)
        time_ns, values = self._time[0][rows], self._values[0][rows]
        instants = np.arange(self._next, self._before(end))
        self._next += len(instants)
        if grid.fits:
            index = grid.index(time_ns)
            filled = fill_gaps(index.astype(float), values, np.diff(index) - 1)[1]
            return filled[instants - index[0]]
        time = (time_ns - time_ns[0]) / grid.period_ns
        at = (instants * grid.spacing_ns - time_ns[0]) / grid.period_ns
        if grid.fitted_rows:
            return _fitted(time, values, np.clip(at, time[0], time[-1]), grid.fitted_rows)
        missing = np.maximum(np.rint(np.diff(time)).astype(np.int64) - 1, 0)
        knots, filled = fill_gaps(time, values, missing)
        spline = make_interp_spline(knots, filled, k=_DEGREE)
        return spline(np.clip(at, knots[0], knots[-1]))

    def _before(self, end: int) -> int:
        """Number of the first instant that is not before row ``end``, or after the last row."""
        time_ns = self._time[0]
        if end == len(time_ns):
            at = time_ns[-1] / self._grid.spacing_ns
            return 1 + (round(at) if self._grid.fits else math.floor(at + 1e-6))
        at = time_ns[end] / self._grid.spacing_ns
        return round(at) if self._grid.fits else math.ceil(at)


def fitted_rows(native_hz: float, rate_hz: float) -> int:
    """How many uneven samples of ``native_hz`` a polynomial is fitted to: those of three output periods.

    That is flat below a fifth of the output rate. Fewer would count each sample by the time around it: twelve leave
    twice the noise of even samples (a spline, with 0.7 ms of jitter at 1 kHz, seven times).
    """
    return max(12, round(3.0 * native_hz / rate_hz))


def _fitted(time: Array, values: Array, at: Array, width: int) -> Array:
    """Values at instants, shape (n, C), of polynomials of degree 5 through the ``width`` nearest rows."""
    width = min(width, len(time))
    first = np.clip(np.searchsorted(time, at) - width // 2, 0, len(time) - width)
    rows = first[:, None] + np.arange(width)
    weights = polynomial_weights(time[rows], at[:, None], _DEGREE)[:, 0]
    return np.einsum("nw,nwc->nc", weights, values[rows], optimize=True)

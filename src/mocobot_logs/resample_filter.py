"""Interpolate a stream onto a fine grid, low-pass it against aliasing, and decimate it.

Let r be the output rate. A stream whose stamps lie on the grid of k r (k an integer) needs no interpolation. Every
other stream is interpolated by a quintic spline onto k r. k r is at least three times the native rate, or just above
the native rate if that is 5 r or more.

A spline is no perfect interpolator. A tone of frequency f leaves images at n native +- f, attenuated by the sixth
power of sinc(frequency / native). An image near a multiple of k r aliases to a low frequency. With these k, all
aliases below 0.2 r are attenuated by 88 dB or more, for evenly spaced samples and native rates from 0.5 r. For slower
streams this does not hold, since their images begin below 0.2 r.

The spline's own relative error for a tone of 5 Hz is 3e-8 at a rate of 100 Hz, 2e-6 at 50 Hz and 3e-4 at 25 Hz. For
19 Hz at 100 Hz it is 2e-4.

Uneven samples resolve fast signals less well. Example: a native rate of 1 kHz, with stamps off by 10 % of a period. A
tone at 0.3 of the native rate leaves 4e-4 of its amplitude below 0.18 r; one at 0.49 leaves 3 %.

For k > 1, a linear-phase FIR filter with its delay removed follows, then every k-th sample is kept. The filter is
flat to 5e-6 below 0.2 r and below -108 dB from 0.5 r, so nothing above half the output rate aliases.

Before interpolation, rows that are too close are averaged (``Merger``) and missing samples are filled (``fill_gaps``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.signal import firwin, kaiser_beta, kaiserord, upfirdn

from estimator.recording.metadata import Sampling
from mocobot_logs.log import NS, Array, Stamps

PASS, STOP = 0.2, 0.5  # edges of the transition band over the output rate: 20 and 50 Hz at 100 Hz
RIPPLE_DB = 110.0
OVERSAMPLING, PLENTY, FITTED = 3.0, 5.0, 10.0
_ROUND = 0.01  # relative clock error that needs no finer grid


def fineness(native_hz: float, rate_hz: float, *, fitted: bool = False) -> int:
    """Return k of the grid k ``rate_hz`` onto which a stream of ``native_hz`` is interpolated or ``fitted``."""
    ratio = native_hz / rate_hz
    if fitted:  # already smooth
        ratio = min(ratio, FITTED)
    return max(1, math.ceil((ratio if ratio >= PLENTY else OVERSAMPLING * ratio) * (1 - _ROUND)))


def low_pass_taps(k: int) -> Array:
    """Return the symmetric filter taps for k grid samples per output sample: 2 M + 1 taps, M a multiple of k."""
    length, _ = kaiserord(RIPPLE_DB, (STOP - PASS) / (k / 2))
    half = k * math.ceil(length / 2 / k)
    window: Any = ("kaiser", kaiser_beta(RIPPLE_DB))
    return np.asarray(firwin(2 * half + 1, (PASS + STOP) / 2, window=window, fs=k), dtype=float)


class Decimator:
    """Low-passes and decimates a stream in pieces; for k = 1 the stream is unchanged.

    Attributes:
        lead: number of output samples lost at each end, where the filter lacks input.
    """

    def __init__(self, k: int) -> None:
        self._k = k
        self._taps = low_pass_taps(k) if k > 1 else np.ones(1)
        self.lead = len(self._taps) // 2 // k
        self._kept: Array | None = None

    def push(self, fine: Array) -> Array:
        """Add samples of the fine grid (n, C) and return the complete output samples (m, C)."""
        if self._k == 1:
            return fine
        if self._kept is not None:
            fine = np.concatenate([self._kept, fine])
        length = len(self._taps)
        count = (len(fine) - length) // self._k + 1
        if count <= 0:
            self._kept = fine
            return fine[:0]
        self._kept = fine[count * self._k :].copy()
        return upfirdn(self._taps, fine, down=self._k, axis=0)[self.lead * 2 :][:count]


CROWDED = 0.25
"""Rows closer than this share of a period count as one sample, since a slope between them would be noise."""
_GAP_DEGREE = 7
_SIDE = 4  # samples on either side that suffice for a gap of one sample


def side(missing: int) -> int:
    """Return the number of samples on either side that the filling of a gap uses."""
    return max(_SIDE, missing + 2)


def fill_gaps(time: Array, values: Array, missing: NDArray[np.int64]) -> tuple[Array, Array]:
    """Insert missing samples, evenly spaced in each gap; return times and values.

    They lie on a polynomial of degree 7 through ``side`` samples before and after the gap. If these are more than
    eight, the polynomial is fitted by least squares. A spline would amplify noise in wide gaps; this fit has 0.8 to
    1.9 times the noise of one sample. Relative errors for a sine sampled at 100 Hz: at 1 Hz 4e-12 with one sample
    missing and 9e-9 with five. At 5 Hz they are 1.3e-6 and 3e-3.

    Args:
        time: times of the samples, strictly increasing, shape (q,); q at least 2.
        values: samples, shape (q, C).
        missing: number of missing samples after each sample but the last, shape (q - 1,).
    """
    gaps = np.flatnonzero(missing)
    if not len(gaps):
        return time, values
    at, filled = [], []
    for count in np.unique(missing[gaps]):
        where = gaps[missing[gaps] == count]
        width = min(2 * side(int(count)), len(time))
        first = np.clip(where + 1 - width // 2, 0, len(time) - width)
        rows = first[:, None] + np.arange(width)
        nodes = time[rows]
        step = (time[where + 1] - time[where]) / (count + 1)
        targets = time[where, None] + step[:, None] * np.arange(1, count + 1)
        weights = polynomial_weights(nodes, targets, _GAP_DEGREE)
        at.append(targets.ravel())
        filled.append((weights @ values[rows]).reshape(-1, values.shape[1]))
    time = np.concatenate([time, *at])
    order = np.argsort(time, kind="stable")
    return time[order], np.concatenate([values, *filled])[order]


def polynomial_weights(nodes: Array, targets: Array, degree: int) -> Array:
    """Return weights of samples at ``nodes`` (g, w) for the values at ``targets`` (g, m), shape (g, m, w).

    They evaluate the least-squares polynomial of ``degree``, or less if there are too few nodes.
    """
    centre, half = (nodes[:, :1] + nodes[:, -1:]) / 2, (nodes[:, -1:] - nodes[:, :1]) / 2
    degree = min(degree, nodes.shape[1] - 1)
    V = legvander((nodes - centre) / half, degree)  # (g, w, K), well conditioned
    P = legvander((targets - centre) / half, degree)  # (g, m, K)
    Q, R = np.linalg.qr(V)
    return P @ np.linalg.solve(R, np.swapaxes(Q, 1, 2))


class Merger:
    """Averages rows less than ``CROWDED`` periods after the previous row, chunk by chunk; ``merged`` counts them.

    A late callback followed by a punctual one gives two samples close together. A slope between them would be noise.
    """

    def __init__(self, period_ns: float) -> None:
        self.merged = 0
        self._least_ns = CROWDED * period_ns
        self._open: tuple[Stamps, Array] | None = None

    def push(self, time_ns: Stamps, values: Array) -> tuple[Stamps, Array]:
        """Add rows and return those that are complete; rows that later ones may still join are held back."""
        if self._open is not None:
            time_ns = np.concatenate([self._open[0], time_ns])
            values = np.concatenate([self._open[1], values])
        if not len(time_ns):
            return time_ns, values
        starts = np.concatenate([[0], 1 + np.flatnonzero(np.diff(time_ns) >= self._least_ns)])
        last = int(starts[-1])
        self._open = time_ns[last:], values[last:]
        return self._average(time_ns[:last], values[:last], starts[:-1])

    def finish(self) -> tuple[Stamps, Array]:
        if self._open is None:
            raise ValueError("nothing was pushed")
        return self._average(*self._open, np.array([0]))

    def _average(self, time_ns: Stamps, values: Array, starts: NDArray[np.int64]) -> tuple[Stamps, Array]:
        self.merged += len(time_ns) - len(starts)
        if len(time_ns) == len(starts):
            return time_ns, values
        count = np.diff(np.append(starts, len(time_ns)))
        late = time_ns - np.repeat(time_ns[starts], count)
        mean_ns = time_ns[starts] + np.add.reduceat(late, starts) // count
        return mean_ns, np.add.reduceat(values, starts, axis=0) / count[:, None]


BLOCK = 4096
_DECAY = 48  # rows; a quintic spline's weights fall by 0.43 per row, to 1e-18 here
TOLERANCE_NS = 1000
"""Largest distance from the grid of a stamp on it [ns]; times parsed from decimals or floats are no more exact."""
_DEGREE = 5


@dataclass(frozen=True)
class Grid:
    """Evenly spaced instants after a robot's first stamp."""

    spacing_ns: float  # spacing of the instants [ns]
    period_ns: float  # period of the robot's samples [ns]
    fits: bool = False  # whether the samples lie on the grid, with ``period_ns`` equal to ``spacing_ns``
    # number of nearest samples to which a polynomial is fitted at every instant; 0 for a spline through all samples. A
    # spline would amplify the noise of samples that are close together.
    fitted_rows: int = 0
    uneven: bool = False  # whether intervals scatter too much to reveal missing samples

    def holds(self, time_ns: Stamps) -> bool:
        """Return whether all times [ns] are within ``TOLERANCE_NS`` of distinct instants of the grid."""
        index = self.index(time_ns)
        off = np.abs(time_ns - index * self.spacing_ns)
        return bool(np.all(off <= TOLERANCE_NS + 0.5) and np.all(np.diff(index) > 0))

    def index(self, time_ns: Stamps) -> Stamps:
        return np.rint(time_ns / self.spacing_ns).astype(np.int64)


class Interpolator:
    """Fills gaps and interpolates onto a grid, in blocks of ``BLOCK`` rows with enough rows on either side.

    The result equals that of the whole stream up to rounding, and does not depend on how the rows are split.
    """

    def __init__(self, grid: Grid, max_gap_s: float) -> None:
        """``max_gap_s`` is the longest gap beyond one period [s]."""
        self._grid = grid
        self._around = _DECAY + grid.fitted_rows + 2 * side(math.ceil(max_gap_s / NS / grid.period_ns))
        self._time: list[Stamps] = []
        self._values: list[Array] = []
        self._rows = 0
        self._done = 0  # leading rows of the buffer that are already interpolated
        self._next = 0  # index of the next instant

    def push(self, time_ns: Stamps, values: Array) -> list[Array]:
        """Add rows and return the blocks that are complete, each (n, C)."""
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
        self._join()
        return self._block(self._rows)

    def _join(self) -> None:
        self._time, self._values = [np.concatenate(self._time)], [np.concatenate(self._values)]

    def _block(self, end: int) -> Array:
        """Return samples at the instants from the end of the last block up to row ``end``, or through the last row."""
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
        """Return the index of the first instant not before row ``end``, or after the last row."""
        time_ns = self._time[0]
        if end == len(time_ns):
            at = time_ns[-1] / self._grid.spacing_ns
            return 1 + (round(at) if self._grid.fits else math.floor(at + 1e-6))
        at = time_ns[end] / self._grid.spacing_ns
        return round(at) if self._grid.fits else math.ceil(at)


def fitted_rows(native_hz: float, rate_hz: float) -> int:
    """Return the number of uneven samples for a polynomial fit: those of three output periods, at least twelve.

    The fit is flat below a fifth of the output rate. With fewer samples, each would be weighted by the time around it.
    Twelve give twice the noise of even samples (a spline with 0.7 ms of jitter at 1 kHz gives seven times).
    """
    return max(12, round(3.0 * native_hz / rate_hz))


def _fitted(time: Array, values: Array, at: Array, width: int) -> Array:
    """Return values at instants, shape (n, C), of degree-5 polynomials fitted to the ``width`` nearest rows."""
    width = min(width, len(time))
    first = np.clip(np.searchsorted(time, at) - width // 2, 0, len(time) - width)
    rows = first[:, None] + np.arange(width)
    weights = polynomial_weights(time[rows], at[:, None], _DEGREE)[:, 0]
    return np.einsum("nw,nwc->nc", weights, values[rows], optimize=True)


def held_means(stamp_ns: Stamps, values: Array, at_ns: Array | Stamps, until_ns: Array | Stamps) -> Array:
    """Return means over intervals of values that hold until the next stamp, exact where none changes, shape (n, C).

    Args:
        stamp_ns: increasing times of the values [ns], shape (q,); q at least 1.
        values: shape (q, C).
        at_ns, until_ns: begin and end of the intervals [ns], shape (n,). The first value holds before its stamp, too.
    """
    first = np.maximum(np.searchsorted(stamp_ns, at_ns + TOLERANCE_NS, side="right") - 1, 0)
    last = np.maximum(np.searchsorted(stamp_ns, until_ns - TOLERANCE_NS, side="left") - 1, first)
    out = values[first]
    rows = np.flatnonzero(last > first)
    first, last, at_ns, until_ns = (x[rows] for x in (first, last, at_ns, until_ns))
    ends = np.append(stamp_ns[1:], np.iinfo(np.int64).max)
    out[rows] = 0.0
    for k in range(int(np.max(last - first, initial=-1)) + 1):
        now = np.minimum(first + k, last)
        span = np.minimum(ends[now], until_ns) - np.maximum(stamp_ns[now], at_ns)
        out[rows] += (np.where(first + k <= last, span, 0.0) / (until_ns - at_ns))[:, None] * values[now]
    return out


def on_grid(time_ns: Stamps, values: Array, grid: Grid, k: int) -> tuple[Array, int]:
    """Resample a whole stream at once: merge, fill, interpolate, low-pass, keep every ``k``-th instant of the grid.

    Returns output samples (Q, C) from samples (q, C) at times after the first row [ns], and ``Decimator.lead``.
    """
    if not (grid.fits or grid.fitted_rows):
        merger = Merger(grid.period_ns)
        (time_ns, values), (last_ns, last) = merger.push(time_ns, values), merger.finish()
        time_ns, values = np.concatenate([time_ns, last_ns]), np.concatenate([values, last])
    interpolator = Interpolator(grid, float(np.max(np.diff(time_ns))) * NS)
    fine = np.concatenate([*interpolator.push(time_ns, values), interpolator.finish()])
    decimator = Decimator(k)
    return decimator.push(fine), decimator.lead


_MARGIN_S = 0.3  # time read before and after the recording to fill the low-pass [s]


@dataclass(frozen=True, eq=False)
class Resampling:
    """Simulates how one robot's readings become samples of a recording, as ``Sampling`` describes it.

    Jitter and gaps are random; the processing is that of ``resample`` and ``one_clock``.
    """

    instants_ns: Stamps  # times of the readings in the recording's time [ns], shape (q,)
    # grid, thinned: fine grid and decimation, see ``on_grid``
    grid: Grid
    thinned: int
    # rate_hz, samples: rate [Hz] and number of samples of the recording
    rate_hz: float
    samples: int

    @classmethod
    def of(cls, sampling: Sampling, rate_hz: float, samples: int, rng: np.random.Generator) -> Resampling:
        """Draw random instants for a recording of ``samples`` at ``rate_hz`` [Hz]."""
        fits = sampling.method in ("untouched", "filtered")
        native_hz, fitted = sampling.native_hz, sampling.method == "fitted"
        k = max(1, round(native_hz / rate_hz)) if fits else fineness(native_hz, rate_hz, fitted=fitted)
        spacing_s = 1.0 / (k * rate_hz)
        period_s = spacing_s if fits else 1.0 / native_hz
        before = np.ceil((sampling.first_s + _MARGIN_S) / period_s)
        count = int(np.ceil((samples / rate_hz + 2 * _MARGIN_S) / period_s)) + 2
        at = sampling.first_s + (np.arange(count) - before) * period_s
        if not fits:
            at = _jittered(at, sampling.jitter_s, rng)
        kept = rng.uniform(size=count) >= sampling.missing
        kept[[0, -1]] = True
        grid = Grid(spacing_s / NS, period_s / NS, fits, fitted_rows(native_hz, rate_hz) if fitted else 0)
        return cls(np.rint(at[kept] / NS).astype(np.int64), grid, k, rate_hz, samples)

    @property
    def instants(self) -> Array:
        """Times of the readings in the recording's time [s], shape (q,)."""
        return np.asarray(self.instants_ns * NS, dtype=np.float64)

    def __call__(self, values: Array) -> Array:
        """Return the recording's samples from readings at ``instants``, shape (q, C) -> (Q, C)."""
        time_ns = self.instants_ns - self.instants_ns[0]
        own, lead = on_grid(time_ns, values, self.grid, self.thinned)
        first_s = self.instants_ns[0] * NS + lead / self.rate_hz
        at = np.arange(self.samples) - first_s * self.rate_hz
        whole = np.rint(at).astype(np.int64)
        if np.all(np.abs(at - whole) <= TOLERANCE_NS * NS * self.rate_hz):
            return own[whole]
        return make_interp_spline(np.arange(len(own)), own, k=5)(at)


def _jittered(at: Array, jitter_s: float, rng: np.random.Generator) -> Array:
    """Return jittered instants in order, whose intervals scatter by sqrt(2) times ``jitter_s`` [s].

    Sorting reduces jitter that is as large as a period; larger jitter is drawn to compensate.
    """
    draw = rng.standard_normal(len(at))
    drawn_s, wanted_s = jitter_s, np.sqrt(2.0) * jitter_s
    for _ in range(8):
        left_s = float(np.std(np.diff(np.sort(at + drawn_s * draw))))
        if left_s > 0.98 * wanted_s:
            break
        drawn_s *= wanted_s / left_s
    return np.sort(at + drawn_s * draw)

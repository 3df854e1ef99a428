"""What a conversion makes of the sensors' errors: drawn where samples were read, and sent the same way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

from estimator.recording.metadata import Sampling
from mocobot_logs.log import NS, Array, Stamps
from mocobot_logs.resample.fill import Merger
from mocobot_logs.resample.filter import Decimator, fineness
from mocobot_logs.resample.grid import TOLERANCE_NS, Grid, Interpolator, fitted_rows

_MARGIN_S = 0.3
"""Read before and after the recording, so that the low-pass is filled [s]."""


@dataclass(frozen=True, eq=False)
class Resampling:
    """The way from one robot's readings to its samples in a recording, as far as ``Sampling`` tells it.

    Jitter and gaps are drawn; the way itself is that of ``resample`` and ``one_clock``.

    Attributes:
        instants_ns: when samples are read, in the recording's time [ns], shape (q,).
        grid: onto which they are brought.
        thinned: so many samples of the grid make one of the recording.
        rate_hz: of the recording [Hz].
        samples: of the recording.
    """

    instants_ns: Stamps
    grid: Grid
    thinned: int
    rate_hz: float
    samples: int

    @classmethod
    def of(cls, sampling: Sampling, rate_hz: float, samples: int, rng: np.random.Generator) -> Resampling:
        """Draw one; the recording has ``samples`` at ``rate_hz`` [Hz]."""
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
        """When samples are read, in the recording's time [s], shape (q,)."""
        return np.asarray(self.instants_ns * NS, dtype=np.float64)

    def __call__(self, values: Array) -> Array:
        """Samples of the recording from readings at ``instants``, shape (q, C) -> (Q, C)."""
        time_ns = self.instants_ns - self.instants_ns[0]
        if not (self.grid.fits or self.grid.fitted_rows):
            merger = Merger(self.grid.period_ns)
            (time_ns, values), (last_ns, last) = merger.push(time_ns, values), merger.finish()
            time_ns, values = np.concatenate([time_ns, last_ns]), np.concatenate([values, last])
        interpolator = Interpolator(self.grid, float(np.max(np.diff(time_ns))) * NS)
        fine = [*interpolator.push(time_ns, values), interpolator.finish()]
        decimator = Decimator(self.thinned)
        own = decimator.push(np.concatenate(fine))
        first_s = self.instants_ns[0] * NS + decimator.lead / self.rate_hz
        at = np.arange(self.samples) - first_s * self.rate_hz
        whole = np.rint(at).astype(np.int64)
        if np.all(np.abs(at - whole) <= TOLERANCE_NS * NS * self.rate_hz):
            return own[whole]
        return make_interp_spline(np.arange(len(own)), own, k=5)(at)


def _jittered(at: Array, jitter_s: float, rng: np.random.Generator) -> Array:
    """Instants off their even places, still in order, whose intervals scatter by sqrt(2) times ``jitter_s`` [s].

    Where jitter is as large as a period, putting them in order leaves less of it: more is drawn.
    """
    draw = rng.standard_normal(len(at))
    drawn_s, wanted_s = jitter_s, np.sqrt(2.0) * jitter_s
    for _ in range(8):
        left_s = float(np.std(np.diff(np.sort(at + drawn_s * draw))))
        if left_s > 0.98 * wanted_s:
            break
        drawn_s *= wanted_s / left_s
    return np.sort(at + drawn_s * draw)

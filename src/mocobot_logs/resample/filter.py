"""The anti-alias rule: how finely a stream is interpolated, and the low-pass before samples are left out.

Let r be the output rate. A stream whose stamps lie on the grid of k r, k whole, has that grid already. Every other
stream is interpolated by a quintic spline onto k r, with k r at least three times the native rate, or just above
it from 5 r on. A spline is no perfect interpolator: a tone of frequency f leaves images at n native +- f, weaker by
the sixth power of sinc(frequency / native), and an image near a multiple of k r folds to a low frequency. With these
k, all that ends up below 0.2 r and does not belong there is weaker by 88 dB or more, for evenly spaced samples and
every native rate from 0.5 r on. Slower streams have no such promise: their images begin below 0.2 r. The spline
itself takes 3e-8 from a tone of 5 Hz sampled at 100 Hz, 2e-6 at 50 Hz and 3e-4 at 25 Hz; from 19 Hz at 100 Hz, 2e-4.
Uneven samples say less about fast signals: with stamps 10 % of a period off their places, a tone at 0.3 of a native
rate of 1 kHz leaves 4e-4 of its amplitude below 0.18 r, one at 0.49 leaves 3 %.

Then, for k > 1, a linear-phase FIR filter, its delay taken out, and every k-th sample: flat to 5e-6 below 0.2 r,
weaker than -108 dB from 0.5 r on, so that nothing above half the output rate folds to anywhere.
"""

import math
from typing import Any

import numpy as np
from scipy.signal import firwin, kaiser_beta, kaiserord, upfirdn

from mocobot_logs.log import Array

PASS, STOP = 0.2, 0.5
"""Edges of the transition band over the output rate: 20 and 50 Hz at 100 Hz."""
RIPPLE_DB = 110.0
OVERSAMPLING, PLENTY, FITTED = 3.0, 5.0, 10.0
_ROUND = 0.01  # a clock that runs fast by this share asks for no finer grid


def fineness(native_hz: float, rate_hz: float, *, fitted: bool = False) -> int:
    """k of the grid k ``rate_hz`` onto which a stream of ``native_hz`` is interpolated or ``fitted``."""
    ratio = native_hz / rate_hz
    if fitted:  # smooth already
        ratio = min(ratio, FITTED)
    return max(1, math.ceil((ratio if ratio >= PLENTY else OVERSAMPLING * ratio) * (1 - _ROUND)))


def low_pass_taps(k: int) -> Array:
    """Taps of the filter on the grid of k samples per output sample, symmetric, 2 M + 1 with M a multiple of k."""
    length, _ = kaiserord(RIPPLE_DB, (STOP - PASS) / (k / 2))
    half = k * math.ceil(length / 2 / k)
    window: Any = ("kaiser", kaiser_beta(RIPPLE_DB))
    return np.asarray(firwin(2 * half + 1, (PASS + STOP) / 2, window=window, fs=k), dtype=float)


class Decimator:
    """Low-pass and thin a stream piece by piece; for k = 1 it passes everything on as it is.

    Attributes:
        lead: output samples before the first one given out; as many are missing at the end. The filter would
            need samples from before the log for them.
    """

    def __init__(self, k: int) -> None:
        """Keep every k-th sample."""
        self._k = k
        self._taps = low_pass_taps(k) if k > 1 else np.ones(1)
        self.lead = len(self._taps) // 2 // k
        self._kept: Array | None = None

    def push(self, fine: Array) -> Array:
        """Output samples that are complete after the next samples of the fine grid, (n, C) -> (m, C)."""
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

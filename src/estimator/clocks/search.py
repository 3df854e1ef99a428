"""By how much one robot's clock may be off: where the courses of |omega| of two robots look alike."""

import numpy as np
from scipy.signal import correlate

from estimator.arrays import Array

CANDIDATES = 6
_AS_HIGH = 0.02
_MIN_OVERLAP = 0.5  # of the first signal
_STILL = 1e-9  # variance over the largest one that is rounding error of the transforms


def likely_lags(a: Array, b: Array, least: int, largest: int, near: float) -> list[int]:
    """Lags L at which b[n + L] looks most like a[n], the best first.

    The coefficient of correlation over the samples that overlap, as if only those existed (Padfield, "Masked
    object registration in the Fourier domain", IEEE Trans. Image Processing 2012, in one dimension), at its
    highest local maxima. Those that are as high as others to within 2 % come in the order of their distance from
    ``near``, so that motion that repeats itself does not crowd out what is likely.

    Args:
        a, b: samples at one rate, shapes (Q,) and (P,).
        least, largest: range of the lags.
        near: lag of clocks that agree.
    """
    lags = np.arange(1 - len(a), len(b))
    rho = _correlation(a, b)
    rho[(lags < least) | (lags > largest)] = -np.inf
    padded = np.concatenate([[-np.inf], rho, [-np.inf]])
    peaks = np.flatnonzero((rho > padded[:-2]) & (rho >= padded[2:]) & (rho > 0.0))
    grade = np.floor((rho[peaks].max(initial=0.0) - rho[peaks]) / _AS_HIGH)
    best = peaks[np.lexsort((np.abs(lags[peaks] - near), grade))][:CANDIDATES]
    return [int(lag) for lag in lags[best]]


def _correlation(a: Array, b: Array) -> Array:
    """Coefficient at every lag from 1 - Q to P - 1; -inf where too little overlaps or one signal rests."""
    a, b = a - a.mean(), b - b.mean()
    one_a, one_b = np.ones_like(a), np.ones_like(b)

    def sums(of_b: Array, of_a: Array) -> Array:
        return correlate(of_b, of_a, mode="full", method="fft")

    count = np.rint(sums(one_b, one_a))
    count[count < 1] = 1.0
    sum_a, sum_b = sums(one_b, a), sums(b, one_a)
    var_a = sums(one_b, a**2) - sum_a**2 / count
    var_b = sums(b**2, one_a) - sum_b**2 / count
    moving = (var_a > _STILL * var_a.max()) & (var_b > _STILL * var_b.max())
    usable = moving & (count >= _MIN_OVERLAP * min(len(a), len(b)))
    rho = np.full(len(count), -np.inf)
    both = sums(b, a) - sum_a * sum_b / count
    rho[usable] = both[usable] / np.sqrt(var_a[usable] * var_b[usable])
    return rho

"""One even grid of samples, from stamps that may miss some of it."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from discrepancy import rules
from estimator.arrays import Array
from estimator.errors import InputError


def on_grid(
    name: str, time: Array, series: Mapping[str, Array]
) -> tuple[Array, dict[str, Array], NDArray[np.bool_], list[str]]:
    """Stamps that start at 0, series without gaps, which samples are usable, and what there is to say about it.

    Args:
        name: of the file, for messages.
        time: stamps [s], shape (Q,).
        series: by name, shape (Q,); ``vir`` is held from one sample to the next, others are smooth.

    Raises:
        InputError: stamps that do not increase, or lie on no even grid, or miss more than 0.02 s; a recording that is
            too short or too slow.
    """
    step = np.diff(time)
    back = np.flatnonzero(step <= 0)
    if len(back):
        k = back[0]
        raise InputError(
            f"{name}: t goes from {time[k]:.6g} to {time[k + 1]:.6g} s at sample {k + 2}; it must increase"
        )
    period = _period(step)
    if 1.0 / period < rules.EMPS_LEAST_HZ:
        raise InputError(
            f"{name}: t has {1.0 / period:.4g} samples a second; differentiating twice "
            f"needs at least {rules.EMPS_LEAST_HZ:g}"
        )
    if time[-1] - time[0] < rules.EMPS_LEAST_S:
        raise InputError(
            f"{name}: is {time[-1] - time[0]:.3g} s long; a diagnosis needs at least {rules.EMPS_LEAST_S:g} s"
        )
    whole = np.round(step / period)
    off = np.abs(step - whole * period) > rules.JITTER_SHARE * period
    if off.any():
        k = int(np.argmax(off))
        raise InputError(
            f"{name}: t is not even: {step[k]:.6g} s pass before sample {k + 2}, no multiple of the {period:.6g} s "
            f"that are usual ({off.sum()} of {len(step)} steps are like that); resample it first"
        )
    at = np.concatenate([[0], np.cumsum(whole).astype(int)])
    period = float((time[-1] - time[0]) / at[-1])
    grid = np.arange(at[-1] + 1) * period
    missing = int(at[-1] + 1 - len(at))
    if not missing:
        return grid, dict(series), np.ones(len(grid), dtype=bool), []
    longest = float(whole.max() * period)
    if longest > rules.LONGEST_GAP_S + 0.5 * period:
        k = int(np.argmax(whole))
        raise InputError(
            f"{name}: {longest:.3g} s are missing from t = {time[k]:.6g} s on; gaps of up to {rules.LONGEST_GAP_S:g} s "
            "can be filled, so cut the recording there"
        )
    filled = {key: CubicSpline(grid[at], values)(grid) for key, values in series.items() if key != "vir"}
    filled |= {"vir": np.interp(grid, grid[at], series["vir"])}
    note = (
        f"{missing} of {len(grid)} samples are missing (longest gap {1e3 * longest:.3g} ms) and were interpolated; "
        "what is faster than the gaps is lost, the voltage's peaks first."
    )
    return grid, filled, np.ones(len(grid), dtype=bool), [note]


def _period(step: Array) -> float:
    """The grid's period: the smallest usual step, sharpened by all that are multiples of it."""
    least = float(np.quantile(step, 0.01))
    small = step[step < 1.5 * least]
    return float(np.median(small))

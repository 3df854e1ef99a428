"""What of a residual is noise: as loud as what does not repeat when the motion does, as coloured as what causes leave.

Weights must suit what will be left over. What no cause describes is larger than the sensors' noise and of another
colour; weighting by the sensors' noise alone would put trust in frequencies where the model has least. So the colour
is that of what the whole catalogue leaves, and the level that of the part of it that does not repeat. The position's
rounding is in both at its full size, since it is in the columns, too, and a fit would hide it by shrinking gains.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from discrepancy.emps.recording.axis_log import FIRST_GUESS_KG
from discrepancy.emps.recording.signals import Signals, smooth
from discrepancy.emps.reduction import Reduction
from discrepancy.least_squares.whitening import Whitening
from estimator.arrays import Array
from estimator.filtering import differentiate


@dataclass(frozen=True, eq=False)
class Noise:
    """Draws of the noise, and how large it is in the measured signals.

    Attributes:
        draws: rows of what all causes of the catalogue together leave, scaled to the noise's level, shape (D, n, 2).
        repeats: cycles of the same motion that the level comes from; 0 where the motion does not repeat and all of
            what is left counts as noise.
        position_m, voltage_V: standard deviations.
    """

    draws: Array
    repeats: int
    position_m: float
    voltage_V: float


def repeated(signals: Signals, period: int | None) -> bool:
    """Whether cycles of the reference are answered by the same motion."""
    if period is None:
        return False
    error = signals.log.reference - signals.log.position
    usable = signals.log.usable
    both = usable[period:] & usable[:-period]
    change = (error[period:] - error[:-period])[both]
    # A quantised position repeats but for where its steps fall.
    rounding = signals.log.step_m**2 / 6.0
    rms = np.sqrt(max(np.mean(change**2) - rounding, 0.0))
    return bool(rms < rules.REPEATED_SHARE * np.sqrt(np.mean(error[usable] ** 2)))


def from_repeats(left: list[Array], signals: Signals, reduction: Reduction, period: int, order: int) -> Noise:
    """Noise as loud as what differs between cycles, plus the position's rounding (which may repeat with the motion).

    Args:
        left: what the whole catalogue leaves, rows (n, 2) per block.
        signals, reduction: of the recording.
        period: of the cycles, samples.
        order: of the autoregression that the level is measured behind.
    """
    usable = signals.log.usable
    deviation, cycles = _deviations(signals.residual, period, usable)
    measured = np.column_stack([signals.log.position, signals.log.voltage])
    apart, _ = _deviations(measured, period, usable)
    rounding = _rounding(signals)
    rows = reduction(deviation + rounding)
    position, voltage = np.sqrt(np.mean(apart[usable] ** 2, axis=0))
    step = signals.log.step_m
    draws = draws_of([a + b for a, b in zip(left, reduction(rounding), strict=True)])
    white = Whitening.of(draws, draws.shape[1], order)
    level = np.sqrt(np.mean([np.mean(white(r)[order:] ** 2, axis=0) for r in draws_of(rows)], axis=0))
    return Noise(draws * level, cycles, float(np.hypot(position, step / np.sqrt(12.0))), float(voltage))


def from_remainder(left: list[Array], signals: Signals, reduction: Reduction) -> Noise:
    """Noise as all of what the whole catalogue leaves, rows (n, 2) per block, and the position's rounding."""
    step = signals.log.step_m
    high = signals.log.position - signals.x
    return Noise(
        draws_of([a + b for a, b in zip(left, reduction(_rounding(signals)), strict=True)]),
        0,
        float(np.hypot(np.std(high), step / np.sqrt(12.0))),
        float(np.sqrt(np.mean(np.concatenate(left)[:, 1] ** 2))),
    )


def draws_of(rows: list[Array]) -> Array:
    """Rows of blocks cut to one length, shape (D, n, 2)."""
    shortest = min(len(block) for block in rows)
    return np.stack([block[:shortest] for block in rows])


def _deviations(x: Array, period: int, usable: NDArray[np.bool_]) -> tuple[Array, int]:
    """What differs from the mean over cycles, scaled to the variance of one cycle, and the number of cycles."""
    phase = np.arange(len(x)) % period
    counts = np.bincount(phase, usable, minlength=period)
    out = np.empty_like(x)
    for k in range(x.shape[1]):
        mean = np.bincount(phase, x[:, k] * usable, minlength=period) / np.maximum(counts, 1)
        out[:, k] = x[:, k] - mean[phase]
    m = counts[phase]
    scale = np.where(m > 1, np.sqrt(m / np.maximum(m - 1, 1)), 0.0) * usable
    return out * scale[:, None], int(np.ceil(len(x) / period))


def dither(signals: Signals) -> Array:
    """A fresh draw of the position's rounding errors [m], shape (Q,); zero where it shows no steps."""
    step = signals.log.step_m
    return np.random.default_rng(rules.DITHER_SEED).uniform(-0.5 * step, 0.5 * step, len(signals.x))


def _rounding(signals: Signals) -> Array:
    """What a fresh draw of rounding errors of the position does to the nominal residual, shape (Q, 2)."""
    log = signals.log
    x = smooth(dither(signals), log.rate_hz)
    v = differentiate(x, log.rate_hz)
    return np.column_stack(
        [-FIRST_GUESS_KG * differentiate(v, log.rate_hz), log.kv_Vs_per_m * (log.kp_per_s * x + v)]
    )

"""Where to begin with a ripple's wavelength and a pulse train's timing: read off the data, judged later."""

import numpy as np
from scipy.signal import lombscargle

from discrepancy import rules
from discrepancy.emps.causes.base import Hints
from discrepancy.emps.causes.sliding import direction
from discrepancy.emps.pulse_search import pulse_train, rectangle
from discrepancy.emps.recording.signals import Signals, smooth
from discrepancy.emps.reduction import Reduction
from estimator.arrays import Array


def hints_of(signals: Signals, reduction: Reduction, period: int | None) -> Hints:
    """Hints from one recording, whose reference repeats after ``period`` samples, or does not."""
    v = signals.v
    known = np.column_stack([signals.a, direction(signals, rules.SLOW_MPS), v, np.abs(v), np.ones(len(v))])
    rows = np.concatenate(reduction(np.column_stack([signals.residual[:, 0], known, signals.x, v])))
    fitted = np.linalg.lstsq(rows[:, 1:6], rows[:, 0], rcond=None)[0]
    force = signals.residual[:, 0] - known[:, :-1] @ fitted[:-1]  # its constant may be the pulses' own
    left = rows[:, 0] - rows[:, 1:6] @ fitted
    voltage_train, force_train = _train(signals, signals.residual[:, 1]), _train(signals, force)
    law = np.column_stack([signals.error, v, signals.a])
    return Hints(
        _wavelength(rows[:, 6], np.abs(rows[:, 7]), left),
        voltage_train,
        force_train,
        _spread(signals, reduction, 1, law, voltage_train),
        _spread(signals, reduction, 0, known, force_train),
        None if period is None else period / signals.log.rate_hz,
    )


def _spread(
    signals: Signals, reduction: Reduction, channel: int, known: Array, train: dict[str, float]
) -> float:
    """Standard deviation of the rows of a channel that known columns and a train of rectangles leave."""
    on = rectangle(signals.log.time, **train)
    columns = np.column_stack([signals.residual[:, channel], known, smooth(on, signals.log.rate_hz)])
    rows = np.concatenate(reduction(columns))
    fitted = np.linalg.lstsq(rows[:, 1:], rows[:, 0], rcond=None)[0]
    return float(np.std(rows[:, 0] - rows[:, 1:] @ fitted))


def _train(signals: Signals, residual: Array) -> dict[str, float]:
    """Timing of the rectangles that fit best."""
    good = signals.log.usable & ~signals.log.saturated
    train = pulse_train(np.where(good, residual, np.median(residual)), signals.log.rate_hz)
    return {"start_s": train.start_s, "period_s": train.period_s, "width_s": train.width_s}


def _wavelength(x: Array, speed: Array, left: Array) -> float:
    """Wavelength [m] of the strongest line that mass and friction leave, seen along the way."""
    moving = speed > 0.2 * np.sqrt(np.mean(speed**2))
    x, left = x[moving], np.clip(left[moving], -3.0 * np.std(left), 3.0 * np.std(left))
    stroke = float(np.ptp(x))
    per_m = np.arange(2.0 / stroke, 1.0 / rules.SHORTEST_RIPPLE_M, 0.2 / stroke)
    power = np.asarray(lombscargle(x, left - left.mean(), 2.0 * np.pi * per_m))
    return float(1.0 / per_m[int(np.argmax(power))])

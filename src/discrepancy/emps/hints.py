"""Where to begin with a ripple's wavelength and a pulse train's timing: read off the data, judged later."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lombscargle

from discrepancy.emps.causes.base import Hints
from discrepancy.emps.causes.sliding import direction
from discrepancy.emps.pulse_search import pulse_train
from discrepancy.emps.reduction import Reduction
from discrepancy.emps.signals import Signals

Array = NDArray[np.float64]

SHORTEST_M = 5e-4
SLOW_MPS = 1e-3


def hints_of(signals: Signals, reduction: Reduction) -> Hints:
    """Hints from one recording."""
    train = pulse_train(np.where(signals.log.usable, signals.residual[:, 1], 0.0), signals.log.rate_hz)
    timing = {"start_s": train.start_s, "period_s": train.period_s, "width_s": train.width_s}
    return Hints(_wavelength(signals, reduction), timing)


def _wavelength(signals: Signals, reduction: Reduction) -> float:
    """Wavelength [m] of the strongest line that mass and friction leave, seen along the way."""
    v = signals.v
    columns = np.column_stack([signals.a, direction(signals, SLOW_MPS), v, np.abs(v), np.ones(len(v))])
    rows = np.concatenate(reduction(np.column_stack([signals.residual[:, 0], columns, signals.x, v])))
    y, A, x, speed = rows[:, 0], rows[:, 1:6], rows[:, 6], np.abs(rows[:, 7])
    left = y - A @ np.linalg.lstsq(A, y, rcond=None)[0]
    moving = speed > 0.2 * np.sqrt(np.mean(speed**2))
    x, left = x[moving], np.clip(left[moving], -3.0 * np.std(left), 3.0 * np.std(left))
    stroke = float(np.ptp(x))
    per_m = np.arange(2.0 / stroke, 1.0 / SHORTEST_M, 0.2 / stroke)
    power = np.asarray(lombscargle(x, left - left.mean(), 2.0 * np.pi * per_m))
    return float(1.0 / per_m[int(np.argmax(power))])

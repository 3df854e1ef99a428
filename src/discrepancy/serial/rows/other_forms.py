"""How the law of a cause at a joint may have another form: what its trace may be multiplied with, and what added."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from discrepancy.rules import serial as rules
from discrepancy.serial.rows.signals import Signals
from estimator.arrays import Array


@dataclass(frozen=True)
class OtherForms:
    """Of n rows, each of the order of 1.

    Attributes:
        times: factors of a cause's trace, shape (n,) each.
        besides: what comes beside it, as large as it is in the mean square, shape (n,) each.
    """

    times: list[Array]
    besides: list[Array]


def other_forms(signals: Signals, samples: NDArray[np.intp], at: int, family: str) -> OtherForms:
    """Ways in which a law at a joint may be another: with position, speed, direction, load, and the time since start.

    Args:
        signals: of the log.
        samples: which are the rows, shape (n,).
        at: the joint, from 0.
        family: of the cause. Torques by position may be any smooth function of it.
    """
    q, v = signals.q[:, at], signals.dq[samples, at] / signals.typical[at]
    low, high = float(q.min()), float(q.max())
    place = (2.0 * q[samples] - low - high) / max(high - low, 1e-12)
    when = 2.0 * (signals.time[samples] - signals.time[0]) / np.ptp(signals.time) - 1.0
    smooth = list(legvander(place, rules.FORM_DEGREE).T)
    fast, load = np.abs(v), np.abs(signals.inverse[:, at])
    load = load[samples] / max(float(np.sqrt(np.mean(load**2))), 1e-12)
    times = [
        *smooth[1:4],
        fast - 1.0,
        np.exp(-fast / rules.STRIBECK_SHARES[1]),
        np.clip(3.0 * v, -1.0, 1.0),
        load - 1.0,
        when,
    ]
    return OtherForms(times, smooth if family == "position_torque" else [])

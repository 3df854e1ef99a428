"""A train of rectangular pulses as the shape of a cause: ``start_s``, ``period_s``, ``width_s``."""

from typing import ClassVar, Literal

import numpy as np

from discrepancy import rules
from discrepancy.causes.base import Shape
from discrepancy.causes.numbers import Numbers
from discrepancy.emps.causes.base import Cause, filtered, force, voltage
from discrepancy.emps.pulse_search import rectangle
from estimator.arrays import Array


class Pulses(Cause):
    """Rectangular pulses that something adds.

    Attributes:
        adds_to: the channel.
    """

    family = "injection"
    separate = "The law's inputs and its output, logged separately."
    adds_to: ClassVar[Literal["force", "voltage"]]

    def columns(self, signals, shape):
        on = filtered(signals, rectangle(signals.log.time, **shape))
        return force(on) if self.adds_to == "force" else voltage(on)

    def visible(self, signals, hints, values):
        # Of all rectangles that were tried, the best always fits something.
        return abs(values[0]) > getattr(hints, f"{self.adds_to}_spread")

    def shapes(self, hints):
        return [dict(getattr(hints, f"{self.adds_to}_train"))]

    def finer(self, shape):
        """Trains whose pulses begin or end a sample earlier or later."""
        moves = [(name, off) for name in ("start_s", "width_s") for off in (-1e-3, 1e-3)]
        return [dict(shape) | {name: shape[name] + off} for name, off in moves]


def in_step(time: Array, cycle_s: float, shape: Shape) -> list[Shape]:
    """Trains that repeat with the motion, at places of it where a given train is on, as long or shorter.

    Args:
        time: of the samples [s], shape (Q,).
        cycle_s: after which the motion repeats itself.
        shape: of the given train.
    """
    step, on = shape["width_s"] / rules.PULSE_STEPS, time[rectangle(time, **shape) > 0.5]
    out = []
    for period in {cycle_s, cycle_s / max(1, round(cycle_s / shape["period_s"]))}:
        count = max(1, round(period / step))
        reached = np.bincount((on / period % 1.0 * count).astype(int) % count, minlength=count) > 0
        for first in np.flatnonzero(reached):
            for width in range(2, min(rules.PULSE_STEPS, count) + 1, 2):
                if reached[(first + np.arange(width)) % count].all():
                    timing = {"start_s": first / count * period - period, "period_s": period}
                    out.append(timing | {"width_s": width / count * period})
    return out


def train(n: Numbers) -> str:
    """When it is on."""
    start, period, width = (n.values[name] for name in ("start_s", "period_s", "width_s"))
    begin = f"from {start:.4g} s on" if start >= 0 else "since before the recording began"
    return f"rectangular pulses {begin}, every {period:.5g} s for {width:.4g} s"

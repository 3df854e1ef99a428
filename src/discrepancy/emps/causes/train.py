"""A train of rectangular pulses as the shape of a cause: ``start_s``, ``period_s``, ``width_s``."""

from __future__ import annotations

from discrepancy.causes.base import Shape
from discrepancy.causes.numbers import Numbers


def train(n: Numbers) -> str:
    """When it is on."""
    start, period, width = (n.values[name] for name in ("start_s", "period_s", "width_s"))
    begin = f"from {start:.4g} s on" if start >= 0 else "since before the recording began"
    return f"rectangular pulses {begin}, every {period:.5g} s for {width:.4g} s"


def sharper(shape: Shape) -> list[Shape]:
    """Trains whose pulses begin or end a sample earlier or later."""
    return [
        dict(shape) | {name: shape[name] + off} for name in ("start_s", "width_s") for off in (-1e-3, 1e-3)
    ]

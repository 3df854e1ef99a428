"""From where a robot is rolled out, and how far."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from discrepancy.candidate import Transient
from discrepancy.rules import rollouts as rules
from discrepancy.serial.rows.signals import Signals, smoothing_hz


@dataclass(frozen=True)
class Start:
    """A start in one block.

    Attributes:
        sample: of the signals, from 0.
        reach: samples for which everything is known.
    """

    sample: int
    reach: int


def usable(signals: Signals) -> NDArray[np.bool_]:
    """Samples whose torques and motion are known at all joints, with all that the smoothing has seen, shape (W,)."""
    margin = math.ceil(rules.EDGE_PERIODS / smoothing_hz(signals.log.rate_hz) * signals.rate_hz)
    bad = np.logical_not(signals.usable).any(axis=1)
    return ~(
        np.convolve(bad, np.ones(2 * margin + 1), mode="full")[margin : margin + len(signals.time)] > 0.5
    )


def without(signals: Signals, good: NDArray[np.bool_], events: Sequence[Transient]) -> NDArray[np.bool_]:
    """The same without the time in which events act: these are not simulated."""
    out = good.copy()
    for event in events:
        out &= (signals.time < event.start_s) | (signals.time > event.start_s + event.duration_s)
    return out


def starts(block: slice, good: NDArray[np.bool_], apart: int, longest: int, least: int) -> list[Start]:
    """Starts every so many samples of a block that reach at least some samples and stay inside.

    Args:
        block: samples of the block, from the first start on.
        good: samples of the log that can be used.
        apart: samples between starts.
        longest: samples of the longest rollout.
        least: of the shortest that is of use.
    """
    ends = np.append(np.flatnonzero(~good[block]), block.stop - block.start) + block.start
    out = []
    for a in range(block.start, block.stop, max(apart, 1)):
        reach = int(ends[np.searchsorted(ends, a)]) - a - 1  # the last sample before what cannot be used
        if reach >= least:
            out.append(Start(a, min(reach, longest)))
    return out

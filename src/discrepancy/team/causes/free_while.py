"""Signals behind a play, and what is free for a while."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array


def free_while(
    where: NDArray[np.bool_], rate_hz: float, knots_s: float, shortest_s: float = 0.0
) -> list[Array]:
    """Columns (Q,): per interval of ``where`` (Q,), straight lines between knots at most ``knots_s`` apart.

    Intervals shorter than ``shortest_s`` have none.
    """
    out = []
    for at, units in pieces_while(where, rate_hz, knots_s, shortest_s):
        for unit in units.T:
            column = np.zeros(len(where))
            column[at] = unit
            out.append(column)
    return out


def pieces_while(
    where: NDArray[np.bool_], rate_hz: float, knots_s: float, shortest_s: float = 0.0
) -> Iterator[tuple[slice, Array]]:
    """The same, interval by interval: its s samples, and its k columns there, shape (s, k)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(int))).reshape(-1, 2)
    for start, stop in edges:
        if stop - start < shortest_s * rate_hz:
            continue
        pieces = math.ceil((stop - start) / rate_hz / knots_s)
        knots, here = np.linspace(start, stop - 1, pieces + 1), np.arange(start, stop)
        yield (
            slice(start, stop),
            np.stack([np.interp(here, knots, unit) for unit in np.eye(pieces + 1)], axis=1),
        )


def in_parts(pieces: Iterator[tuple[slice, Array]], most: int) -> Iterator[tuple[slice, Array]]:
    """The same with at most so many columns at a time, and of the samples those between which they are not nought."""
    for at, values in pieces:
        for first in range(0, values.shape[1], most):
            some = values[:, first : first + most]
            there = np.flatnonzero(some.any(axis=1))
            here = slice(there[0], there[-1] + 1)
            yield slice(at.start + here.start, at.start + here.stop), some[here]


def played(x: Array, half_width: float) -> Array:
    """A signal (Q,) behind a play: it stays where it is until the signal is farther off than half the play's width.

    While the signal rises or falls without turning, only where it began matters: from turn to turn, not from sample to
    sample.
    """
    moves = np.flatnonzero(np.diff(x))  # where it does not stand still
    way = np.sign(np.diff(x)[moves])
    turns = moves[1:][way[1:] != way[:-1]]
    ends, at, starts = [*x[turns].tolist(), float(x[-1])], float(x[0]), []
    for end in ends:
        starts.append(at)
        at = min(max(at, end - half_width), end + half_width)
    counts = np.diff([0, *(turns + 1), len(x)])  # a turn ends the run before it
    start = np.repeat(starts, counts)
    return np.clip(start, x - half_width, x + half_width)

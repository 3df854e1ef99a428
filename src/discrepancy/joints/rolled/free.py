"""Free rollouts: from measured states under the logged torques, with the given model and with the extended one."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from discrepancy.evidence.findings import Event
from discrepancy.joints.rolled.robot import LoggedTorques, Robot
from discrepancy.joints.signals import Signals, smoothing_hz
from estimator.arrays import Array

HORIZONS_S = (0.1, 0.2, 0.5)
"""How far ahead a robot is rolled out. Chosen: from where friction tells to where an arm has turned round."""
MOST_STARTS = 60
"""Of rollouts in all trials together. Chosen: root mean squares are known to a tenth then, and it takes seconds."""
MOST_DIVERGED = 0.5
"""Share of the starts at which a joint may diverge for its error over the others to be told. Chosen: those left
are the easy ones."""
EDGE_PERIODS = 2.5
"""Usable samples before a start and after an end, in periods of the smoothing. Derived: its filter remembers that."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One trial, ready to be rolled out.

    Attributes:
        signals: smoothed.
        given: the model.
        found: with findings in it; None where MuJoCo refuses that.
        limit: how far off a joint may be before it has diverged [rad or m], shape (J,).
        events: that act in it; they are not simulated.
        tick: takes the time on the log's clock, at every step.
    """

    signals: Signals
    given: Robot
    found: Robot | None
    limit: Array
    events: Sequence[Event] = ()
    tick: Callable[[float], object] = lambda _: None

    def both(self, run: Callable[[Robot], Array], shape: tuple[int, ...]) -> tuple[Array, Array]:
        """What comes of the given model and of the extended one; NaN of one that MuJoCo refuses."""
        before = run(self.given)
        if self.found is self.given:
            return before, before
        return before, np.full(shape, np.nan) if self.found is None else run(self.found)


@dataclass(eq=False)
class Horizon:
    """Position errors so far ahead of all starts: of the given and of the extended model, one (J,) a start.

    NaN where a joint diverged.
    """

    seconds: float
    before: list[Array] = field(default_factory=list)
    after: list[Array] = field(default_factory=list)


def diverged(errors: Array) -> Array:
    """How often every joint diverged, shape (J,)."""
    return np.isnan(errors).sum(axis=0)


def rms(errors: Array) -> Array:
    """Root mean square by joint over the starts at which it did not diverge, shape (J,).

    NaN where it diverged at more than ``MOST_DIVERGED`` of them.
    """
    good = np.isfinite(errors)
    count = good.sum(axis=0)
    count = np.where(count >= (1.0 - MOST_DIVERGED) * len(errors), count, 0)
    square = np.sum(np.where(good, errors, 0.0) ** 2, axis=0)
    return np.sqrt(square / np.where(count, count, np.nan))


def in_neither(before: Array, after: Array) -> tuple[Array, Array, Array]:
    """Root mean squares over where a joint diverged in neither, and the share that is gone, shape (J,) each."""
    both = np.isfinite(before) & np.isfinite(after)
    first, second = (rms(np.where(both, errors, np.nan)) for errors in (before, after))
    return first, second, 1.0 - second / np.where(first > 0, first, np.nan)


def usable(s: Signals, events: Sequence[Event] = ()) -> NDArray[np.bool_]:
    """Samples whose torques and motion are known at all joints, with all that the smoothing has seen, shape (W,).

    Args:
        s: one trial.
        events: in whose time nothing is usable.
    """
    margin = math.ceil(EDGE_PERIODS / smoothing_hz(s.log.rate_hz) * s.rate_hz)
    bad = np.pad(np.logical_not(s.usable).any(axis=1), margin)  # the ends of a trial are not spoilt
    out = np.convolve(bad, np.ones(2 * margin + 1), mode="valid") < 0.5
    for event in events:
        out &= (s.time < event.start_s) | (s.time > event.start_s + event.duration_s)
    return out


def starts(
    good: NDArray[np.bool_], first: int, apart: int, longest: int, least: int
) -> list[tuple[int, int]]:
    """Starts every so many samples, and how many samples each of them reaches.

    Args:
        good: samples of a trial that can be used.
        first: sample of the first start.
        apart: samples between starts.
        longest: samples of the longest rollout.
        least: of the shortest that is of use.
    """
    ends = np.append(np.flatnonzero(~good), len(good))
    out = []
    for a in range(first, len(good), apart):
        reach = int(ends[np.searchsorted(ends, a)]) - a - 1  # the last sample before what cannot be used
        if reach >= least:
            out.append((a, min(reach, longest)))
    return out


def roll_freely(trial: Trial, horizons: Sequence[Horizon], passed_s: float, total_s: float) -> None:
    """Roll out from starts in one trial, and add the errors to the horizons.

    Args:
        trial: whose torques are known at all joints.
        horizons: from the shortest on.
        passed_s: how long the trials before it are: starts are as if all trials were one.
        total_s: how long all trials are.
    """
    s = trial.signals
    ahead = [max(1, round(h.seconds * s.rate_hz)) for h in horizons]
    apart = max(1, round(total_s / MOST_STARTS * s.rate_hz))
    good = usable(s, trial.events)
    logged = {id(r): LoggedTorques.of(s.log, r.readings) for r in (trial.given, trial.found) if r is not None}
    for first, reach in starts(good, -round(passed_s * s.rate_hz) % apart, apart, ahead[-1], ahead[0]):
        reached = [n for n in ahead if n <= reach]

        def run(robot: Robot, first: int = first, reached: Sequence[int] = reached) -> Array:
            piece = slice(first, first + reached[-1] + 1)
            return robot.errors(s, piece, logged[id(robot)], trial.limit, trial.tick)[list(reached)]

        before, after = trial.both(run, (len(reached), s.q.shape[1]))
        for horizon, a, b in zip(horizons, before, after, strict=False):
            horizon.before.append(a)
            horizon.after.append(b)

"""Free rollouts: from measured states under the logged torques, with the given model and with the extended one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from discrepancy.engine.explanation import Explanation
from discrepancy.rules import rollouts as rules
from discrepancy.serial.rig import SerialRig
from discrepancy.serial.rolled.fitted import Fitted, by_the_others, nominal, steps_per
from discrepancy.serial.rolled.readings import LoggedTorques
from discrepancy.serial.rolled.starts import starts, usable, without
from discrepancy.serial.rows.signals import Signals
from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.serial.rollout import Start, rollout


@dataclass(frozen=True, eq=False)
class Horizon:
    """Position errors so far ahead of all starts.

    Attributes:
        seconds: how far.
        before, after: simulated minus measured with the given and with the extended model [rad or m], shape (S, J); NaN
            where a joint diverged. After is None where nothing is named.
    """

    seconds: float
    before: Array
    after: Array | None

    def removed(self) -> Array:
        """Share of the rms error that is gone, by joint, over the starts at which it diverged in neither, shape (J,).

        NaN where those are too few, or nothing is named.
        """
        if self.after is None:
            return np.full(self.before.shape[1], np.nan)
        both = np.isfinite(self.before) & np.isfinite(self.after)
        before, after = (rms(np.where(both, errors, np.nan)) for errors in (self.before, self.after))
        return 1.0 - after / np.where(before > 0, before, np.nan)


def diverged(errors: Array) -> Array:
    """How often every joint diverged, shape (J,)."""
    return np.isnan(errors).sum(axis=0)


def rms(errors: Array) -> Array:
    """Root mean square by joint over the starts at which it did not diverge, shape (J,).

    NaN where it diverged at more than ``MOST_DIVERGED`` of them.
    """
    good = np.isfinite(errors)
    count = good.sum(axis=0)
    count = np.where(count >= (1.0 - rules.MOST_DIVERGED) * len(errors), count, 0)
    square = np.sum(np.where(good, errors, 0.0) ** 2, axis=0)
    return np.sqrt(square / np.where(count, count, np.nan))


@dataclass(frozen=True, eq=False)
class FreeRollouts:
    """What free rollouts say.

    Attributes:
        horizons: from the shortest on; those that no start reaches are not among them.
        left_out: labels of causes that were not simulated.
        refused: what MuJoCo said of extended models that it does not compile, by block.
    """

    horizons: tuple[Horizon, ...]
    left_out: tuple[str, ...]
    refused: tuple[str, ...]


def bounds(rig: SerialRig) -> Array:
    """How far off a joint may be before its rollout counts as diverged [rad or m], shape (J,)."""
    travel = np.max([np.ptp(part.signals.q, axis=0) for part in rig.parts], axis=0)
    extent = np.maximum(float(rig.model.model.stat.extent), travel)
    return np.where(rig.model.slides, extent, rules.DIVERGED_RAD)


def free_rollouts(rig: SerialRig, explanation: Explanation) -> FreeRollouts:
    """Roll out from starts in every block, with causes fitted to the other blocks.

    Args:
        rig: the logs; all joints have torques.
        explanation: what was found.
    """
    errors: dict[float, list[tuple[Array, Array]]] = {h: [] for h in rules.HORIZONS_S}
    left_out: dict[str, None] = {}
    refused: list[str] = []
    total = sum((b.stop - b.start) / part.signals.rate_hz for part in rig.parts for b in part.blocks)
    limit, passed = bounds(rig), 0.0
    for trial, (part, k) in enumerate(rig.block_of):
        s = part.signals
        every, ahead = steps_per(1.0 / s.rate_hz), _ahead(s.rate_hz)
        apart = max(1, round(total / rules.MOST_STARTS * s.rate_hz))
        first = -round(passed * s.rate_hz) % apart  # as if the blocks were one
        passed += (part.blocks[k].stop - part.blocks[k].start) / s.rate_hz
        block = slice(part.blocks[k].start + first, part.blocks[k].stop)
        if block.start >= block.stop:
            continue
        step_s = 1.0 / s.rate_hz / every
        given, found = nominal(rig, step_s), None
        try:
            found = by_the_others(rig, explanation, trial, step_s)
            left_out |= dict.fromkeys(found.left_out)
        except InputError as error:
            refused.append(f"{rig.trials[trial]}: {error}")
        good = without(s, usable(s), [] if found is None else found.events)
        for start in starts(block, good, apart, max(ahead.values()), min(ahead.values())):
            reach = [h for h, n in ahead.items() if n <= start.reach]
            at = np.array([ahead[h] for h in reach], dtype=np.intp)
            before, after = (
                _errors(s, which, start.sample, at, every, limit)
                if which
                else np.full((len(at), len(limit)), np.nan)
                for which in (given, found)
            )
            for h, a, b in zip(reach, before, after, strict=True):
                errors[h].append((a, b))
    named = bool(explanation.found)
    return FreeRollouts(tuple(_horizons(errors, named=named)), tuple(left_out), tuple(refused))


def _ahead(rate_hz: float) -> dict[float, int]:
    return {h: max(1, round(h * rate_hz)) for h in rules.HORIZONS_S}


def _horizons(errors: dict[float, list[tuple[Array, Array]]], *, named: bool) -> Iterator[Horizon]:
    for seconds, pairs in errors.items():
        if pairs:
            before, after = (np.array([pair[k] for pair in pairs]) for k in range(2))
            yield Horizon(seconds, before, after if named else None)


def _errors(s: Signals, robot: Fitted, first: int, at: NDArray[np.intp], every: int, limit: Array) -> Array:
    """Simulated minus measured positions at some samples after a start, shape (len(at), J); NaN once it diverged."""
    torques = LoggedTorques.of(s.log, robot.readings)
    start = Start(float(s.time[first]), s.q[first], s.dq[first], s.ddq[first])
    error = compared(start, robot, torques, s.q[first : first + at.max() + 1], every, limit)
    return error[at]


def compared(
    start: Start,
    robot: Fitted,
    drive: Callable[[float, Array, Array], Array],
    measured: Array,
    every: int,
    limit: Array,
) -> Array:
    """Simulated minus measured positions, shape (n, J); NaN of a joint from where it is off by more than it may.

    Args:
        start: where the robot is.
        robot: the model.
        drive: what its drives give.
        measured: positions from the start on, shape (n, J).
        every: steps of the integration between samples.
        limit: how far off it may be, shape (J,).
    """
    there = rollout(robot.built, start, drive, len(measured) - 1, every)
    error = np.full(measured.shape, np.nan)
    error[: len(there)] = there - measured[: len(there)]
    error[np.maximum.accumulate(~(np.abs(error) <= limit), axis=0)] = np.nan
    return error

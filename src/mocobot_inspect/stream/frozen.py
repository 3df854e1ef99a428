"""Stretches in which a channel is stuck, or clipped at an extreme, while the robot's other channels move."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from estimator.arrays import Array
from estimator.quantisation import quantisation_step
from mocobot_inspect.stream.noise import noise_level

STUCK_S = 0.2
"""Shortest time for which a channel must stand to be stuck. Measured on trials of 25 s: 0.1 s moves an estimate by up
to 3 of its standard errors, 0.2 s by up to 16 (inertia 2 %, grasps 4 mm), 2 s spoils it (mass 1 %, grasps 10 cm)."""
CLIPPED_SAMPLES = 5
"""Shortest run at an extreme to be clipped."""
_MOVES = 0.05  # others move: by this share of their range
_JUMP = 4.0  # times the usual large step from sample to sample
_CORNER = 0.3  # of the same
_NOISY = 0.5  # of the quantisation step; rounding alone looks like 0.3
_CHANCE = 1e-3  # a run that noise makes by chance in so many logs is no sign
_CLEAR = 1.5  # steps of the resolution; what approaches an end one by one may just be slow
_SPEED_S, _AT_SPEED = 0.1, 0.5  # time over which speed is taken; share of the usual high speed


@dataclass(frozen=True)
class Frozen:
    """One stretch.

    Attributes:
        kind: ``stuck`` or ``clipped``.
        channel: which channel, from 0.
        start, stop: rows, the last one not included.
        value: where it stands [SI].
        jumps: whether it jumps there or from there.
    """

    kind: Literal["stuck", "clipped"]
    channel: int
    start: int
    stop: int
    value: float
    jumps: bool = False


def frozen(values: Array, rate_hz: float) -> list[Frozen]:
    """Stuck and clipped stretches of one robot's channels.

    A channel that stands because nothing moves is not stuck; nor is one that rests while others move. A stuck one jumps
    when it comes back, stops dead before the log ends, or repeats itself
    although it has no steps or more noise than steps.

    Args:
        values: samples of the robot's channels, finite, shape (q, C).
        rate_hz: their rate [Hz].
    """
    found = []
    least = _least_travel(values)
    for channel in range(values.shape[1]):
        x = values[:, channel]
        steps = np.abs(np.diff(x))
        if not steps.any():
            if len(x) and _others_move(values, least, channel, 0, len(x), rate_hz):
                found.append(Frozen("stuck", channel, 0, len(x), float(x[0])))
            continue
        usual = float(np.quantile(steps[steps > 0], 0.95))
        repeats = _longest_by_chance(x) if np.mean(steps == 0) < 0.5 else np.inf
        for start, stop in _runs(x):
            if stop - start < CLIPPED_SAMPLES or not _others_move(
                values, least, channel, start, stop, rate_hz
            ):
                continue
            back = steps[stop - 1] if stop < len(x) else 0.0
            into = steps[start - 1] if start else 0.0
            jumps = bool(max(back, into) > _JUMP * usual)
            if stop - start >= max(STUCK_S * rate_hz, CLIPPED_SAMPLES) and (
                jumps or stop - start > repeats or _stops_dead(x, steps, start, stop, rate_hz)
            ):
                found.append(Frozen("stuck", channel, start, stop, float(x[start]), jumps))
    return found + _clipped(values)


def _longest_by_chance(x: Array) -> float:
    """Samples for which noise alone repeats a rounded value at rest; infinite where rounding covers the noise."""
    resolution, noise = quantisation_step(x), noise_level(x)
    if resolution is None:
        return 1.0
    if noise <= _NOISY * resolution:
        return np.inf
    same = float(erf(resolution / np.sqrt(8.0 * (noise**2 - resolution**2 / 12.0))))
    return np.log(_CHANCE / len(x)) / np.log(same)


def _stops_dead(x: Array, steps: Array, start: int, stop: int, rate_hz: float) -> bool:
    """Whether a stretch that begins or ends with the log is left or entered at speed."""
    window = max(2, round(_SPEED_S * rate_hz))
    if len(x) <= 2 * window or (start > 0) == (stop < len(x)):
        return False
    usual = float(np.quantile(np.abs(x[window:] - x[:-window]), 0.95))
    other = max(start - window, 0) if start else min(stop - 1 + window, len(x) - 1)
    moved = abs(x[other] - x[start])
    return moved > max(_AT_SPEED * usual, _JUMP * float(steps[steps > 0].min()))


def _clipped(values: Array) -> list[Frozen]:
    found = []
    for channel in range(values.shape[1]):
        x = values[:, channel]
        steps = np.abs(np.diff(x))
        if not steps.any():
            continue
        usual = float(np.quantile(steps[steps > 0], 0.95))
        least = max(_CORNER * usual, _CLEAR * (quantisation_step(x, levels=2) or 0.0))
        for extreme in (x.min(), x.max()):
            runs = [(a, b) for a, b in _runs(x, x == extreme) if b - a >= CLIPPED_SAMPLES]
            # A peak is round; a clipped one has corners: speed up to the limit, and none from there on.
            corners = [
                (a, b)
                for a, b in runs
                if (a >= 2 and steps[a - 2] > least) or (b + 1 < len(x) and steps[b] > least)
            ]
            if len(corners) >= 2:
                found += [Frozen("clipped", channel, a, b, float(extreme)) for a, b in corners]
    return found


def _runs(x: Array, where: NDArray[np.bool_] | None = None) -> list[tuple[int, int]]:
    """Runs of equal values (start, stop), or those of rows ``where`` only."""
    edges = np.flatnonzero(np.diff(x) != 0) + 1
    bounds = np.concatenate([[0], edges, [len(x)]])
    runs = zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)
    return [(a, b) for a, b in runs if where is None or where[a]]


def _others_move(values: Array, least: Array, channel: int, start: int, stop: int, rate_hz: float) -> bool:
    """Whether at least two other channels move in both halves of a stretch."""
    middle = (start + stop + 1) // 2
    halves = [_travel(part, rate_hz) for part in (values[start:middle], values[middle - 1 : stop])]
    moved = np.minimum(*halves) > least
    moved[channel] = False
    return int(np.sum(moved)) >= 2


def _least_travel(values: Array) -> Array:
    """Half of what a channel must travel to move: a share of its range, and more than from one sample to the next."""
    if len(values) < 2:
        return np.zeros(values.shape[1])
    return np.maximum(
        _MOVES / 2 * np.ptp(values, axis=0), np.quantile(np.abs(np.diff(values, axis=0)), 0.95, axis=0)
    )


def _travel(values: Array, rate_hz: float) -> Array:
    """Range of means over a tenth of a second: a torque's noise is no motion."""
    length = max(1, min(round(_SPEED_S * rate_hz), len(values) // 4))
    starts = np.arange(0, len(values) - length + 1, length)
    return np.ptp(np.add.reduceat(values[: starts[-1] + length], starts, axis=0) / length, axis=0)

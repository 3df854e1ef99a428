"""Encoders that hold their last value for a while: which readings are none, and what may have been read instead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from estimator.quantisation import rounding_step
from estimator.recording.model import Recording

LEAST = 3
"""Equal readings at least. Derived: two of three steps are needed to tell a jump from a speed."""
PERIODS = 2
"""In which a held value is left. Derived: what is taken between two readings is left in two."""
MOST = 0.5
"""Share of an angle's readings that repeat others, beyond which its encoder is no worse than slow. Chosen."""
DIES_CYCLES = 4.0
"""Periods of its cut-off after which the low-pass filter's response is below 1e-4 of its peak. Derived."""
FINEST_RAD = 2e-6
"""Step of an angle that is not rounded. Chosen: no encoder has more than 21 bits a turn."""


@dataclass(frozen=True)
class Held:
    """An angle whose encoder held its value.

    Attributes:
        robot, joint: from 0.
        angle: ``phi`` or ``theta``.
        spans: readings that are none, first and last but one more.
        nats: by how much a value that is held is likelier than readings of a moving angle that happen to be equal.
    """

    robot: int
    joint: int
    angle: str
    spans: tuple[tuple[int, int], ...]
    nats: float


def held_spans(x: Array, step: float) -> list[tuple[int, int]]:
    """Spans of readings that repeat one before them while the angle moved on, first and last but one more.

    An angle that stays within one step for m periods and has one acceleration all the time has a speed of 4 / m steps
    per period at most, so that it changes by (1 + 2 p / m)^2 steps in p periods before or after. A value that is held
    is entered at speed, by more than that, and left by all that the angle moved meanwhile: by more than that, and by as
    much more than in the period after. In an encoder that does so once, any value is held that is entered or left by
    more.

    Args:
        x: readings, shape (Q,).
        step: rounding step, greater than 0.
    """
    edges = np.flatnonzero(np.diff(x)) + 1
    first, stop = edges[:-1], edges[1:]
    there = (stop - first >= LEAST) & (first >= PERIODS) & (stop + PERIODS <= len(x))
    first, stop = first[there], stop[there]
    sure = held = np.zeros(len(first), dtype=bool)
    for p in range(1, PERIODS + 1):
        most = step * (0.5 + (1.0 + 2.0 * p / (stop - first - 1.0)) ** 2)  # readings change by whole steps
        into, out = np.abs(x[first] - x[first - p]), np.abs(x[stop - 1 + p] - x[stop - 1])
        held = held | (np.maximum(into, out) > most)
        if p == 1:
            sure = (into > most) & (out > most + np.abs(x[stop + 1] - x[stop]))
    if not sure.any():
        return []
    # One more at either end: what is taken between two readings has a share of both.
    return [(int(a), int(b) + 1) for a, b in zip(first[held], stop[held], strict=True)]


def without_held(recording: Recording) -> tuple[Recording, tuple[Held, ...], Array]:
    """A recording whose held readings are interpolated, which these are, and how wrong the interpolation may be.

    The last is the difference between two orders of interpolation over the step of the reading's noise as it is
    rounded, the largest of the angles at each instant, shape (Q,).
    """
    found, doubt = [], np.zeros(len(recording.time))
    angles = {"phi": recording.phi, "theta": recording.theta}
    for angle, x in angles.items():
        for robot, joint in np.ndindex(x.shape[1:]):
            own = x[:, robot, joint]
            step = rounding_step(own) or FINEST_RAD
            spans = held_spans(own, step)
            there = mask_of(spans, len(own))
            if not spans or there.mean() > MOST:
                continue
            found.append(Held(robot, joint, angle, tuple(spans), _nats(own, step, spans)))
            cubic, quintic = (_interpolated(own, there, order) for order in (3, 5))
            doubt = np.maximum(doubt, np.abs(cubic - quintic) / (step / np.sqrt(12.0)))
            angles[angle] = x = x.copy()
            x[:, robot, joint] = own + step * np.round((quintic - own) / step)
    return replace(recording, **angles), tuple(found), doubt


def doubtful(doubt: Array, rate_hz: float, cutoff_hz: float) -> NDArray[np.bool_]:
    """Samples of filtered angles, rates and accelerations that held readings may change by more than noise, shape (Q,).

    Args:
        doubt: of ``without_held``.
        rate_hz: of the samples.
        cutoff_hz: of the low-pass filter (``filtering.low_pass``).
    """
    out = np.zeros(len(doubt), dtype=bool)
    if doubt.any():
        half = round(DIES_CYCLES * rate_hz / cutoff_hz)
        impulse = np.zeros(4 * half + 1)
        impulse[2 * half] = 1.0
        weights = low_pass(impulse, rate_hz, cutoff_hz)
        for _ in range(3):
            most = np.convolve(doubt, np.abs(weights[half : 3 * half + 1]), mode="same")
            out |= most > np.linalg.norm(weights)
            weights = differentiate(weights, rate_hz)
    return out


def mask_of(spans: Sequence[tuple[int, int]], samples: int) -> NDArray[np.bool_]:
    """Which of all samples are in spans, shape (samples,)."""
    out = np.zeros(samples, dtype=bool)
    for start, stop in spans:
        out[start:stop] = True
    return out


def _nats(x: Array, step: float, spans: Sequence[tuple[int, int]]) -> float:
    """Of readings that may have had any value on the angle's way."""
    return float(sum((b - a) * np.log1p(abs(x[b] - x[a]) / step) for a, b in spans))


def _interpolated(x: Array, missing: NDArray[np.bool_], order: int) -> Array:
    at = np.arange(len(x), dtype=float)
    out = x.copy()
    out[missing] = make_interp_spline(at[~missing], x[~missing], order)(at[missing])
    return out

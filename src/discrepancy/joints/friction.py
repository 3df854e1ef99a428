"""Dry friction as a function of the velocity: direction, rests and reversals, and how it may differ from its law."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from discrepancy.joints.causes import JointSignals
from estimator.arrays import Array

MERGE_S = 0.025
"""Rests that are less apart are one. Derived: a period of the smoothing filter (60 Hz) on either side."""
KNOT_S = 0.06
"""Duration of a rest for each cosine of its friction. Derived: half a period of the rows' highest frequency, 10 Hz."""
MOST_KNOTS = 12


def rests(v: Array, step_s: float, slow: float) -> list[tuple[int, int]]:
    """Samples of each interval in which a joint may rest or turn round: first, and one past the last.

    Args:
        v: velocity, shape (W,).
        step_s: time between samples [s].
        slow: speed below which its sign says nothing.
    """
    turns = (v[1:] > 0) != (v[:-1] > 0)
    at = np.flatnonzero((np.abs(v) < slow) | np.append(turns, False) | np.append(False, turns))
    if not len(at):
        return []
    parts = np.split(at, np.flatnonzero(np.diff(at) > MERGE_S / step_s) + 1)
    return [(max(int(p[0]) - 1, 0), min(int(p[-1]) + 2, len(v))) for p in parts]


def ends(v: Array, a: int, b: int) -> tuple[float, float]:
    """Direction before and after a rest."""
    before, after = (np.sign(v[a - 1]) if a else np.nan), (np.sign(v[b]) if b < len(v) else np.nan)
    return (after if np.isnan(before) else before), (before if np.isnan(after) else after)


def direction(v: Array, step_s: float, slow: float) -> Array:
    """Direction of motion; during a rest on the straight line between those before and after, shape (W,)."""
    out = np.sign(v)
    for a, b in rests(v, step_s, slow):
        before, after = ends(v, a, b)
        if np.isnan(before):
            out[a:b] = 0.0
        else:
            out[a:b] = before + (after - before) * (np.arange(b - a) + 0.5) / (b - a)
    return out


def resting(v: Array, step_s: float, slow: float) -> tuple[list[list[tuple[int, Array]]], list[Array]]:
    """What friction of one newton metre may do beside its straight line while a joint rests or turns round.

    Returns:
        For each rest, pairs of the first sample and a series, the k-th of standard deviation 1 / sqrt(3 (1 + k)); and
        series (W,) that are common to all reversals.
    """
    own: list[list[tuple[int, Array]]] = []
    common = [np.zeros(len(v)) for _ in range(3)]
    for a, b in rests(v, step_s, slow):
        n = b - a
        place = (np.arange(n) + 0.5) / n
        cosines = [
            np.cos(np.pi * k * place) for k in range(max(3, 1 + min(int(n * step_s / KNOT_S), MOST_KNOTS)))
        ]
        before, after = ends(v, a, b)
        if not np.isnan(before):
            for k in range(3):
                common[k][a:b] = 0.5 * (after - before) * cosines[k]
        own.append([(a, c) for c in cosines[: 1 + min(int(n * step_s / KNOT_S), MOST_KNOTS)]])
    return own, common


def bent(q: Array, bristle: float) -> Array:
    """Direction of dry friction that gives way by a small angle first (Dahl, "A solid friction model", 1968)."""
    step = np.diff(q, prepend=q[0])
    side, keep = np.sign(step), np.exp(-np.abs(step) / bristle)
    out, last = np.empty_like(q), 0.0
    for k in range(len(out)):
        last = side[k] + (last - side[k]) * keep[k]
        out[k] = last
    return out


def smooth(s: JointSignals) -> list[Array]:
    """Smooth functions of position, speed, load, time and direction, of about unit size, shape (W,) each."""
    q = 2.0 * (s.q - s.span.middle) / s.span.travel
    w = np.clip(np.log(np.abs(s.v) / s.span.speed + 1e-2), -4.0, 2.0) / 1.5 + 0.3
    t = 2.0 * s.t / s.span.until_s - 1.0
    load = 0.5 * np.clip(s.asked / (np.sqrt(np.mean(s.asked**2)) + 1e-9), -3.0, 3.0)
    return [q, 1.5 * q**2 - 0.5, w, w**2 - 1.0, t, 1.5 * t**2 - 0.5, load, 2.0 * load**2 - 0.5, s.direction]


def other_forms(
    signals: Sequence[JointSignals], coulomb: float, viscous: float, share: float, slow: float
) -> Iterator[list[Array]]:
    """Series of one standard deviation each by which friction of some size may differ from its law.

    Args:
        signals: of one joint, a log each.
        coulomb, viscous: the size [N m, N m s/rad].
        share: of the trace, for smooth functions.
        slow: the same at low speeds.
    """
    for bristle in (1e-3, 4e-3):  # gears and greased bearings give way by a few tenths of a mrad to some mrad
        yield [3.0 * share * coulomb * (bent(s.q, bristle) - s.direction) for s in signals]
    for speed in (0.03, 0.1):
        yield [slow * coulomb * s.direction * np.exp(-np.abs(s.v) / (speed * s.span.speed)) for s in signals]
    for speed in (0.02, 0.06):  # reversals that are rounded
        yield [slow * coulomb * (np.tanh(s.v / (speed * s.span.speed)) - s.direction) for s in signals]
    yield [1e-3 * coulomb * np.gradient(s.direction, s.step_s) for s in signals]  # a millisecond
    each = [smooth(s)[:-3] for s in signals]  # friction by load and by direction are causes of their own
    for i in range(len(each[0])):
        yield [
            0.5 * share * (coulomb * s.direction + viscous * s.v) * f[i]
            for s, f in zip(signals, each, strict=True)
        ]

"""Coulomb friction as a function of velocity: direction, rests and reversals, and deviations from its law."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.optimize import lsq_linear

from discrepancy.joints.causes import JointSignals
from estimator.arrays import Array

MERGE_S = 0.025
"""Longest gap between rests that count as one [s]. Derived: a period of the smoothing filter (60 Hz) on each side."""
KNOT_S = 0.06
"""Time at rest for each cosine of the friction [s]. Derived: half a period of the rows' highest frequency, 10 Hz."""
MOST_KNOTS, MOST_IN_ALL = 12, 240
"""Cosines of one rest; where commands tell the torque, more of them in long rests if those of all rests of a joint are
fewer than the second number. Chosen: a command that steps while the joint sticks makes friction jump, and 240 cosines
resolve 14 s of that."""
AT_REVERSALS = (0, 1, 4, 5, 6)
"""Deviations of ``other_forms`` that act near reversals only: presliding, rounded reversals, a delay."""


def rests(v: Array, step_s: float, slow: float) -> list[tuple[int, int]]:
    """Find the intervals in which a joint may rest or reverse; return first sample and one past the last.

    Args:
        v: velocity, shape (W,).
        step_s: time between samples [s].
        slow: speed below which the sign of the velocity is unreliable.
    """
    turns = (v[1:] > 0) != (v[:-1] > 0)
    at = np.flatnonzero((np.abs(v) < slow) | np.append(turns, False) | np.append(False, turns))
    if not len(at):
        return []
    parts = np.split(at, np.flatnonzero(np.diff(at) > MERGE_S / step_s) + 1)
    return [(max(int(p[0]) - 1, 0), min(int(p[-1]) + 2, len(v))) for p in parts]


def ends(v: Array, a: int, b: int) -> tuple[float, float]:
    """Direction of motion before and after a rest."""
    before, after = (np.sign(v[a - 1]) if a else np.nan), (np.sign(v[b]) if b < len(v) else np.nan)
    return (after if np.isnan(before) else before), (before if np.isnan(after) else after)


def direction(v: Array, step_s: float, slow: float) -> Array:
    """Direction of motion, interpolated linearly during a rest, shape (W,)."""
    out = np.sign(v)
    for a, b in rests(v, step_s, slow):
        before, after = ends(v, a, b)
        if np.isnan(before):
            out[a:b] = 0.0
        else:
            out[a:b] = before + (after - before) * (np.arange(b - a) + 0.5) / (b - a)
    return out


def resting(
    v: Array, step_s: float, slow: float, most: int = 0
) -> tuple[list[list[tuple[int, Array]]], list[Array]]:
    """Deviations of a unit Coulomb friction from the linear course during rests and reversals.

    Args:
        v: velocity, shape (W,).
        step_s: time between samples [s].
        slow: speed below which the sign of the velocity is unreliable.
        most: cosines that all rests together may have, where that is more than ``MOST_KNOTS`` for one of them.

    Returns:
        For each rest, pairs of its first sample and a series, the k-th with standard deviation 1 / sqrt(3 (1 + k)); and
        series (W,) that are common to all reversals.
    """
    own: list[list[tuple[int, Array]]] = []
    common = [np.zeros(len(v)) for _ in range(3)]
    found = rests(v, step_s, slow)
    total = sum(b - a for a, b in found)
    for a, b in found:
        n = b - a
        place = (np.arange(n) + 0.5) / n
        knots = min(int(n * step_s / KNOT_S), max(MOST_KNOTS, most * n // total))
        cosines = [np.cos(np.pi * k * place) for k in range(max(3, 1 + knots))]
        before, after = ends(v, a, b)
        if not np.isnan(before):
            for k in range(3):
                common[k][a:b] = 0.5 * (after - before) * cosines[k]
        own.append([(a, c) for c in cosines[: 1 + knots]])
    return own, common


def bent(q: Array, bristle: float) -> Array:
    """Direction of Coulomb friction with elastic presliding (Dahl, "A solid friction model", 1968)."""
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


def deviations(
    signals: Sequence[JointSignals], coulomb: float, viscous: float, share: float, *, servo: bool
) -> list[list[Array]]:
    """The series of ``other_forms`` and, for a servo, of ``servo_forms``."""
    servos = servo_forms(signals, coulomb, viscous, share) if servo else ()
    return [*other_forms(signals, coulomb, viscous, share, share), *servos]


def other_forms(
    signals: Sequence[JointSignals], coulomb: float, viscous: float, share: float, slow: float
) -> Iterator[list[Array]]:
    """Series of one standard deviation by which friction may deviate from its law.

    Args:
        signals: signals of one joint, one for each log.
        coulomb, viscous: size of the friction [N m, N m s/rad].
        share: deviation relative to the friction.
        slow: the same at low speeds.
    """
    for bristle in (1e-3, 4e-3):  # presliding of gears and greased bearings: 0.1 mrad to several mrad
        yield [3.0 * share * coulomb * (bent(s.q, bristle) - s.direction) for s in signals]
    for speed in (0.03, 0.1):
        yield [slow * coulomb * s.direction * np.exp(-np.abs(s.v) / (speed * s.span.speed)) for s in signals]
    for speed in (0.02, 0.06):  # rounded reversals
        yield [slow * coulomb * (np.tanh(s.v / (speed * s.span.speed)) - s.direction) for s in signals]
    yield [1e-3 * coulomb * np.gradient(s.direction, s.step_s) for s in signals]  # a delay of one millisecond
    each = [smooth(s)[:-3] for s in signals]  # dependence on load and direction has causes of its own
    for i in range(len(each[0])):
        yield [
            0.5 * share * (coulomb * s.direction + viscous * s.v) * f[i]
            for s, f in zip(signals, each, strict=True)
        ]


def polynomial(signals: Sequence[JointSignals], torque: Sequence[Array], least: float) -> Array:
    """Coulomb friction, and damping of first to third degree in the speed, nearest to a friction while it moves.

    Args:
        signals: signals of one joint, one for each log.
        torque: its friction, one for each log.
        least: least damping of the first degree; that of the third is not negative, so that friction grows in the end.

    Returns:
        The four numbers, as MJCF's ``frictionloss`` and ``damping`` have them.
    """
    A = np.concatenate([
        np.column_stack([s.direction, s.v, s.v * np.abs(s.v), s.v**3])[np.abs(s.direction) == 1.0] for s in signals
    ])  # fmt: skip
    y = np.concatenate([x[np.abs(s.direction) == 1.0] for s, x in zip(signals, torque, strict=True)])
    size = np.maximum(np.linalg.norm(A, axis=0), 1e-12)
    bounds = np.array([0.0, least, -np.inf, 0.0]) * size, np.inf
    return np.asarray(lsq_linear(A / size, y, bounds).x / size)


def servo_forms(
    signals: Sequence[JointSignals], coulomb: float, viscous: float, share: float
) -> Iterator[list[Array]]:
    """Series of one standard deviation by which friction in a servo's gear may exceed Coulomb and viscous friction.

    With the square of the speed, more at low speed (Stribeck), more under torque, and the last two together: the laws
    M4 to M6 of M. Duclusaud et al., "Extended friction models for the physics simulation of servo actuators", 2024.

    Args:
        signals: signals of one joint, one for each log.
        coulomb, viscous: Coulomb friction [N m], and viscous friction, the drive's back-EMF included [N m s/rad].
        share: deviation relative to the friction, and to the torque.
    """
    yield [coulomb * s.v * np.abs(s.v) / s.span.speed**2 for s in signals]
    for speed in (0.05, 0.2, 0.5):
        slow = [s.direction * np.exp(-np.abs(s.v) / (speed * s.span.speed)) for s in signals]
        yield [coulomb * x for x in slow]
        yield [share * x * np.abs(s.asked) for x, s in zip(slow, signals, strict=True)]
    for which in ("asked", "load"):
        yield [share * s.direction * np.abs(getattr(s, which)) for s in signals]
    # A gear does not carry the back-EMF.
    yield [share * s.direction * np.abs(s.asked - viscous * s.v) for s in signals]

"""What single channels of a joint log show without a model: ranges, wrapped numbers, coarse readings, units."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array
from mocobot_inspect.joints.lags import SIGMAS, Follows, pooled
from mocobot_inspect.joints.numbers import milliseconds, percent
from mocobot_inspect.joints.robot import Robot
from mocobot_logs.joints.joint_log import JointLog
from mocobot_logs.joints.joint_map import JointMap, label

WORDS = (8, 10, 12, 16, 24, 32)
"""Bits of numbers whose sign may have got lost."""
EMPTY = 0.02
"""Share of samples in the middle half of such a number's range, at most: wrapped ones are near its ends."""
MARGIN = 0.02
"""Of its range (and no less in rad or m) may a joint be beyond it: calibrated zeros."""
COARSE = 0.005
"""Steps that are a larger share of what a joint moves, or of what its torque spans, are coarse."""
SATURATED = 0.98
"""Of the drive's limit."""
FACTORS = {
    180.0 / np.pi: "degrees, taken for radians",
    np.pi / 180.0: "radians, taken for degrees",
    1e3: "thousandths, taken for whole units",
    1e-3: "whole units, taken for thousandths",
    30.0 / np.pi: "rpm, taken for rad/s",
    np.pi / 30.0: "rad/s, taken for rpm",
    1.0 / (2.0 * np.pi): "turns, taken for radians",
    2.0 * np.pi: "radians, taken for turns",
}
"""Gains that a wrong unit makes."""
CLOSE = 0.05
"""Relative; so near must a gain be to one of them, and to 1 not to be worth a word."""


def wrapped(names: Sequence[tuple[str, str]], values: Array, log_map: JointMap) -> Iterator[str]:
    """Numbers that must have been signed: they leap from one end of an unsigned word to the other.

    Args:
        names: quantity and joint of every column.
        values: samples [SI], shape (Q, C).
        log_map: how they were read.
    """
    for k, (quantity, joint) in enumerate(names):
        channel = log_map.channels[quantity, joint]
        if channel.bits is not None:
            continue
        raw = channel.undo(values[np.isfinite(values[:, k]), k])
        if len(raw) < 2 or raw.min() < -0.5 or np.abs(raw - np.rint(raw)).max() > 1e-6 * max(raw.max(), 1.0):
            continue
        for bits in WORDS:
            full = 2.0**bits
            middle = np.mean((raw > 0.25 * full) & (raw < 0.75 * full))
            leaps = np.sum(np.abs(np.diff(raw)) > 0.5 * full)
            if 0.75 * full < raw.max() < full and middle < EMPTY and leaps:
                yield (
                    f"{label(quantity, joint)} leaps {leaps} times between {raw.min():g} and {raw.max():g}: is it a "
                    f"signed number of {bits} bits without its sign (bits = {bits} in the map)?"
                )
                break


def beyond_range(log: JointLog, robot: Robot) -> Iterator[str]:
    """Positions that the model's joints cannot take."""
    for j, joint in enumerate(robot.joints):
        low, high = float(log.q[:, j].min()), float(log.q[:, j].max())
        span = robot.upper[j] - robot.lower[j]
        margin = MARGIN * (1.0 + (span if np.isfinite(span) else 0.0))
        if low >= robot.lower[j] - margin and high <= robot.upper[j] + margin:
            continue
        unit, hint = robot.units[j], ""
        if not robot.slides[j]:
            inside = (
                np.radians(low) >= robot.lower[j] - margin and np.radians(high) <= robot.upper[j] + margin
            )
            if inside and high - low > 2.0 * span:
                hint = "; are they degrees, taken for radians?"
        yield (
            f"q of {joint} reaches {low:.4g} to {high:.4g} {unit}, beyond the model's range of {robot.lower[j]:.4g} to "
            f"{robot.upper[j]:.4g}{hint}"
        )


def coarse(log: JointLog, moves: NDArray[np.bool_]) -> Iterator[str]:
    """Readings whose steps are large beside what they read."""
    for j, joint in enumerate(log.joints):
        span, step = float(np.ptp(log.q[:, j])), float(log.position_step[j])
        if moves[j] and step > COARSE * span:
            yield (
                f"q of {joint} comes in steps of {step:.3g}, {percent(step / span)} % of all that it moves: what is "
                "slower or smaller is lost in rounding"
            )


def saturated(log: JointLog, robot: Robot) -> Iterator[str]:
    """Drives that give all they have."""
    if log.torque is not None:
        known = ~np.isnan(log.drive.torque_constant)
        for j, joint in enumerate(log.joints):
            if known[j] and np.isfinite(robot.torque_limit[j]):
                share = float(np.mean(np.abs(log.torque[:, j]) > SATURATED * robot.torque_limit[j]))
                if share > 0:
                    yield (
                        f"torque of {joint} is at the model's limit of {robot.torque_limit[j]:g} "
                        f"{'N' if robot.slides[j] else 'N m'} in {percent(share)} % of the samples"
                    )
    if log.drive.duty is not None:
        for j, joint in enumerate(log.joints):
            share = float(np.mean(np.abs(log.drive.duty[:, j]) >= 1.0 - 1e-9))
            if share > 0:
                yield f"duty of {joint} is full in {percent(share)} % of the samples: the loop is saturated there"


def unit_of(gain: float) -> str | None:
    """What a gain between two channels that should be equal says of a unit; None where there is nothing to say."""
    for factor, words in FACTORS.items():
        if abs(abs(gain) / factor - 1.0) < CLOSE:
            return words
    return None


def of_velocities(found: Sequence[Follows], log: JointLog) -> Iterator[str]:
    """What measured velocities are, beside differentiated positions."""
    for one in found:
        joint = log.joints[one.joint]
        if one.strays:
            yield (
                f"dq of {joint} does not follow its position (correlation {one.correlation:.2g}): is it another "
                "joint's?"
            )
        elif abs(one.gain - 1.0) > CLOSE + SIGMAS * one.gain_se:
            words = unit_of(one.gain)
            if one.gain < 0:
                yield f"dq of {joint} runs against its position: one of them has the wrong sign"
            else:
                hint = "" if words is None else f": one of them is {words}"
                yield f"dq of {joint} is {one.gain:.4g} times the derivative of its position{hint}"
    shared = pooled(found)
    each = [(log.joints[one.joint], one.delay_s, one.delay_se_s) for one in found if not one.strays]
    for joint, delay_s, se_s in each if shared is None else [("every joint", *shared)]:
        if abs(delay_s) > max(log.period_s, SIGMAS * se_s):
            late = "later than" if delay_s > 0 else "ahead of"
            yield (
                f"dq of {joint} is {milliseconds(delay_s, se_s)} {late} its position: it is filtered"
                + ("" if delay_s > 0 else ", or the position is")
            )

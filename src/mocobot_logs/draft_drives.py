"""Draft what a robot is told: the order of its motors, the gains of its loop, and what its position follows.

LeRobot's units are those of ``_normalize`` in github.com/huggingface/lerobot, src/lerobot/motors/motors_bus.py.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from estimator.arrays import Array
from estimator.quantisation import rounding_step
from mocobot_logs.draft import DOUBTFUL
from mocobot_logs.presets import MOTORS, Meaning


@dataclass(frozen=True, eq=False)
class Place:
    """Location of one quantity of all joints."""

    keys: Mapping[str, Any]  # keys of a map with placeholders
    # first finite values of each joint, one for all if the quantity is shared; None if they cannot be read
    values: Sequence[Array | None] = ()
    meaning: Meaning | None = None  # unit and comment, where the name is well known
    own: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # keys of single joints that differ
    lacks: Mapping[str, str] = field(default_factory=dict)  # why a joint has no value
    doubts: tuple[str, ...] = ()  # what the user must check beside
    others: tuple[Place, ...] = ()  # other places that may be meant

    @property
    def every(self) -> Array | None:
        """All values, None if they cannot be read."""
        known = [values for values in self.values if values is not None]
        return np.concatenate(known) if known else None

    def told(self, said: str, *doubts: str) -> Place:
        """Return the place with another comment and further doubts."""
        meaning = self.meaning or Meaning(None)
        both = "; ".join(filter(None, (meaning.said, said)))
        return replace(self, meaning=replace(meaning, said=both), doubts=(*self.doubts, *doubts))


# Unitree.


def motors_of(joints: Sequence[str]) -> dict[str, int] | None:
    """Return the motor of each joint, from 0, in a Unitree message; None if not all names are known."""
    plain = [joint.lower().removesuffix("_joint") for joint in joints]
    for names in MOTORS:
        if set(plain) <= set(names):
            return {joint: names.index(name) for joint, name in zip(joints, plain, strict=True)}
    return None


def numbered(topic: str, path: str, at: Mapping[str, int], joints: Sequence[str]) -> Place:
    """Return the place of the elements ``at`` their indices, of joints in the map's order."""
    if [at.get(joint) for joint in joints] == list(range(len(joints))):
        return Place({"topic": topic, "field": path})
    own = {joint: {"field": path.replace("{index}", str(at[joint]))} for joint in joints if joint in at}
    return Place({"topic": topic}, own=own)


# Gains.


def gain_lines(gains: Mapping[str, Array], joints: Sequence[str]) -> Iterator[str]:
    """Yield the lines of gains: values of all rows by key, shape (q, J) each, NaN where a row has none."""
    for name, values in gains.items():
        usual, doubts = [], []
        for joint, x in zip(joints, values.T, strict=True):
            given, count = np.unique(x[np.isfinite(x)], return_counts=True)
            usual.append(float(given[np.argmax(count)]) if len(given) else np.nan)
            if len(given) > 1:
                doubts.append(f"of {joint} is {given[0]:.6g} to {given[-1]:.6g}")
        least = 0.0 if name == "velocity_gain" else 1e-300
        texts = [f"{x:.6g}" if x >= least else '"free"' for x in usual]
        alike = len(set(texts)) == 1
        change = f"{'; '.join(doubts)}: the most frequent is here; cut the log to where it holds"
        constant = "" if '"free"' in texts else "  # constant in the log"
        doubt = f"  # {DOUBTFUL}{name} {change}" if doubts else constant
        yield f"{name} = {texts[0] if alike else '[' + ', '.join(texts) + ']'}{doubt}"


# What the position follows.

MOST_LAG_S, LEAST_STEP_S = 0.5, 1e-3  # longest lag that is tried, and the least step between two [s]. Chosen.
LEAST_ROWS, MOST_ROWS, MOST_LEFT = 32, 2000, 0.5
"""Least and most rows to compare, and the share of the variance beyond which a position does not follow. Chosen."""


@dataclass(frozen=True, eq=False)
class Follow:
    """How a position follows a command: position(t) = slope * command(t - lag_s) + constant."""

    lag_s: float  # lag [s]
    left: float  # share of the variance of the positions that this leaves
    slope: Array  # of each joint, NaN where the joint or its command rests, shape (J,)

    def of(self, place: Place, joints: Sequence[str]) -> Place:
        """Return the command's place with what was found as a comment, and its doubts."""
        if self.left > MOST_LEFT:
            share = f"{100 * self.left:.0f} % of its variance is left"
            return place.told("", f"the position does not follow it ({share})")
        when = f"by {1e3 * self.lag_s:.0f} ms" if self.lag_s >= 0.5e-3 else "at once"
        against = [joint for joint, slope in zip(joints, self.slope, strict=True) if slope < 0]
        scaled = [
            joint for joint, slope in zip(joints, self.slope, strict=True) if slope > 2 or 0 < slope < 0.5
        ]
        doubts = [f"{', '.join(against)} moves against it: sign = -1?"] if against else []
        doubts += [f"{', '.join(scaled)} moves by another measure: unit?"] if scaled else []
        return place.told(f"the position follows {when}", *doubts)


def follow(time_s: Array, q: Array, told_s: Array, told: Array) -> Follow | None:
    """Find the lag with which positions follow commands, from the commands' stamps, by least squares.

    Positions ``q`` (q, J) are at ``time_s`` [s], commands ``told`` (m, J) at ``told_s`` [s] by the same clock, both
    increasing. None if nothing moves, or there are too few rows.
    """
    given = np.isfinite(told).all(axis=1)
    told_s, told = told_s[given], told[given]
    known = np.isfinite(q).all(axis=1)
    known &= (time_s >= told_s[0] + MOST_LAG_S) & (time_s <= told_s[-1]) if len(told_s) else False
    if np.sum(known) < LEAST_ROWS:
        return None
    rows = np.flatnonzero(known)[:: max(1, int(np.sum(known)) // MOST_ROWS)]
    step = max(LEAST_STEP_S, 0.25 * float(np.median(np.diff(time_s))))
    lags = np.arange(0.0, MOST_LAG_S, step)
    y = q[rows] - q[rows].mean(axis=0)
    size = np.sum(y**2, axis=0)
    left, slopes = np.full(len(lags), np.inf), np.full((len(lags), q.shape[1]), np.nan)
    for k, lag in enumerate(lags):
        x = np.column_stack([np.interp(time_s[rows] - lag, told_s, column) for column in told.T])
        x -= x.mean(axis=0)
        power = np.sum(x**2, axis=0)
        moves = (power > 1e-12) & (size > 1e-12)
        if moves.any():
            slopes[k, moves] = np.sum(x * y, axis=0)[moves] / power[moves]
            rest = size[moves] - slopes[k, moves] ** 2 * power[moves]
            left[k] = float(np.sum(rest) / np.sum(size[moves]))
    best = int(np.argmin(left))
    if not np.isfinite(left[best]):
        return None
    lag = lags[best]
    if 0 < best < len(lags) - 1:
        a, b, c = left[best - 1 : best + 2]
        lag += 0.5 * step * (a - c) / (a - 2 * b + c) if a - 2 * b + c > 0 else 0.0
    return Follow(float(lag), float(left[best]), slopes[best])


# Feetech servos as LeRobot logs them.

_COUNTS = 4096.0  # counts of a turn of an STS3215
_DEGREE = 360.0 / (_COUNTS - 1.0)  # one count in LeRobot's degrees
_SAME = 1e-3
_ZERO = (
    "where is each joint, in the model, when its reading is 0? zero = [ ... ] is that [rad]. Which joints turn the "
    "other way than in the model? sign = -1 for their q and command"
)


def zero_lines() -> list[str]:
    """Return the lines that ask for signs and zeros."""
    return [f"# {DOUBTFUL}{_ZERO}", "zero = 0.0"]


def calibration_beside(path: Path) -> tuple[Path, dict[str, dict[str, float]]] | None:
    """Return the file and the motors of a LeRobot calibration in a dataset's folder, in ``meta`` or beside it."""
    for folder in (path, path / "meta", path.parent):
        for file in sorted(folder.glob("*.json")):
            try:
                values = json.loads(file.read_text(encoding="utf-8")) if file.stat().st_size < 1 << 20 else {}
                motors = {
                    name: {key: float(motor[key]) for key in ("range_min", "range_max", "drive_mode")}
                    for name, motor in values.items()
                }
            except (OSError, ValueError, TypeError, KeyError, AttributeError):
                continue
            if motors and all(motor["range_max"] > motor["range_min"] for motor in motors.values()):
                return file, motors
    return None


def lerobot_places(
    path: Path, places: Mapping[str, Place], joints: Sequence[str], motors: Sequence[str]
) -> tuple[dict[str, Place], list[str]]:
    """Find the units of a LeRobot dataset's states and actions by their steps and a calibration, and further doubts.

    One count of the servo is 360/4095 in degrees, 200/(range_max - range_min) in -100 to 100, and
    100/(range_max - range_min) in 0 to 100. ``motors`` are LeRobot's names of the joints' motors.
    """
    state = places["q"]
    beside = calibration_beside(path)
    own: dict[str, dict[str, Any]] = {}
    asked, degrees = [], []
    for joint, motor, x in zip(joints, motors, state.values, strict=True):
        parts = () if x is None else (x[k : k + 1024] for k in range(0, len(x), 1024))
        step = next(filter(None, map(rounding_step, parts)), 0.0)
        told = (beside[1] if beside else {}).get(motor)
        if abs(step / _DEGREE - 1.0) < _SAME:
            degrees.append(joint)
            continue
        if told is not None:
            span = told["range_max"] - told["range_min"]
            kinds = [100.0 / span, 200.0 / span]
            off = [abs(step / kind - 1.0) for kind in kinds]
            one = kinds[int(np.argmin(off))] if min(off) < _SAME else kinds[motor != "gripper"]
            if min(off) >= _SAME:
                asked.append(joint)
        elif step > 0.0:
            one = step
        else:
            asked.append(joint)
            continue
        own[joint] = {"unit": "%", "rated": float(f"{2.0 * np.pi / _COUNTS * 100.0 / one:.12g}")}
    doubts = []
    if beside is None and own:
        doubts.append("one step of the readings is taken for one count in 4096 a turn: is it?")
    turned = [m for m in motors if beside is not None and beside[1].get(m, {}).get("drive_mode")]
    if turned:
        doubts.append(
            f"drive_mode of {', '.join(turned)} is 1: LeRobot turned its sign, unless it is in degrees"
        )
    if asked:
        steps = (
            f"the steps of its readings fit neither those nor {beside[0].name}"
            if beside
            else "it has no calibration"
        )
        doubts.append(f"unit of {', '.join(asked)}: deg, or % with rated [rad at 100]? {steps}")
    if not own and not degrees:
        return dict(places), doubts
    said = f"% of a range, by {beside[0].name if beside else 'the step of one count in 4096'}"
    said = said if own else "one count is 360/4095 deg"
    common = {} if degrees else {"rated": next(iter(own.values()))["rated"]}
    alike = {} if degrees else {"unit": "%", **common}
    differ = {joint: keys for joint, keys in own.items() if keys != alike}
    found = dict(places)
    for name in ("q", "command"):
        if name in places:
            place, meaning = places[name], Meaning(name, "deg" if degrees else "%", said)
            before = place.meaning.said if place.meaning else ""
            found[name] = replace(place, keys={**place.keys, **common}, meaning=meaning, own=differ).told(
                before
            )
    return found, doubts

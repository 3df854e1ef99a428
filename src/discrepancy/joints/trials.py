"""Prepare logs for the diagnosis: torques of all drives, smoothed signals, and parts for cross-validation."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from discrepancy.evidence.findings import Event, HeldReadings, held_readings
from discrepancy.joints.mechanics import Tree, inverse_torque
from discrepancy.joints.model import SerialModel
from discrepancy.joints.servo import Motor, with_torques
from discrepancy.joints.signals import Signals, sensor_noise
from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_logs.joints.joint_log import JointLog

EDGE_S = 0.1
"""Time to discard at both ends [s]: six periods of the smoothing cut-off, where the filter is inaccurate."""
SHORT_S = 0.03
"""Longest gap to interpolate [s]. Derived: a quarter of a period of the fastest row."""
LEAST_S, LEAST_SAMPLES = 2.0, 40
"""Least length of a run: duration [s] and samples."""
PARTS, PART_S = 3, 4.0
"""Largest number of parts of a single log, and their least duration [s]: each covers most poses of the motion."""
LIMIT_RAD, LIMIT_M, LIMIT_S = 6e-3, 3e-3, 0.05
"""Distance from a joint limit within which its force may act [rad, m], and fade time of excluded samples [s]."""
LEAST_SPEED = 1e-6
RESTS = 2.0
"""Least standard deviation of a moving joint's readings, in units of their noise."""


@dataclass(frozen=True, eq=False)
class Trials:
    """Logs in the form that the diagnosis uses.

    Attributes:
        runs: stretches without gaps; those of the reference come last.
        changed: number of runs before those of the reference.
        joints: indices of joints with torques in all logs, from 0, shape (C,).
        motors: torque per unit of input of drives without torque readings.
        parts: for each part, the index of its run and the samples in it.
        names: names of the parts.
        noise: sample of the sensor noise in the residual of each run, shape (W, J).
        kept: weight of each sample of each run, zero at joint limits, shape (W, J); empty: all samples count.
        limited: time of each joint at its limits [s], shape (J,).
    """

    runs: tuple[Signals, ...]
    changed: int
    joints: NDArray[np.intp]
    motors: tuple[Motor, ...]
    parts: tuple[tuple[int, slice], ...]
    names: tuple[str, ...]
    noise: tuple[Array, ...]
    kept: tuple[Array, ...]
    limited: Array

    @property
    def signals(self) -> tuple[Signals, ...]:
        """Signals of each part."""
        return tuple(part_of(self.runs[k], at) for k, at in self.parts)


def trials_of(model: SerialModel, logs: Sequence[JointLog], reference: Sequence[JointLog] = ()) -> Trials:
    """Smooth the logs and cut them at gaps; a single log is split into up to three parts.

    Raises:
        InputError: a log is too short or has no torques.
    """
    every, motors = with_torques(model, [*logs, *reference])
    known = np.ones(len(model.joints), dtype=bool)
    for log in every:
        if log.torque is None:
            raise InputError(
                f"{log.name}: there are no torques, currents or duties, nor commands with known gains; one of them is "
                "needed (position_gain and velocity_gain in the map's [control])"
            )
        known &= np.isfinite(log.torque).any(axis=0)
    joints = np.flatnonzero(known)
    if not len(joints):
        raise InputError(f"{every[0].name}: no joint has torques in every log")
    tree, inverse = Tree.of(model.model), partial(inverse_torque, model.model)
    whole = [Signals.of(log, tree, inverse) for log in every]
    typical = np.sqrt(np.mean([np.mean(s.dq**2, axis=0) for s in whole], axis=0))
    whole = [replace(s, typical=np.maximum(typical, LEAST_SPEED)) for s in whole]
    at = [_runs(s, joints) for s in whole]
    cut = [[part_of(s, run) for run in own] for s, own in zip(whole, at, strict=True)]
    runs = [run for own in cut for run in own]
    loud = [sensor_noise(s) for s in whole]
    noise = tuple(x[run] for x, own in zip(loud, at, strict=True) for run in own)
    changed = sum(len(own) for own in cut[: len(logs)])
    number = PARTS if len(runs) == 1 else 1
    parts = []
    for k, s in enumerate(runs):
        most = max(1, min(number, int(len(s.time) / s.rate_hz / PART_S)))
        edges = np.linspace(0, len(s.time), most + 1).astype(int)
        parts += [(k, slice(int(a), int(b))) for a, b in itertools.pairwise(edges)]
    names = tuple(_name(runs[k], at, whole=len(parts) == len(every)) for k, at in parts)
    kept, limited = off_limits(model, runs)
    return Trials(tuple(runs), changed, joints, motors, tuple(parts), names, noise, kept, limited)


def off_limits(model: SerialModel, runs: Sequence[Signals]) -> tuple[tuple[Array, ...], Array]:
    """Weights of samples that fade to zero at joint limits, where the limit's force is unknown, and the time there.

    A joint that spends most of the time beyond its limits has other limits than the model, so these are ignored. All
    joints fade where an encoder holds its last value.
    """
    slack = model.model.jnt_margin[model.coupling.own] + np.where(model.slides, LIMIT_M, LIMIT_RAD)
    at = [(s.q < model.lower + slack) | (s.q > model.upper - slack) for s in runs]
    time = np.sum([x.sum(axis=0) / s.rate_hz for x, s in zip(at, runs, strict=True)], axis=0)
    time[time > 0.5 * sum(len(s.time) / s.rate_hz for s in runs)] = 0.0
    spoilt = [np.zeros(len(s.time), dtype=bool) if s.spoilt is None else s.spoilt for s in runs]
    if not (time.any() or any(x.any() for x in spoilt)):
        return (), time
    kept = []
    for x, bad, s in zip(at, spoilt, runs, strict=True):
        n = round(LIMIT_S * s.rate_hz)
        wide = maximum_filter1d((x & (time > 0) | bad[:, None]).astype(float), 4 * n + 1, axis=0)
        kept.append(1.0 - uniform_filter1d(wide, 2 * n + 1, axis=0))
    return tuple(kept), time


def held_in(model: SerialModel, trials: Trials) -> list[HeldReadings]:
    """Intervals in which encoders hold their last value, in all trials."""
    found = []
    for trial, s in enumerate(trials.signals):
        for held in s.held:
            times = [Event(trial, float(s.log.time[a]), (b - a) / s.log.rate_hz) for a, b in held.spans]
            times = [event for event in times if s.time[0] <= event.start_s <= s.time[-1]]
            found.append((held.column, times, held.nats * len(times) / len(held.spans)))
    total_s = sum(len(s.time) / s.rate_hz for s in trials.signals)
    return held_readings(found, total_s, lambda j: (model.joints[j], j + 1, model.joints[j]))


def part_of(s: Signals, at: slice) -> Signals:
    """Cut a range of samples from the signals."""
    own = {name: getattr(s, name)[at] for name in ("time", "q", "dq", "ddq", "torque", "usable", "inverse")}
    more = {
        name: x if (x := getattr(s, name)) is None else x[at]
        for name in ("enabled", "spoilt", "by_delay", "by_command")
    }
    return replace(s, **own, **more)


def _runs(s: Signals, joints: NDArray[np.intp]) -> list[slice]:
    """Usable stretches without the ends affected by smoothing; short gaps are bridged."""
    bad = ~s.usable[:, joints].all(axis=1)
    edge = max(1, round(EDGE_S * s.rate_hz))
    cuts = [-1, *np.flatnonzero(bad).tolist(), len(s.usable)]
    runs: list[list[int]] = []
    for a, b in itertools.pairwise(cuts):
        if b - a > 1:
            if runs and a + 1 - runs[-1][1] <= SHORT_S * s.rate_hz + 1:
                runs[-1][1] = b
            else:
                runs.append([a + 1, b])
    out = [slice(a + edge, b - edge) for a, b in runs]
    least = max(LEAST_S * s.rate_hz, LEAST_SAMPLES)
    out = [run for run in out if run.stop - run.start >= least]
    if not out:
        raise InputError(
            f"{s.log.name}: no part of it is long enough to diagnose; it needs at least "
            f"{least / s.rate_hz + 2 * EDGE_S:.2g} s without gaps"
        )
    return out


def _name(s: Signals, at: slice, *, whole: bool) -> str:
    name = Path(s.log.name).stem
    return name if whole else f"{name} {s.time[at.start]:.2f}-{s.time[at.stop - 1]:.2f} s"


def notes_of(logs: Sequence[JointLog]) -> Iterator[str]:
    """Notes on the logs; for notes that differ only in numbers, the first and the count of the others."""
    alike: dict[str, list[str]] = {}
    for log in logs:
        for note in log.notes:
            alike.setdefault(re.sub(r"\d[\d.e+-]*", "#", note), []).append(f"{log.name}: {note}")
    for notes in alike.values():
        more = len(notes) - 1
        parts = f"{more} more part{'s' if more > 1 else ''} of the logs"
        yield notes[0] + (f" So it is, with other numbers, in {parts}." if more else "")


def at_limits(model: SerialModel, limited: Array) -> Iterator[str]:
    """Notes on samples that are left out because a joint is at a limit."""
    for name, seconds in zip(model.joints, limited, strict=True):
        if seconds:
            yield f"{seconds:.2g} s of {name} at its limits in the model are left out: nobody knows the limit's torque."


def resting(logs: Sequence[JointLog]) -> Iterator[str]:
    """A note on joints at rest in all logs, because such logs say little about them."""
    still = np.ones(len(logs[0].joints), dtype=bool) if logs else np.zeros(0, dtype=bool)
    for log in logs:
        # Second differences of white noise have six times its variance; those of a motion are small.
        noise: Array = np.std(np.diff(log.q, 2, axis=0), axis=0) / np.sqrt(6.0)
        still &= np.std(log.q - log.q[0], axis=0) <= np.maximum(RESTS * noise, log.position_step)
    names = [name for name, rests in zip(logs[0].joints, still, strict=True) if rests] if logs else []
    if names and still.all():
        yield "No joint moves in these logs; they tell no friction and no inertia, and gravity in one pose only."
    elif names:
        which = f"{', '.join(names[:-1])} and {names[-1]} do" if len(names) > 1 else f"{names[0]} does"
        yield f"{which} not move in these logs, which tell no friction and no rotor there."

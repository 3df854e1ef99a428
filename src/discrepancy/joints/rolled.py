"""Simulate the model and the extended model, and compare them with the logs: free rollouts and the closed loop.

The key ``rollouts`` of a diagnosis. It is null for other machines and if the rollouts were skipped on request:

joints, units       joint names in the model's order, and ``rad`` or ``m``
validated           false for a single trial, because all values were fitted to it
why_not             reason why there are no free rollouts, or null
horizons            list, empty without free rollouts, of
    seconds                        length of each rollout
    starts                         number of rollouts
    before, after                  {rms, diverged} of the given and of the extended model, lists over the joints.
                                   ``rms`` is the rms position error over the starts at which the joint did not
                                   diverge. It is null if more than half of them diverged. ``diverged`` is the number
                                   of starts at which it did. ``after`` is null without findings
    removed                        share of the rms error removed, over the starts at which the joint diverged with
                                   neither model; null if these are less than half
not_simulated       named causes that the rollouts lack
refused             MuJoCo's messages on extended models that do not compile, by trial
commanded           the closed loop:
    why_not                        reason why there is none, or null
    joints                         joints with a closed loop, from 1; the others get their logged torques
    blocks                         list of {name, seconds, motion, before, after}: rms position error over the trial and
                                   standard deviation of the measured motion, lists over the joints; null if a joint
                                   diverged, ``after`` null without findings
    before, after, removed         the same over all trials in which the joint diverged with neither model
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from discrepancy.evidence.findings import Event, Finding
from discrepancy.joints.effects import all_effects, label, numbered
from discrepancy.joints.mechanics import Coupling
from discrepancy.joints.model import SerialModel
from discrepancy.joints.servo import Commanded, LoopLaw, Motor, Servo, loop_laws, servo_of
from discrepancy.joints.signals import Signals, smoothing_hz
from discrepancy.joints.verdict import JointVerdict
from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_logs.joints.joint_log import JointLog
from mocobot_sim.serial.effects import RobotEffect
from mocobot_sim.serial.extended import Drive, Start, rollout
from mocobot_sim.serial.mjcf import Built, build

LONGEST_STEP_S = 1e-3
"""Longest integration step of MuJoCo [s]. Chosen: 1/20 of the shortest period after smoothing."""
KNOWN = ("torque_offset", "torque_scale", "torque_delay", "back_emf")
"""Causes that make the logged torque differ from the torque at the joint."""


@dataclass(frozen=True, eq=False)
class Readings:
    """How a logged torque relates to the torque at the joint; arrays of shape (J,).

    Logged torque = ``scale`` x + ``squared`` x |x| + ``offset`` for a joint torque x, logged ``delay_s`` late. The
    quadratic term describes a scale that depends on the load.

    Attributes:
        offset: [N m or N].
        scale: scale at zero load; 1 if it is correct.
        squared: increase of the scale per load [1/(N m) or 1/N].
        delay_s: delay of the logged torque [s].
        braking: torque loss per speed while the drive is on (back-EMF) [N m s/rad or N s/m].
    """

    offset: Array
    scale: Array
    squared: Array
    delay_s: Array
    braking: Array

    @classmethod
    def of(cls, effects: Sequence[RobotEffect], joints: int) -> Readings:
        """Build from effects with causes in ``KNOWN``; joints count from 1."""
        out = cls(np.zeros(joints), np.ones(joints), *np.zeros((3, joints)))
        for effect in effects:
            assert effect.joint is not None
            j = effect.joint - 1
            if effect.cause == "torque_offset":
                out.offset[j] += effect.number("offset")
            elif effect.cause == "torque_scale":
                scale, bend = effect.number("scale"), effect.number("bend")
                out.scale[j] += scale * (1.0 - bend)
                out.squared[j] += scale * bend / effect.number("typical_load") if bend else 0.0
            elif effect.cause == "torque_delay":
                out.delay_s[j] += effect.number("delay")
            else:
                out.braking[j] += effect.number("braking")
        return out

    def real(self, told: Array, dq: Array, on: Array | float) -> Array:
        """Convert logged torques to torques at the joints.

        Args:
            told: torques as logged, shape (..., J).
            dq: joint velocities, shape (..., J).
            on: whether the drives are on, shape (..., 1) or ().
        """
        read = told - self.offset * on
        # Root of squared x^2 + scale x = |read|, in the form that is valid for squared = 0.
        root = np.sqrt(np.maximum(self.scale**2 + 4.0 * self.squared * np.abs(read), 0.0))
        real = 2.0 * read / (self.scale + root)
        return real - on * self.braking * dq if self.braking.any() else real


@dataclass(frozen=True, eq=False)
class LoggedTorques:
    """Logged torques that drive a simulation, interpolated linearly between samples.

    Attributes:
        time: equidistant sample times [s], shape (Q,).
        torque: torques at zero speed, shape (Q, J).
        braking: torque loss per speed, shape (Q, J); None: no loss.
    """

    time: Array
    torque: Array
    braking: Array | None

    @classmethod
    def of(cls, log: JointLog, readings: Readings) -> LoggedTorques:
        """Build from a log with torques."""
        assert log.torque is not None
        on = np.ones(len(log.time)) if log.enabled is None else log.enabled.astype(float)
        torque = log.torque.copy()
        late = log.by_command and log.drive.command == "position"
        for j in np.flatnonzero(readings.delay_s):
            if late and log.command is not None:  # the command acts late
                told = log.drive.position_gain[j] * log.command[:, j]
                torque[:, j] += np.interp(log.time - readings.delay_s[j], log.time, told) - told
                continue
            good = np.isfinite(log.torque[:, j])
            torque[:, j] = np.interp(log.time + readings.delay_s[j], log.time[good], log.torque[good, j])
        braking = on[:, None] * readings.braking if readings.braking.any() else None
        return cls(log.time, readings.real(torque, np.zeros_like(torque), on[:, None]), braking)

    def __call__(self, time: float, q: Array, dq: Array) -> Array:
        """Torques at the joints, shape (J,)."""
        at = (time - self.time[0]) / (self.time[1] - self.time[0])
        k = min(max(int(at), 0), len(self.time) - 2)
        share = min(max(at - k, 0.0), 1.0)
        out = (1.0 - share) * self.torque[k] + share * self.torque[k + 1]
        return out if self.braking is None else out - self.braking[k] * dq


@dataclass(frozen=True, eq=False)
class Robot:
    """A model with findings, ready to simulate one trial.

    Attributes:
        built: the compiled robot.
        readings: relation between logged torques and torques at the joints.
        every: integration steps between two samples.
        left_out: names of findings that neither the robot nor the readings contain.
        coupling: how joints of the robot follow the J joints of the log.
    """

    built: Built
    readings: Readings
    every: int
    left_out: tuple[str, ...]
    coupling: Coupling

    @classmethod
    def of(cls, model: SerialModel, findings: Sequence[Finding], rate_hz: float) -> Robot:
        """Build the model with findings for a sample rate.

        Raises:
            InputError: MuJoCo refuses the model with these findings.
        """
        pairs = all_effects(findings, model)
        acting = [pair for pair in pairs if pair[1].cause not in KNOWN]
        every = max(1, math.ceil((1.0 - 1e-9) / rate_hz / LONGEST_STEP_S))
        effects = numbered((effect for _, effect in acting), model)
        built = build(model.source.copy(), effects, 1.0 / rate_hz / every)
        left = dict.fromkeys(label(acting[k][0]) for k in built.left_out)
        readings = Readings.of([e for _, e in pairs if e.cause in KNOWN], len(model.joints))
        return cls(built, readings, every, tuple(left), model.coupling)

    def errors(
        self, s: Signals, piece: slice, drive: Drive, limit: Array, tick: Callable[[float], object] = lambda _: None
    ) -> Array:  # fmt: skip
        """Simulated minus measured positions, shape (n, J); NaN for a joint from the sample at which it diverges.

        Args:
            s: the trial.
            piece: samples to simulate.
            drive: joint torques as a function of time and state.
            limit: error at which a joint counts as diverged, shape (J,).
            tick: receives the log time at every step.
        """

        own = self.coupling.own

        def watched(time: float, q: Array, dq: Array) -> Array:
            tick(time)
            torque = np.zeros(len(q))
            torque[own] = drive(time, q[own], dq[own])
            return torque

        first, measured = piece.start, s.q[piece]
        start = Start(float(s.time[first]), *self.coupling.all(s.q[first], s.dq[first], s.ddq[first]))
        there = rollout(self.built, start, watched, len(measured) - 1, self.every)[:, own]
        error = np.full(measured.shape, np.nan)
        error[: len(there)] = there - measured[: len(there)]
        error[np.maximum.accumulate(~(np.abs(error) <= limit), axis=0)] = np.nan
        return error


HORIZONS_S = (0.1, 0.2, 0.5)
"""Rollout lengths [s]. Chosen: from the effect of friction to the time in which an arm reverses."""
MOST_STARTS = 60
"""Upper limit of rollouts over all trials. Chosen: root mean squares are then accurate to a tenth."""
MOST_DIVERGED = 0.5
"""Largest share of diverged starts for which a joint still has an rms error; beyond it, only easy starts remain."""
EDGE_PERIODS = 2.5
"""Usable samples required around a rollout, in periods of the smoothing. Derived: length of the filter's response."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One trial, ready for rollouts.

    Attributes:
        signals: smoothed log.
        given: the model as described.
        found: the extended model; None if MuJoCo refuses it.
        limit: error at which a joint counts as diverged [rad or m], shape (J,).
        events: events in this trial; they are not simulated.
        tick: receives the log time at every step.
    """

    signals: Signals
    given: Robot
    found: Robot | None
    limit: Array
    events: Sequence[Event] = ()
    tick: Callable[[float], object] = lambda _: None

    def both(self, run: Callable[[Robot], Array], shape: tuple[int, ...]) -> tuple[Array, Array]:
        """Run the given and the extended model; NaN if MuJoCo refuses the latter."""
        before = run(self.given)
        if self.found is self.given:
            return before, before
        return before, np.full(shape, np.nan) if self.found is None else run(self.found)


@dataclass(eq=False)
class Horizon:
    """Position errors after a fixed time, one array (J,) for each start, for the given and the extended model.

    NaN where a joint diverged.
    """

    seconds: float
    before: list[Array] = field(default_factory=list)
    after: list[Array] = field(default_factory=list)


def diverged(errors: Array) -> Array:
    """Number of starts at which each joint diverged, shape (J,)."""
    return np.isnan(errors).sum(axis=0)


def rms(errors: Array) -> Array:
    """Rms error of each joint over the starts at which it did not diverge, shape (J,).

    NaN if it diverged at more than ``MOST_DIVERGED`` of the starts.
    """
    good = np.isfinite(errors)
    count = good.sum(axis=0)
    count = np.where(count >= (1.0 - MOST_DIVERGED) * len(errors), count, 0)
    square = np.sum(np.where(good, errors, 0.0) ** 2, axis=0)
    return np.sqrt(square / np.where(count, count, np.nan))


def in_neither(before: Array, after: Array) -> tuple[Array, Array, Array]:
    """Rms errors over starts at which a joint diverged with neither model, and the share removed, shape (J,) each."""
    both = np.isfinite(before) & np.isfinite(after)
    first, second = (rms(np.where(both, errors, np.nan)) for errors in (before, after))
    return first, second, 1.0 - second / np.where(first > 0, first, np.nan)


def usable(s: Signals, events: Sequence[Event] = ()) -> NDArray[np.bool_]:
    """Samples at which the motion and all torques are known within the reach of the smoothing filter, shape (W,).

    Args:
        s: one trial.
        events: intervals to exclude.
    """
    margin = math.ceil(EDGE_PERIODS / smoothing_hz(s.log.rate_hz) * s.rate_hz)
    bad = np.pad(np.logical_not(s.usable).any(axis=1), margin)  # the ends of a trial are valid
    out = np.convolve(bad, np.ones(2 * margin + 1), mode="valid") < 0.5
    for event in events:
        out &= (s.time < event.start_s) | (s.time > event.start_s + event.duration_s)
    return out


def starts(
    good: NDArray[np.bool_], first: int, apart: int, longest: int, least: int
) -> list[tuple[int, int]]:
    """Start samples of rollouts, and the number of samples that each can cover.

    Args:
        good: usable samples of a trial.
        first: sample of the first start.
        apart: samples between starts.
        longest: samples of the longest rollout.
        least: samples of the shortest useful rollout.
    """
    ends = np.append(np.flatnonzero(~good), len(good))
    out = []
    for a in range(first, len(good), apart):
        reach = int(ends[np.searchsorted(ends, a)]) - a - 1  # up to the last usable sample
        if reach >= least:
            out.append((a, min(reach, longest)))
    return out


def roll_freely(trial: Trial, horizons: Sequence[Horizon], passed_s: float, total_s: float) -> None:
    """Simulate one trial from many starts, and append the errors to the horizons.

    Args:
        trial: a trial with torques of all joints.
        horizons: sorted from shortest to longest.
        passed_s: total duration of the trials before it [s]; starts are equidistant over all trials together.
        total_s: total duration of all trials [s].
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


MOST_LOOP_S = 100.0
"""Longest closed-loop simulation over all trials together, with equal shares [s]."""


@dataclass(frozen=True, eq=False)
class LoopRun:
    """Closed-loop simulation of one trial.

    Attributes:
        joints: joints with a closed loop, from 0; the others get their logged torques.
        seconds: simulated duration [s].
        motion: standard deviation of the measured positions [rad or m], shape (J,).
        before, after: rms of simulated minus measured positions, shape (J,); NaN for a joint that diverged.
    """

    joints: tuple[int, ...]
    seconds: float
    motion: Array
    before: Array
    after: Array


@dataclass(frozen=True, eq=False)
class LoopDrive:
    """Joint torques from the closed loops, and from the log for joints without a loop.

    Attributes:
        commanded: the loops.
        logged: torques of the other joints; None if all joints have loops.
        readings: relation between logged torques and torques at the joints. It also applies to the torque of a duty.
            Delays of logged torques are ignored because a loop does not know its past torque.
    """

    commanded: Commanded
    logged: LoggedTorques | None
    readings: Readings

    @classmethod
    def of(cls, log: JointLog, servos: Sequence[Servo], readings: Readings) -> LoopDrive:
        """Build the drives of one log."""
        every = len(servos) == log.q.shape[1]
        late = readings.delay_s if log.by_command else np.zeros(log.q.shape[1])
        commanded = Commanded.of(log, servos, late + np.nan_to_num(log.drive.delay_s))
        return cls(commanded, None if every else LoggedTorques.of(log, readings), readings)

    def __call__(self, time: float, q: Array, dq: Array) -> Array:
        """Torques at the joints, shape (J,)."""
        on = float(self.commanded.on[self.commanded.sample(time)])
        real = self.readings.real(self.commanded.told(time, q, dq), dq, on)
        if self.logged is None:
            return real
        out = self.logged(time, q, dq)
        at = [servo.joint for servo in self.commanded.servos]
        out[at] = real[at]
        return out


def loop_run(
    trial: Trial, joints: Sequence[str], motors: Sequence[Motor], laws: Sequence[LoopLaw], most_s: float
) -> LoopRun | str:
    """Simulate a trial under its commands over the longest stretch with known signals, or return why not.

    Args:
        trial: the trial with its models.
        joints: joint names.
        motors: torque per unit of duty of drives without torque readings.
        laws: firmware loops, fitted to the other trials.
        most_s: longest duration to simulate [s].
    """
    s = trial.signals
    if s.log.drive.command == "none" or s.log.command is None:
        return "the log has no commands"
    each = [servo_of(s.log, j, motors, laws, name) for j, name in enumerate(joints)]
    servos = [servo for servo in each if isinstance(servo, Servo)]
    if not servos:
        return next(servo for servo in each if isinstance(servo, str))
    piece = longest(_known(s, servos))
    piece = slice(piece.start, min(piece.stop, piece.start + int(most_s * s.rate_hz)))
    if piece.stop - piece.start < 2:
        return "the commands are known nowhere in a trial"

    def run(robot: Robot) -> Array:
        drive = LoopDrive.of(s.log, servos, robot.readings)
        return np.sqrt(np.mean(robot.errors(s, piece, drive, trial.limit, trial.tick) ** 2, axis=0))

    before, after = trial.both(run, (len(joints),))
    seconds = (piece.stop - piece.start - 1) / s.rate_hz
    own = tuple(servo.joint for servo in servos)
    return LoopRun(own, seconds, np.std(s.q[piece], axis=0), before, after)


def laws_without(parts: Sequence[Signals], trial: int) -> list[LoopLaw]:
    """Fit firmware loops to all trials but one; to this one if there is no other."""
    own, logs = parts[trial], {id(s.log): s.log for s in parts}
    if len(parts) > 1:
        log = own.log
        outside = (log.time < own.time[0]) | (log.time > own.time[-1])
        logs[id(log)] = replace(log, usable=log.usable & outside)
    return loop_laws(list(logs.values()))


def longest(good: NDArray[np.bool_]) -> slice:
    """The longest run of good samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    if not len(edges):
        return slice(0, 0)
    begins, ends = edges[::2], edges[1::2]
    best = int(np.argmax(ends - begins))
    return slice(int(begins[best]), int(ends[best]))


def _known(s: Signals, servos: Sequence[Servo]) -> NDArray[np.bool_]:
    """Samples with known motion and commands, and known torques of joints without a loop, shape (W,)."""
    log = s.log
    assert log.command is not None
    at = [servo.joint for servo in servos]
    good = log.usable & np.isfinite(log.command[:, at]).all(axis=1)
    if any(servo.by_supply for servo in servos) and log.drive.supply_V is not None:
        good &= np.isfinite(log.drive.supply_V)
    here = good[np.searchsorted(log.time, s.time - 1e-9)]
    every = len(at) == s.q.shape[1]
    return here & usable(replace(s, usable=here[:, None]) if every else s)


DIVERGED_RAD = math.pi
"""Position error at which a revolute joint has diverged [rad]. Derived: the angle is ambiguous beyond half a turn.

For a prismatic joint it is the extent of the model or the joint's travel in the log, whichever is larger.
"""
TOLD_S = 2.0
"""Time between progress messages [s]."""


def rolled_out(verdict: JointVerdict, say: Callable[[str], object] = lambda _: None) -> dict[str, Any] | None:
    """Run free rollouts and the closed loop, and return the values documented above; None with a reference.

    With a reference, the model error common to all logs has no fitted values. It would hide the change.

    Args:
        verdict: the diagnosis; each trial is simulated with findings fitted to the other trials.
        say: receives progress messages.
    """
    if verdict.reference:
        return None
    model, parts, named = verdict.model, verdict.parts, bool(verdict.findings)
    travel = np.max([np.ptp(s.q, axis=0) for s in parts], axis=0)
    extent = np.maximum(float(model.model.stat.extent), travel)
    limit = np.where(model.slides, extent, DIVERGED_RAD)
    known = np.all([s.usable.any(axis=0) for s in parts], axis=0)
    why_not = None if known.all() else f"no torque of joint {model.joints[int(np.argmin(known))]} is known"
    horizons, runs, refused = [Horizon(h) for h in HORIZONS_S], [], []
    left = {label(f): None for f in verdict.findings if f.event is not None or f.cause == "unlisted"}
    lengths, loop_why = [len(s.time) / s.rate_hz for s in parts], ""
    for k, (s, name) in enumerate(zip(parts, verdict.trials, strict=True)):
        given, found = Robot.of(model, (), s.rate_hz), None
        try:
            found = Robot.of(model, verdict.by_the_others(k), s.rate_hz) if named else given
            left = dict.fromkeys(found.left_out) | left
        except InputError as error:
            refused.append(f"{name}: {error}")
        events = [f.event for f in verdict.findings if f.event is not None and f.event.trial == k]
        tick = _Progress(say, f"rolling out {name} (trial {k + 1} of {len(parts)})")
        trial = Trial(s, given, found, limit, events, tick)
        if why_not is None:
            roll_freely(trial, horizons, sum(lengths[:k]), sum(lengths))
        laws = laws_without(parts, k)
        run = loop_run(trial, model.joints, verdict.motors, laws, MOST_LOOP_S / len(parts))
        if isinstance(run, LoopRun):
            runs.append((name, run))
        else:
            loop_why = run
    horizons = [h for h in horizons if h.before]
    if why_not is None and not horizons:
        why_not = "nowhere in a trial are torques and motion known for long enough"
    return {
        "joints": list(model.joints),
        "units": ["m" if slide else "rad" for slide in model.slides],
        "validated": len(parts) > 1,
        "why_not": why_not,
        "horizons": [_horizon(horizon, named=named) for horizon in horizons],
        "not_simulated": list(left),
        "refused": refused,
        "commanded": _commanded(runs, loop_why, named=named),
    }


class _Progress:
    """Reports the simulated time of a trial at intervals."""

    def __init__(self, say: Callable[[str], object], what: str) -> None:
        self._say, self._what = say, what
        self._last = time.monotonic()
        say(what)

    def __call__(self, at: float) -> None:
        now = time.monotonic()
        if now - self._last > TOLD_S:
            self._last = now
            self._say(f"{self._what}: at {at:.1f} s")


def _horizon(horizon: Horizon, *, named: bool) -> dict[str, Any]:
    before, after = np.array(horizon.before), np.array(horizon.after)
    return {
        "seconds": horizon.seconds,
        "starts": len(before),
        "before": _side(before),
        "after": _side(after) if named else None,
        "removed": _plain(in_neither(before, after)[2]) if named else None,
    }


def _side(errors: Array) -> dict[str, Any]:
    return {"rms": _plain(rms(errors)), "diverged": [int(n) for n in diverged(errors)]}


def _commanded(runs: Sequence[tuple[str, LoopRun]], why_not: str, *, named: bool) -> Mapping[str, Any]:
    if not runs:
        return {
            "why_not": why_not, "joints": [], "blocks": [], "before": None, "after": None, "removed": None
        }  # fmt: skip
    each = (np.array([getattr(run, side) for _, run in runs]) for side in ("before", "after"))
    before, after, removed = in_neither(*each)
    return {
        "why_not": None,
        "joints": [j + 1 for j in runs[-1][1].joints],
        "blocks": [
            {
                "name": name,
                "seconds": run.seconds,
                "motion": _plain(run.motion),
                "before": _plain(run.before),
                "after": _plain(run.after) if named else None,
            }
            for name, run in runs
        ],
        "before": _plain(before),
        "after": _plain(after) if named else None,
        "removed": _plain(removed) if named else None,
    }


def _plain(values: Array | Sequence[float]) -> list[float | None]:
    return [float(x) if np.isfinite(x) else None for x in values]

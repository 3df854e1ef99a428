"""The model and the extended model simulated, and held against the logs: rollouts and the closed loop.

The key ``rollouts`` of a diagnosis, null of other machines and where it was left out on request:

joints, units       names in the model's order, and ``rad`` or ``m``
validated           false for a single trial, to which everything was fitted
why_not             why there are no free rollouts, or null
horizons            list, empty where there are none, of
    seconds                        how far ahead
    starts                         how many rollouts there are
    before, after                  {rms, diverged} of the given and of the extended model, lists over the joints: rms
                                   position error over the starts at which the joint did not diverge (null: it did at
                                   more than half of them), and at how many it did; ``after`` is null where nothing is
                                   named
    removed                        share of the rms removed, over the starts at which the joint diverged in neither;
                                   null where these are less than half
not_simulated       named causes that the rollouts lack
refused             what MuJoCo said of extended models that it does not compile, by trial
commanded           the closed loop:
    why_not                        why there is none, or null
    joints                         whose loops are closed, from 1; the others get their logged torques
    blocks                         list of {name, seconds, motion, before, after}: rms position error over the trial and
                                   standard deviation of the measured motion, lists over the joints; null where a joint
                                   diverged, ``after`` null where nothing is named
    before, after, removed         the same over all trials in which a joint diverged in neither
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
from discrepancy.joints.effects import all_effects, label
from discrepancy.joints.model import SerialModel, load_spec
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
"""Longest step of MuJoCo's integration [s]. Chosen: a twentieth of the shortest period that smoothing leaves."""
KNOWN = ("torque_offset", "torque_scale", "torque_delay", "back_emf")
"""Causes that make a logged torque another than the joint has."""


@dataclass(frozen=True, eq=False)
class Readings:
    """A logged torque is ``scale`` times the joint's and ``squared`` times its square, plus ``offset``, so much late.

    All of shape (J,). The square has the torque's sign: a scale may depend on the load.

    Attributes:
        offset: [N m or N].
        scale: 1 where it is right, at no load.
        squared: by which it grows per load [1/(N m) or 1/N].
        delay_s: by which it comes late.
        braking: torque lost to the speed while the drive is on [N m s/rad or N s/m].
    """

    offset: Array
    scale: Array
    squared: Array
    delay_s: Array
    braking: Array

    @classmethod
    def of(cls, effects: Sequence[RobotEffect], joints: int) -> Readings:
        """Readings from causes in ``KNOWN``, joints counted from 1."""
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
        """Torques at the joints by those that the log would have, velocities, and whether the drives are on.

        Shapes (..., J), (..., J), and (..., 1) or ().
        """
        read = told - self.offset * on
        # The root of squared x^2 + scale x = |read|, in a form that has no zero below it.
        root = np.sqrt(np.maximum(self.scale**2 + 4.0 * self.squared * np.abs(read), 0.0))
        real = 2.0 * read / (self.scale + root)
        return real - on * self.braking * dq if self.braking.any() else real


@dataclass(frozen=True, eq=False)
class LoggedTorques:
    """The torques of a log as drives of a simulation, interpolated linearly between samples.

    Attributes:
        time: of the samples, even [s], shape (Q,).
        torque: at standstill, shape (Q, J); read where it was known only.
        braking: what is lost to the speed, shape (Q, J); None where nothing is.
    """

    time: Array
    torque: Array
    braking: Array | None

    @classmethod
    def of(cls, log: JointLog, readings: Readings) -> LoggedTorques:
        """Torques of a log that has them."""
        assert log.torque is not None
        on = np.ones(len(log.time)) if log.enabled is None else log.enabled.astype(float)
        torque = log.torque.copy()
        for j in np.flatnonzero(readings.delay_s):  # what was read late was there before
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
    """A model with findings in it, for one trial.

    Attributes:
        built: the robot.
        readings: what torques are really, by what the log says.
        every: steps of the integration between samples.
        left_out: findings that are in neither, in words.
    """

    built: Built
    readings: Readings
    every: int
    left_out: tuple[str, ...]

    @classmethod
    def of(cls, model: SerialModel, findings: Sequence[Finding], rate_hz: float) -> Robot:
        """The model with findings, for samples of some rate.

        Raises:
            InputError: MuJoCo refuses the model with the findings in it.
        """
        pairs = all_effects(findings, model)
        acting = [pair for pair in pairs if pair[1].cause not in KNOWN]
        every = max(1, math.ceil((1.0 - 1e-9) / rate_hz / LONGEST_STEP_S))
        built = build(load_spec(model.path), [effect for _, effect in acting], 1.0 / rate_hz / every)
        left = dict.fromkeys(label(acting[k][0]) for k in built.left_out)
        readings = Readings.of([e for _, e in pairs if e.cause in KNOWN], len(model.joints))
        return cls(built, readings, every, tuple(left))

    def errors(
        self, s: Signals, piece: slice, drive: Drive, limit: Array, tick: Callable[[float], object] = lambda _: None
    ) -> Array:  # fmt: skip
        """Simulated minus measured positions, shape (n, J); NaN of a joint from where it is off by more than it may.

        Args:
            s: the trial.
            piece: of its samples, from the start on.
            drive: what the drives give.
            limit: how far off a joint may be, shape (J,).
            tick: takes the time on the log's clock, at every step.
        """

        def watched(time: float, q: Array, dq: Array) -> Array:
            tick(time)
            return drive(time, q, dq)

        first, measured = piece.start, s.q[piece]
        start = Start(float(s.time[first]), s.q[first], s.dq[first], s.ddq[first])
        there = rollout(self.built, start, watched, len(measured) - 1, self.every)
        error = np.full(measured.shape, np.nan)
        error[: len(there)] = there - measured[: len(there)]
        error[np.maximum.accumulate(~(np.abs(error) <= limit), axis=0)] = np.nan
        return error


HORIZONS_S = (0.1, 0.2, 0.5)
"""How far ahead a robot is rolled out. Chosen: from where friction tells to where an arm has turned round."""
MOST_STARTS = 60
"""Most rollouts in all trials together: root mean squares are known to a tenth then."""
MOST_DIVERGED = 0.5
"""Share of the starts at which a joint may diverge and still have an error: those left are the easy ones."""
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


MOST_LOOP_S = 100.0
"""Longest closed loops in all trials together, equally long in each [s]."""


@dataclass(frozen=True, eq=False)
class LoopRun:
    """One trial under its commands.

    Attributes:
        joints: of which the loop is closed, from 0; the others get their logged torques.
        seconds: how much of the trial.
        motion: standard deviation of the measured positions [rad or m], shape (J,).
        before, after: rms of simulated minus measured positions, shape (J,), NaN of a joint that diverged.
    """

    joints: tuple[int, ...]
    seconds: float
    motion: Array
    before: Array
    after: Array


@dataclass(frozen=True, eq=False)
class LoopDrive:
    """What drives give: by their loops where they have one, else as logged.

    Attributes:
        commanded: the loops.
        logged: torques of the other joints; None where all have loops.
        readings: what is wrong with logged torques, and so with what a duty is taken to give; delays are left out, as a
            loop cannot know its own torque before.
    """

    commanded: Commanded
    logged: LoggedTorques | None
    readings: Readings

    @classmethod
    def of(cls, log: JointLog, servos: Sequence[Servo], readings: Readings) -> LoopDrive:
        """The drives of one log."""
        every = len(servos) == log.q.shape[1]
        return cls(Commanded.of(log, servos), None if every else LoggedTorques.of(log, readings), readings)

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
    """Run a trial's commands for as long as all is known; or why that cannot be done.

    Args:
        trial: with its models.
        joints: names.
        motors: what drives that are told by duties give.
        laws: of firmware's loops, by the other trials.
        most_s: how much of it at most.
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
    """Laws of loops by all trials but one; by that, if there is no other."""
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
    """Samples whose motion and commands are known, and the torques of joints without a loop, shape (W,)."""
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
"""How far off a joint that turns may be. Derived: from half a turn on its angle says nothing of where the link is.
A joint that slides may be off by the extent of the model, or by its own travel in the log if that is more."""
TOLD_S = 2.0
"""Between lines of progress."""


def rolled_out(verdict: JointVerdict, say: Callable[[str], object] = lambda _: None) -> dict[str, Any] | None:
    """Free rollouts and the closed loop, as documented above; None with a reference.

    With a reference what is wrong on both days has no values of its own, so no model has it, and it would hide what has
    changed.

    Args:
        verdict: each trial is rolled out with findings that are fitted to the others.
        say: takes a line of progress.
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
    """Says now and then how far a trial is."""

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

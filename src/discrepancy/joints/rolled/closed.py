"""The closed loop: servos of the map follow the logged commands, with the given model and with the extended one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from discrepancy.joints.rolled.free import Trial, usable
from discrepancy.joints.rolled.robot import LoggedTorques, Readings, Robot
from discrepancy.joints.servo.commanded import Commanded, Servo, servo_of
from discrepancy.joints.servo.loop import LoopLaw, loop_laws
from discrepancy.joints.servo.motor import Motor
from discrepancy.joints.signals import Signals
from estimator.arrays import Array
from mocobot_logs.joints.joint_log import JointLog

MOST_LOOP_S = 100.0
"""Of closed loops in all trials together, each as long as the others. Chosen: they take seconds, too."""


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

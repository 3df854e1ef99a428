"""The closed loop: servos of the map follow the logged commands, with the given model and with the extended one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from discrepancy.engine.explanation import Explanation
from discrepancy.rules import rollouts as rules
from discrepancy.serial.recording.joint_log import JointLog
from discrepancy.serial.rig import SerialRig
from discrepancy.serial.rolled.fitted import Fitted, by_the_others, nominal, steps_per
from discrepancy.serial.rolled.free import bounds, compared
from discrepancy.serial.rolled.readings import LoggedTorques, Readings
from discrepancy.serial.rolled.starts import usable
from discrepancy.serial.rows.signals import Signals
from discrepancy.serial.servo.commanded import Commanded, Servo, servo_of
from discrepancy.serial.servo.loop import LoopLaw, loop_laws
from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.serial.rollout import Start


@dataclass(frozen=True, eq=False)
class LoopRun:
    """One block under its commands.

    Attributes:
        name: of the block.
        seconds: how much of it.
        motion: standard deviation of the measured positions [rad or m], shape (J,).
        before, after: rms of simulated minus measured positions, shape (J,), NaN of a joint that diverged; after is
            None where nothing is named.
    """

    name: str
    seconds: float
    motion: Array
    before: Array
    after: Array | None


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """Blocks under their commands.

    Attributes:
        joints: of which the loop is closed, from 0; the others get their logged torques.
        runs: one a block that could be run.
    """

    joints: tuple[int, ...]
    runs: tuple[LoopRun, ...]


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


def closed_loop(rig: SerialRig, explanation: Explanation) -> ClosedLoop | str:
    """Run every block's commands from its first usable sample to the first that is not; or why none can be run.

    Causes are fitted to the other blocks, and so is a firmware's law of the loop.

    Args:
        rig: the logs.
        explanation: what was found.
    """
    first = rig.parts[0].signals.log
    if first.drive.command == "none" or first.command is None:
        return "the log has no commands"
    runs, joints, why = [], (), ""
    limit = bounds(rig)
    for trial, (part, k) in enumerate(rig.block_of):
        s, names = part.signals, rig.model.joints
        laws = laws_without(rig, trial)
        each = [servo_of(s.log, j, rig.motors, laws, name) for j, name in enumerate(names)]
        servos = [servo for servo in each if isinstance(servo, Servo)]
        if not servos:
            why = next(servo for servo in each if isinstance(servo, str))
            continue
        piece = longest(_known(s, servos), part.blocks[k])
        longest_run = int(rules.MOST_LOOP_S / len(rig.trials) * s.rate_hz)
        piece = slice(piece.start, min(piece.stop, piece.start + longest_run))
        if piece.stop - piece.start < 2:
            why = f"{rig.trials[trial]}: its commands are not known"
            continue
        joints = tuple(servo.joint for servo in servos)
        every = steps_per(1.0 / s.rate_hz)
        step_s = 1.0 / s.rate_hz / every
        before, after = _rms(s, piece, servos, nominal(rig, step_s), every, limit), None
        if explanation.found:
            try:
                after = _rms(s, piece, servos, by_the_others(rig, explanation, trial, step_s), every, limit)
            except InputError:
                after = np.full(len(names), np.nan)
        seconds = (piece.stop - piece.start - 1) / s.rate_hz
        runs.append(LoopRun(rig.trials[trial], seconds, np.std(s.q[piece], axis=0), before, after))
    return ClosedLoop(joints, tuple(runs)) if runs else why


def laws_without(rig: SerialRig, trial: int) -> list[LoopLaw]:
    """Laws of loops by all blocks but one; by that, if there is no other."""
    own, k = rig.block_of[trial]
    logs = []
    for part in rig.parts:
        log = part.signals.log
        if part is own and len(rig.trials) > 1:
            time, block = part.signals.time, part.blocks[k]
            outside = (log.time < time[block.start]) | (log.time > time[block.stop - 1])
            log = replace(log, usable=log.usable & outside)
        logs.append(log)
    return loop_laws(logs)


def _known(s: Signals, servos: Sequence[Servo]) -> NDArray[np.bool_]:
    """Samples whose motion and commands are known, and the torques of joints without a loop, shape (W,)."""
    log = s.log
    assert log.command is not None
    at = [servo.joint for servo in servos]
    good = log.usable & np.isfinite(log.command[:, at]).all(axis=1)
    if any(servo.by_supply for servo in servos) and log.drive.supply_V is not None:
        good &= np.isfinite(log.drive.supply_V)
    here = good[np.searchsorted(log.time, s.time - 1e-9)]
    return here & usable(s) if len(at) < s.q.shape[1] else here


def _rms(s: Signals, piece: slice, servos: Sequence[Servo], robot: Fitted, every: int, limit: Array) -> Array:
    first = piece.start
    start = Start(float(s.time[first]), s.q[first], s.dq[first], s.ddq[first])
    drive = LoopDrive.of(s.log, servos, robot.readings)
    error = compared(start, robot, drive, s.q[piece], every, limit)
    return np.sqrt(np.mean(error**2, axis=0))


def longest(good: NDArray[np.bool_], block: slice) -> slice:
    """The longest run of good samples in a block."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good[block], [False]]).astype(int)))
    if not len(edges):
        return slice(block.start, block.start)
    begins, ends = edges[::2], edges[1::2]
    best = int(np.argmax(ends - begins))
    return slice(block.start + int(begins[best]), block.start + int(ends[best]))

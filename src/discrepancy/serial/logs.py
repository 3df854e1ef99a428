"""Logs of one robot, smoothed, cut into blocks and reduced to rows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from discrepancy.causes.free_while import free_while
from discrepancy.rules import serial as rules
from discrepancy.serial.mechanics.nominal import inverse_torque
from discrepancy.serial.mechanics.tree import Tree
from discrepancy.serial.model import SerialModel
from discrepancy.serial.recording.joint_log import JointLog
from discrepancy.serial.rows.reduction import Reduction, blocks
from discrepancy.serial.rows.signals import Signals
from discrepancy.serial.servo.motor import Motor, driven_by_voltage
from estimator.arrays import Array
from estimator.errors import InputError


@dataclass(frozen=True, eq=False)
class Part:
    """One log.

    Attributes:
        signals: smoothed.
        blocks: samples of every block.
        reduction: from samples to rows.
        knots_s: between knots of every joint's friction at rest, shape (J,).
    """

    signals: Signals
    blocks: tuple[slice, ...]
    reduction: Reduction
    knots_s: Array

    @property
    def names(self) -> list[str]:
        """Of the blocks."""
        time, name = self.signals.time, Path(self.signals.log.name).stem
        return [f"{name} {time[b.start]:.2f}-{time[b.stop - 1]:.2f} s" for b in self.blocks]

    def rests(self, block: int) -> list[Array]:
        """Rows (n, J) of friction that a joint may have while it rests, one unit each; it follows the load."""
        s = self.signals
        slow = s.slow
        out = []
        here = np.zeros(len(s.time), dtype=bool)
        here[self.blocks[block]] = True
        for j in range(s.q.shape[1]):
            still = (np.abs(s.dq[:, j]) < slow[j]) & here
            shortest = min(rules.SHORTEST_REST_S, float(self.knots_s[j]))
            for column in free_while(still, s.rate_hz, float(self.knots_s[j]), shortest):
                wide = np.zeros_like(s.q)
                wide[:, j] = column
                rows = self.reduction(wide)[block]
                if np.abs(rows).max(initial=0.0) > rules.LEAST_REST_SHARE:
                    out.append(rows)
        return out


def parts_of(
    model: SerialModel, logs: Sequence[JointLog], motors: Sequence[Motor] = ()
) -> tuple[tuple[Part, ...], NDArray[np.intp]]:
    """All logs, and the joints whose torques every one of them has, from 0.

    Args:
        model: the robot as described.
        logs: with torques.
        motors: drives whose torques follow from duties.

    Raises:
        InputError: a log is too short, or has no torques.
    """
    tree = Tree.of(model.model)
    inverse = partial(inverse_torque, model.model)
    known = np.ones(len(model.joints), dtype=bool)
    for log in logs:
        if log.torque is None:
            raise InputError(
                f"{log.name}: there are no torques, currents or duties, one of which the diagnosis needs"
            )
        known &= np.isfinite(log.torque).any(axis=0)
    joints = np.flatnonzero(known)
    if not len(joints):
        raise InputError(f"{logs[0].name}: no joint has torques in every log")
    signals = [Signals.of(log, tree, inverse) for log in logs]
    # One typical speed of a joint for all logs, or shapes would differ between them.
    square = [np.mean(s.dq**2, axis=0) for s in signals]
    typical = np.maximum(np.sqrt(np.mean(square, axis=0)), rules.LEAST_SPEED)
    # While a servo sticks its duty goes with its error, which is no load: friction at rest is whatever it gives.
    knots = np.full(len(model.joints), rules.REST_KNOTS_S)
    knots[[motor.joint for motor in motors]] = rules.SERVO_KNOTS_S
    if driven_by_voltage(motors, len(model.joints)).any():
        signals = [replace(s, cutoff_hz=min(s.cutoff_hz, rules.SERVO_CUTOFF_HZ)) for s in signals]
    parts = [_part(replace(s, typical=typical), joints, len(logs), knots) for s in signals]
    return tuple(parts), joints


def _part(signals: Signals, joints: NDArray[np.intp], logs: int, knots_s: Array) -> Part:
    cut = blocks(signals, logs)
    reduction = Reduction.of(signals, cut, joints)
    keep = [k for k, rows in enumerate(reduction.samples) if len(rows) >= rules.LEAST_ROWS]
    if not keep:
        least = math.ceil(rules.LEAST_ROWS / (signals.rate_hz / reduction.step))
        raise InputError(
            f"{signals.log.name}: no part of it is long enough to diagnose; it needs at least "
            f"{least * rules.FEWEST_BLOCKS} s without gaps"
        )
    if len(keep) < len(cut):
        cut = [cut[k] for k in keep]
        reduction = Reduction.of(signals, cut, joints)
    return Part(signals, tuple(cut), reduction, knots_s)

"""A model with findings in it, and the torques that its drives really give, by what a log says of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy.evidence.findings import Finding
from discrepancy.joints.effects import all_effects, label
from discrepancy.joints.model import SerialModel, load_spec
from discrepancy.joints.signals import Signals
from estimator.arrays import Array
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

"""Readings and clocks that are off: sensors and controllers follow the scene's record; the MJCF stays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from estimator.arrays import Array
from mocobot_sim.control.control import lag_filter
from mocobot_sim.effects.base import Effect
from mocobot_sim.trial.actors import Misreading, Reader, RobotReadings


@dataclass(frozen=True)
class PhiZero(Effect):
    """One phi encoder, for log and controller, reads ``zero_rad`` more than the truth [rad]; no MJCF edit."""

    as_built: ClassVar = {"zero_rad": "phi_zero_rad"}
    robot: int
    joint: int
    zero_rad: float


@dataclass(frozen=True)
class ThetaZero(Effect):
    """One gimbal encoder (joints 1, 2, 3 are z, y, x) reads ``zero_rad`` more than the truth [rad]; no MJCF edit."""

    as_built: ClassVar = {"zero_rad": "theta_zero_rad"}
    robot: int
    joint: int
    zero_rad: float


@dataclass(frozen=True)
class SeaBias(Effect):
    """One torque reading, for log and controller, is ``bias_Nm`` above the truth [N m]; no MJCF edit."""

    as_built: ClassVar = {"bias_Nm": "tau_zero_Nm"}
    robot: int
    joint: int
    bias_Nm: float


@dataclass(frozen=True)
class TorqueSkew(Effect):
    """All torques that one robot logs are ``delay_s`` older than the angles beside them [s]; may be negative.

    An entry of the scene's ``sensors``; no MJCF edit.
    """

    sensors: ClassVar = {"delay_s": "torque_delay_s"}
    ranges: ClassVar = {"delay_s": (-1.0, 1.0)}
    robot: int
    delay_s: float


@dataclass(frozen=True)
class TorqueLag(Effect):
    """A first-order lag of ``time_constant_s`` in one robot's torque sensors, seen by log and controller [s].

    An entry of the scene's ``sensors``; no MJCF edit.
    """

    sensors: ClassVar = {"time_constant_s": "torque_lag_s"}
    ranges: ClassVar = {"time_constant_s": (0.0, 10.0)}
    robot: int
    time_constant_s: float


@dataclass(frozen=True)
class ClockDelay(Effect):
    """Everything one robot logs was sampled ``delay_s`` before its time stamp [s]; commands are not shifted.

    An entry of the scene's ``sensors``; no MJCF edit.
    """

    sensors: ClassVar = {"delay_s": "clock_delay_s"}
    ranges: ClassVar = {"delay_s": (-1.0, 1.0)}
    robot: int
    delay_s: float


@dataclass(frozen=True)
class SensorLag(Effect):
    """A first-order lag of ``time_constant_s`` in one torque sensor, seen by log and controller [s].

    A reader of the trial; no MJCF edit.
    """

    ranges: ClassVar = {"time_constant_s": (0.0, 10.0)}
    robot: int
    joint: int
    time_constant_s: float

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """The sensor, at rest when the trial begins."""
        if not self.time_constant_s:
            return ()
        weights: list[float] = []
        last: list[float] = []

        def ready(dt: float) -> None:
            weights[:] = lag_filter(self.time_constant_s, dt)

        def change(readings: RobotReadings, seen: Array, time: float) -> None:
            x = readings.tau(seen, self.joint)
            a, of_old, of_new = weights
            y = a * last[0] + of_old * last[1] + of_new * x if last else x
            last[:] = (y, x)
            readings.set_tau(seen, self.joint, y)

        return (Misreading(self.robot, change, ready),)

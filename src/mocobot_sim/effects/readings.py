"""Effects on sensor readings and clocks; they act on the simulated sensors, and the MJCF does not change."""

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
    """A phi encoder that reads ``zero_rad`` above the true angle, in the log and in the controller [rad]."""

    as_built: ClassVar = {"zero_rad": "phi_zero_rad"}
    robot: int
    joint: int
    zero_rad: float


@dataclass(frozen=True)
class ThetaZero(Effect):
    """A gimbal encoder (joints 1, 2, 3 are z, y, x) that reads ``zero_rad`` above the true angle [rad]."""

    as_built: ClassVar = {"zero_rad": "theta_zero_rad"}
    robot: int
    joint: int
    zero_rad: float


@dataclass(frozen=True)
class SeaBias(Effect):
    """A torque sensor that reads ``bias_Nm`` above the true torque, in the log and in the controller [N m]."""

    as_built: ClassVar = {"bias_Nm": "tau_zero_Nm"}
    robot: int
    joint: int
    bias_Nm: float


@dataclass(frozen=True)
class TorqueSkew(Effect):
    """Logged torques of one robot that are ``delay_s`` older than the angles in the same row [s]; may be negative.

    The controller is unaffected.
    """

    sensors: ClassVar = {"delay_s": "torque_delay_s"}
    ranges: ClassVar = {"delay_s": (-1.0, 1.0)}
    robot: int
    delay_s: float


@dataclass(frozen=True)
class TorqueLag(Effect):
    """A first-order lag of all torque sensors of one robot; its time constant is ``time_constant_s`` [s].

    It affects log and controller.
    """

    sensors: ClassVar = {"time_constant_s": "torque_lag_s"}
    ranges: ClassVar = {"time_constant_s": (0.0, 10.0)}
    robot: int
    time_constant_s: float


@dataclass(frozen=True)
class ClockDelay(Effect):
    """A clock offset: one robot samples everything it logs ``delay_s`` before the time stamp [s].

    Commands are not shifted, and the controller is unaffected.
    """

    sensors: ClassVar = {"delay_s": "clock_delay_s"}
    ranges: ClassVar = {"delay_s": (-1.0, 1.0)}
    robot: int
    delay_s: float


@dataclass(frozen=True)
class SensorLag(Effect):
    """A first-order lag of one torque sensor; its time constant is ``time_constant_s`` [s].

    It affects log and controller.
    """

    ranges: ClassVar = {"time_constant_s": (0.0, 10.0)}
    robot: int
    joint: int
    time_constant_s: float

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """The lagging sensor, settled at its first reading when the trial begins."""
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

"""Effects on sensor readings and clocks; they act on the simulated sensors, and the MJCF does not change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

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


@dataclass(frozen=True)
class EncoderPlay(Effect):
    """Play ``play_rad`` between a gimbal joint and its encoder (joints 1, 2, 3 are z, y, x) [rad].

    The reading stands still until the joint has crossed the play, then follows half of it behind. It begins at the true
    angle in the middle of the play.
    """

    ranges: ClassVar = {"play_rad": (0.0, 0.2)}
    robot: int
    joint: int
    play_rad: float

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """The loose encoder, centred at its first reading."""
        if not self.play_rad:
            return ()
        half, last = 0.5 * self.play_rad, list[float]()

        def change(readings: RobotReadings, seen: Array, _time: float) -> None:
            x = readings.theta(seen, self.joint)
            y = min(max(last[0], x - half), x + half) if last else x
            last[:] = (y,)
            readings.add_theta(seen, self.joint, y - x)

        return (Misreading(self.robot, change),)


@dataclass(frozen=True)
class ZeroScatter(Effect):
    """Encoder zeros of one robot that differ from trial to trial, such as those of a new homing before each trial.

    Each zero is normally distributed with standard deviation ``phi_rad`` or ``theta_rad`` [rad]. The draw depends on
    the robot, the trial's number and ``draw`` only; a trial without number counts as number 0.
    """

    ranges: ClassVar = {"phi_rad": (0.0, 0.2), "theta_rad": (0.0, 0.2)}
    robot: int
    phi_rad: float = 0.0
    theta_rad: float = 0.0
    draw: int = 0

    def zeros(self, trial_number: int | None) -> Array:
        """Zeros of phi and theta in one trial [rad], shape (2, 3)."""
        rng = np.random.default_rng([self.draw, self.robot, trial_number or 0])
        return np.array([[self.phi_rad], [self.theta_rad]]) * rng.standard_normal((2, 3))

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """All six encoders of the robot with the zeros of this trial."""
        if not (self.phi_rad or self.theta_rad):
            return ()
        phi, theta = self.zeros(trial_number).tolist()

        def change(readings: RobotReadings, seen: Array, _time: float) -> None:
            for k in range(3):
                readings.add_phi(seen, k + 1, phi[k])
                readings.add_theta(seen, k + 1, theta[k])

        return (Misreading(self.robot, change),)

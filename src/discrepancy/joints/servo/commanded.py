"""A position servo in a simulation: its commands are the log's, its errors are the simulated joint's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy.joints.servo.loop import LoopLaw
from discrepancy.joints.servo.motor import Motor
from estimator.arrays import Array
from mocobot_logs.joints.joint_log import JointLog

MOST_LOOP_SHARE = 0.1
"""Share of a duty's variance that a loop's law may leave. Chosen: what leaves more is another kind of loop."""


@dataclass(frozen=True)
class Servo:
    """The loop of one joint: output = ``per_rad`` (command - position) - ``damping`` velocity, cut off at ``limit``.

    Attributes:
        joint: which, from 0.
        per_rad: output per rad or m of error.
        damping: output per rad/s or m/s.
        limit: most that it gives.
        torque: of one unit of output at standstill [N m or N].
        by_supply: whether that is per volt of supply: the output is a duty.
    """

    joint: int
    per_rad: float
    damping: float
    limit: float
    torque: float
    by_supply: bool


def servo_of(
    log: JointLog, j: int, motors: Sequence[Motor], laws: Sequence[LoopLaw], name: str
) -> Servo | str:
    """The loop of a joint by the map's gains or, where these are a firmware's, by what logs have; or why there is none.

    Args:
        log: with the commands.
        j: the joint, from 0.
        motors: what drives that are told by duties give.
        laws: of loops, fitted to logs that are not to be simulated.
        name: of the joint.
    """
    drive = log.drive
    if drive.command != "position":
        said = "no command is logged" if drive.command == "none" else f"it is commanded a {drive.command}"
        return f"joint {name}: {said}, and the loop that is simulated is a position's"
    if log.command is None or not np.isfinite(log.command[:, j]).any():
        return f"joint {name}: no command is logged"
    gain, damping, limit = (float(x[j]) for x in (drive.position_gain, drive.velocity_gain, drive.limit))
    damping = 0.0 if np.isnan(damping) else damping
    limit = np.inf if np.isnan(limit) else limit
    if drive.gain_of == "torque":
        if np.isnan(gain):
            return f"joint {name}: the map has no position_gain"
        return Servo(j, gain, damping, limit, 1.0, by_supply=False)
    if drive.gain_of == "velocity":
        return f"joint {name}: what torque its velocity loop gives is not known"
    motor = next((motor for motor in motors if motor.joint == j and motor.unit != "A"), None)
    if motor is None:
        return f"joint {name}: what torque a duty gives is not known"
    if drive.gain_of == "firmware" or np.isnan(gain):
        per_rad = _fitted(laws, j, gain)
        if per_rad is None:
            return f"joint {name}: the duties of other logs tell no law of its loop"
        gain, damping = per_rad, 0.0
    return Servo(j, gain, damping, min(limit, 1.0), motor.torque_per_unit, by_supply=motor.unit == "V")


def _fitted(laws: Sequence[LoopLaw], j: int, gain: float) -> float | None:
    """Output per rad at a gain: as it was fitted there, or as laws at other gains have it per unit of gain."""
    good = [law for law in laws if law.joint == j and law.share < MOST_LOOP_SHARE]
    same = [law.per_rad for law in good if law.gain == gain or (np.isnan(law.gain) and np.isnan(gain))]
    if same:
        return same[0]
    each = [law.per_rad / law.gain for law in good if np.isfinite(law.gain)]
    return float(np.mean(each)) * gain if each and np.isfinite(gain) else None


@dataclass(frozen=True, eq=False)
class Commanded:
    """Torques as the log would have them, of servos that follow its commands.

    Attributes:
        servos: of joints that have one.
        time: of the samples, even [s], shape (Q,).
        command: held from sample to sample, shape (Q, J).
        supply_V: shape (Q,); 1 where no servo needs it.
        on: whether the drives are on, shape (Q,).
    """

    servos: tuple[Servo, ...]
    time: Array
    command: Array
    supply_V: Array
    on: Array

    @classmethod
    def of(cls, log: JointLog, servos: Sequence[Servo]) -> Commanded:
        """With the commands of a log."""
        assert log.command is not None
        count = len(log.time)
        on = np.ones(count) if log.enabled is None else log.enabled.astype(float)
        supply = np.ones(count) if log.drive.supply_V is None else log.drive.supply_V
        return cls(tuple(servos), log.time, log.command, supply, on)

    def sample(self, time: float) -> int:
        """Which sample holds at a time."""
        # Half a step of rounding must not hold the sample before.
        k = int((time - self.time[0]) / (self.time[1] - self.time[0]) + 1e-6)
        return min(max(k, 0), len(self.time) - 1)

    def told(self, time: float, q: Array, dq: Array) -> Array:
        """Torques of the servos [N m or N], shape (J,); 0 at joints that have none."""
        k, out = self.sample(time), np.zeros(len(q))
        for servo in self.servos:
            j = servo.joint
            output = servo.per_rad * (self.command[k, j] - q[j]) - servo.damping * dq[j]
            output = min(max(output, -servo.limit), servo.limit)
            out[j] = self.on[k] * servo.torque * output * (self.supply_V[k] if servo.by_supply else 1.0)
        return out

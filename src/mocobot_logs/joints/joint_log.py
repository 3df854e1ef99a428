"""A log of one robot's joints on an even grid, in the units and the order of the model's joints."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array

Command = Literal["none", "position", "velocity", "torque", "duty"]
"""What the robot is told: nothing that is logged, or where to go, how fast, or what to give."""
GainOf = Literal["torque", "velocity", "duty", "firmware"]


@dataclass(frozen=True, eq=False)
class Drive:
    """What lies between the motors and the joints, as the map says; unknown numbers are NaN.

    Attributes:
        gear: motor turns per joint turn, with sign, shape (J,); 1 where the log is of the joint side.
        coupling: joint positions from motor positions, q = coupling @ motor + constant, gears included, shape (J, J).
            Joint torques are inv(coupling).T @ motor torques: the power is the same on both sides.
        torque_constant: of each motor [N m/A], shape (J,), NaN where it is free; 1 where the log has torques. A free
            constant leaves ``JointLog.torque`` in amperes times gear.
        link_side: whether the torque is measured behind the drive, by a sensor in the joint, shape (J,): what rubs in
            motor and gear does not show in it.
        command: what is commanded.
        position_gain: of the position loop, in torque, velocity or duty (by ``gain_of``) per rad or m of
            error, shape (J,).
        velocity_gain: of the velocity loop or of the damping, per rad/s or m/s, shape (J,).
        gain_of: what the gains make of an error: a torque [N m], a velocity [rad/s] or a duty (1 is full scale); gains
            of a firmware are in its own unit, proportional to one of these by a factor that is not known.
        limit: most that the loop gives, in ``gain_of`` (a duty for a firmware's gains), shape (J,).
        supply_V: what motors have of the supply: the mean of its reading [V], shape (Q,), or None.
        duty: share of that which each motor is given, -1 to 1, shape (Q, J), or None.
    """

    gear: Array
    coupling: Array
    torque_constant: Array
    link_side: NDArray[np.bool_]
    command: Command
    position_gain: Array
    velocity_gain: Array
    gain_of: GainOf
    limit: Array
    supply_V: Array | None = None
    duty: Array | None = None


@dataclass(frozen=True, eq=False)
class JointLog:
    """One log, sampled evenly.

    Attributes:
        name: for messages.
        time: from 0 on, uniform at ``rate_hz`` [s], shape (Q,).
        rate_hz: sampling rate [Hz].
        q: joint positions in the model's order [rad or m], shape (Q, J).
        torque: at the joints, behind gear, coupling and torque constant [N m or N], shape (Q, J), NaN where a joint
            has none; None if no joint has one.
        dq: measured velocities [rad/s or m/s], shape (Q, J), NaN where a joint has none; None if no joint has one.
        command: commanded positions, velocities or torques by ``drive.command``, at the joints, shape (Q, J), NaN
            where a joint has none; None if no joint has one (a commanded duty is ``drive.duty``).
        joints: the joints' names in the model, J of them.
        drive: what lies between motors and joints.
        position_step: resolution of the reading of each position [rad or m], 0 where none shows, shape (J,).
        usable: samples that are what they seem, shape (Q,): False where a gap in the log was filled.
        native_hz: rate of the log as it was read [Hz].
        resampled: whether stamps or rate called for interpolation and a low-pass: then nothing is left above half
            of ``rate_hz``, and a fifth of it is where the low-pass begins.
        start_s: where ``time`` is 0, after the first stamp of the file [s].
        enabled: whether the drives are switched on, shape (Q,); None where the log does not say.
        motor: positions at the motors brought to the joints, shape (Q, J), NaN where a joint has none; None unless the
            log has positions on both sides of some drive.
        notes: what was found odd, and done about it; sentences.
    """

    name: str
    time: Array
    rate_hz: float
    q: Array
    torque: Array | None
    dq: Array | None
    command: Array | None
    joints: tuple[str, ...]
    drive: Drive
    position_step: Array
    usable: NDArray[np.bool_]
    native_hz: float
    resampled: bool = False
    start_s: float = 0.0
    enabled: NDArray[np.bool_] | None = None
    motor: Array | None = None
    notes: tuple[str, ...] = ()

    @property
    def period_s(self) -> float:
        """Sampling period [s]."""
        return 1.0 / self.rate_hz

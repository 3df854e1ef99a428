"""A log of one robot's joints on a uniform grid, in the units and order of the model's joints."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array

Command = Literal["none", "position", "velocity", "torque", "duty"]  # quantity of the logged commands
GainOf = Literal["torque", "velocity", "duty", "firmware"]


@dataclass(frozen=True, eq=False)
class Drive:
    """Transmission and control between motors and joints, from the map; unknown numbers are NaN.

    Attributes:
        gear: motor turns per joint turn, with sign, shape (J,); 1 for joint-side logs.
        coupling: joint positions from motor positions, q = coupling @ motor + constant, gears included, shape (J, J).
            Joint torques are inv(coupling).T @ motor torques, since the power is equal on both sides.
        torque_constant: torque constant of each motor [N m/A], shape (J,), NaN if free; 1 if the log has torques. A
            free constant leaves ``JointLog.torque`` in amperes times gear.
        link_side: whether a sensor behind the drive measures the torque, shape (J,); such torques do not include
            friction of motor and gear.
        command: commanded quantity.
        position_gain: gain of the position loop, in torque, velocity or duty (see ``gain_of``) per rad or m of error,
            shape (J,).
        velocity_gain: gain of the velocity loop or the damping, per rad/s or m/s, shape (J,).
        gain_of: quantity that the gains produce from an error: torque [N m], velocity [rad/s] or duty (1 is full
            scale). Gains of a firmware have its own unit, proportional to one of these by an unknown factor.
        limit: largest output of the loop, in the quantity of ``gain_of`` (a duty for firmware gains), shape (J,).
        supply_V: mean supply voltage of the motors [V], shape (Q,), or None.
        duty: share of the supply voltage applied to each motor, -1 to 1, shape (Q, J), or None.
        gain_within: factor within which position and velocity gain are known, shape (J, 2): 1 if exactly, infinity if
            free, that is unknown, although the loop has them. Ones if not given.
        delay_s: time from the stamp of a command until the drive follows it [s], shape (J,), NaN where unknown.
        held: whether a command holds until the next one; else the robot interpolates between commands. Samples of
            ``JointLog.command``, ``command_velocity`` and ``feedforward`` are then means over the period that follows
            them, which differ from a command only where one comes within the period.
        feedforward: commanded torque that is added to the loop's [N m or N], shape (Q, J), NaN where a joint has none;
            None if no joint has one.
        command_velocity: commanded velocity beside a commanded position [rad/s or m/s], shape (Q, J), NaN where a joint
            has none; None if no joint has one. The velocity gain acts on its difference from the velocity.
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
    gain_within: Array = None  # type: ignore[assignment]
    delay_s: Array = None  # type: ignore[assignment]
    held: bool = True
    feedforward: Array | None = None
    command_velocity: Array | None = None

    def __post_init__(self) -> None:
        if self.gain_within is None:
            object.__setattr__(self, "gain_within", np.ones((len(self.gear), 2)))
        if self.delay_s is None:
            object.__setattr__(self, "delay_s", np.full(len(self.gear), np.nan))

    @property
    def gain_free(self) -> NDArray[np.bool_]:
        """Whether the position and the velocity gain are unknown, shape (J, 2)."""
        return np.isinf(self.gain_within)


@dataclass(frozen=True, eq=False)
class JointLog:
    """One log, sampled uniformly.

    Attributes:
        name: name in messages.
        time: from 0, uniform at ``rate_hz`` [s], shape (Q,).
        rate_hz: sampling rate [Hz].
        q: joint positions in the model's order [rad or m], shape (Q, J).
        torque: joint torques, after gear, coupling and torque constant [N m or N], shape (Q, J), NaN where a joint has
            none; None if no joint has one.
        dq: measured velocities [rad/s or m/s], shape (Q, J), NaN where a joint has none; None if no joint has one.
        command: commanded positions, velocities or torques (see ``drive.command``) at the joints, shape (Q, J), NaN
            where a joint has none; None if no joint has one (a commanded duty is ``drive.duty``).
        joints: names of the J joints in the model.
        drive: transmission and control between motors and joints.
        position_step: resolution of each position reading [rad or m], 0 if none is found, shape (J,).
        usable: False where a gap in the log was filled, shape (Q,).
        native_hz: sample rate of the log before resampling [Hz].
        resampled: whether the samples were interpolated or low-passed. The low-pass then begins at a fifth of
            ``rate_hz`` and leaves nothing above half of it.
        start_s: time of ``time`` 0 after the first stamp of the file [s].
        enabled: whether the drives are switched on, shape (Q,); None if the log does not say.
        motor: motor positions converted to the joints, shape (Q, J), NaN where a joint has none; None unless the log
            has positions on both sides of some drive.
        notes: sentences on irregularities and how they were handled.
        asked: whether ``torque`` is what the command asks for, not measured, shape (J,); None if no joint's is.
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
    asked: NDArray[np.bool_] | None = None

    @property
    def by_command(self) -> bool:
        """Whether commands alone tell what the drives do: no torque, current or duty was measured."""
        asked = np.zeros(len(self.joints), dtype=bool) if self.asked is None else self.asked
        measured = self.torque is not None and np.isfinite(self.torque[:, ~asked]).any()
        return self.command is not None and self.drive.duty is None and not measured

    @property
    def period_s(self) -> float:
        return 1.0 / self.rate_hz

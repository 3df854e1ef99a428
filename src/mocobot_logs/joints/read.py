"""Positions that are told within one turn, unwrapped.

From a log's channels to what the joints do: gears and coupled drives, zeros, torque constants, the loop.

Read logs of one robot's joints, of any format, by a map.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.filtering import low_pass
from estimator.quantisation import rounding_step
from mocobot_logs.joints.even import Even, even_parts
from mocobot_logs.joints.joint_log import Drive, JointLog
from mocobot_logs.joints.joint_map import (
    COMMANDS,
    DUTIES,
    EFFORTS,
    POSITIONS,
    QUANTITIES,
    VELOCITIES,
    Control,
    JointMap,
    label,
)
from mocobot_logs.log import LogSource, Samples, collect
from mocobot_logs.open_log import open_log

TURN = 2.0 * np.pi
LEAST_JUMP = 0.75
"""Of a turn, between two samples, that no joint moves: at 20 Hz it would be 94 rad/s."""
ONE_TURN = 1.01
"""Turns that the readings of an encoder which starts again cover at most."""


def unwrapped(values: Array, names: Sequence[str]) -> tuple[Array, list[str]]:
    """Positions with their jumps by a full turn taken out, and sentences that say so.

    Args:
        values: columns of positions [rad], NaN where a row lacks one, shape (q, C).
        names: of the columns.
    """
    out, notes = values, []
    for c, name in enumerate(names):
        known = np.flatnonzero(np.isfinite(values[:, c]))
        x = values[known, c]
        if not len(x) or np.ptp(x) > ONE_TURN * TURN:
            continue
        jumps = int(np.sum(np.abs(np.diff(x)) > LEAST_JUMP * TURN))
        if jumps:
            out = out.copy() if out is values else out
            out[known, c] = np.unwrap(x)
            times = "once" if jumps == 1 else f"{jumps} times"
            notes.append(
                f"{name} is told within one turn; {times} it jumps by a full turn, which is taken out."
            )
    return out, notes


SUPPLY_HZ = 1.0
"""Cut-off of a supply's reading. Chosen: batteries and their cables sag in seconds; faster is how a bus rings that is
switched, met by chance (an XL330's reads 5.7 to 9.2 V, with a mean at any duty of 7.0 to 7.4 V)."""


def mean_supply(reading: Array, rate_hz: float) -> Array:
    """A supply's reading, low-passed [V], shape (Q,).

    A bus that a drive switches rings, and a reading meets it at any instant of the drive's period: an XL330 at a steady
    duty of 0.7 reads 6.2, 7.3 and 8.2 V in turn, with about the mean of its idle supply. The winding has the mean.

    Args:
        reading: even samples [V], shape (Q,), at least 16.
        rate_hz: of the samples [Hz].
    """
    # A filter goes through the first and the last reading of what it is given: means there are none by chance.
    end = round(rate_hz / SUPPLY_HZ)
    wide = np.concatenate([np.full(end, reading[:end].mean()), reading, np.full(end, reading[-end:].mean())])
    return low_pass(wide, rate_hz, SUPPLY_HZ)[end : end + len(reading)]


_STEP_ROWS = 1024
"""Rows of a block in which the step of a reading is looked for."""
_STEP_BLOCKS = 8


@dataclass(frozen=True, eq=False)
class _Columns:
    """Channels of one part of a log, by quantity and joint.

    Attributes:
        log_map: the map.
        values: shape (Q, C) in the order of the map's channels.
    """

    log_map: JointMap
    values: Array

    def of(self, quantity: str) -> Array:
        """A quantity of all joints, NaN where a joint has none, shape (Q, J)."""
        keys, joints = list(self.log_map.channels), self.log_map.joints
        found = np.full((len(self.values), len(joints)), np.nan)
        for k, (name, joint) in enumerate(keys):
            if name == quantity:
                found[:, joints.index(joint)] = self.values[:, k]
        return found

    def shared(self, quantity: str) -> Array | None:
        """A quantity that the robot has one of, shape (Q,)."""
        keys = list(self.log_map.channels)
        return self.values[:, keys.index((quantity, ""))] if (quantity, "") in keys else None

    def has(self, *quantities: str) -> bool:
        """Whether any joint has one of some quantities."""
        return any(name in quantities for name, _ in self.log_map.channels)


def assemble(part: Even, log_map: JointMap, name: str, control: Control) -> JointLog:
    """One part of a log in the units and the order of the model's joints.

    Args:
        part: on its grid.
        log_map: the map.
        name: of the part, for messages.
        control: how the robot was commanded in it.

    Raises:
        InputError: coupled drives of which only some are logged, or a supply that is not positive.
    """
    columns = _Columns(log_map, part.values)
    turns, zero = log_map.turns, log_map.zero
    where = f"map {log_map.name}"
    joint_side = columns.of("q")
    motor_side = columns.of("motor_position")
    # A joint that is read on both sides of its gear follows the link; the motor's reading is kept beside it.
    both = _given(joint_side) & _given(motor_side)
    q = _joints_from_motors(joint_side, np.where(both, np.nan, motor_side), turns, where, "motor_position")
    motor = None
    if both.any():
        seen = np.where(_given(motor_side), motor_side, (q @ turns.T))
        motor = np.where(both, seen @ np.linalg.inv(turns).T + zero, np.nan)
    dq = None
    if columns.has(*VELOCITIES):
        dq = _joints_from_motors(
            columns.of("dq"), columns.of("motor_velocity"), turns, where, "motor_velocity"
        )
    supply_V = _supply(columns, control, name, part.rate_hz)
    drive = Drive(
        gear=np.diag(turns).copy(),
        coupling=np.asarray(np.linalg.inv(turns), dtype=np.float64),
        torque_constant=_constants(columns, log_map, where),
        link_side=_given(columns.of("link_torque")),
        command=control.command,
        position_gain=control.position_gain,
        velocity_gain=control.velocity_gain,
        gain_of=control.gain_of,
        limit=control.limit,
        supply_V=supply_V,
        duty=_duty(columns, supply_V),
    )
    flags = columns.shared("enabled")
    return JointLog(
        name=name,
        time=np.arange(len(part.values)) / part.rate_hz,
        rate_hz=part.rate_hz,
        q=q + zero,
        torque=_torque(columns, drive, turns, where),
        dq=dq,
        command=_command(columns, control, turns, zero, where),
        joints=log_map.joints,
        drive=drive,
        position_step=_position_step(part, log_map, turns),
        usable=part.usable,
        native_hz=part.native_hz,
        resampled=part.resampled,
        start_s=part.start_s,
        enabled=None if flags is None else flags > 0.5,
        motor=motor,
        notes=part.notes,
    )


def _given(values: Array) -> NDArray[np.bool_]:
    """Which joints have a column, shape (J,)."""
    return np.asarray(~np.isnan(values).all(axis=0))


def _joints_from_motors(joint: Array, motor: Array, turns: Array, where: str, channel: str) -> Array:
    """Positions or velocities of all joints from those of some joints and the motors of the others, shape (Q, J)."""
    at_joint, at_motor = _given(joint), _given(motor)
    out = joint.copy()
    solved = at_motor & ~at_joint
    if not solved.any():
        return out
    lacking = ~at_joint & ~at_motor
    needed = (turns[np.ix_(solved, lacking)] != 0).any(axis=0)
    if needed.any():
        raise InputError(
            f"{where}: drive: coupling: a drive is coupled with a joint that has no {channel}; log it or leave the "
            "coupling out"
        )
    rest = motor[:, solved] - joint[:, at_joint] @ turns[np.ix_(solved, at_joint)].T
    out[:, solved] = np.linalg.solve(turns[np.ix_(solved, solved)], rest.T).T
    return out


def _at_joints(motor: Array, turns: Array, where: str, channel: str) -> Array:
    """Torques of the joints from those of the motors, NaN where a joint has none, shape (Q, J)."""
    given = _given(motor)
    out = np.full(motor.shape, np.nan)
    for j in np.flatnonzero(given):
        motors = np.flatnonzero(turns[:, j])
        if not given[motors].all():
            raise InputError(
                f"{where}: drive: coupling: the drive of joint {j + 1} is coupled with one that has no {channel}; log "
                "it or leave the coupling out"
            )
        out[:, j] = motor[:, motors] @ turns[motors, j]
    return out


def _constants(columns: _Columns, log_map: JointMap, where: str) -> Array:
    """Torque constants of the joints that have currents; 1 of the others."""
    constants = np.where(_given(columns.of("current")), log_map.torque_constant, 1.0)
    coupled = (log_map.turns - np.diag(np.diag(log_map.turns)) != 0).any(axis=1)
    coupled |= (log_map.turns - np.diag(np.diag(log_map.turns)) != 0).any(axis=0)
    if (np.isnan(constants) & coupled).any():
        raise InputError(
            f"{where}: drive: torque_constant is 'free' for coupled drives; it must be known there, for their torques "
            "add up in one joint"
        )
    return constants


def _torque(columns: _Columns, drive: Drive, turns: Array, where: str) -> Array | None:
    if not columns.has(*EFFORTS):
        return None
    constants = np.where(np.isnan(drive.torque_constant), 1.0, drive.torque_constant)
    current = columns.of("current") * constants
    motor = columns.of("motor_torque")
    motor = np.where(_given(motor), motor, current)
    torque = columns.of("torque")
    for other in (columns.of("link_torque"), _at_joints(motor, turns, where, "motor_torque or current")):
        torque = np.where(_given(torque), torque, other)
    return torque


def _command(columns: _Columns, control: Control, turns: Array, zero: Array, where: str) -> Array | None:
    if not columns.has(*COMMANDS):
        return None
    joint, motor = columns.of("command"), columns.of("motor_command")
    if control.command == "torque":
        return np.where(_given(joint), joint, _at_joints(motor, turns, where, "motor_command"))
    at_joints = _joints_from_motors(joint, motor, turns, where, "motor_command")
    return at_joints + zero if control.command == "position" else at_joints


def _supply(columns: _Columns, control: Control, name: str, rate_hz: float) -> Array | None:
    supply_V = columns.shared("supply")
    if supply_V is None:
        return None if control.supply_V is None else np.full(len(columns.values), control.supply_V)
    if (supply_V <= 0).any():
        row = int(np.argmax(supply_V <= 0))
        raise InputError(f"{name}: supply is {supply_V[row]:.4g} V in sample {row}; it must be positive")
    return mean_supply(supply_V, rate_hz)


def _duty(columns: _Columns, supply_V: Array | None) -> Array | None:
    if not columns.has(*DUTIES):
        return None
    duty, voltage = columns.of("duty"), columns.of("motor_voltage")
    if supply_V is not None:
        duty = np.where(_given(duty), duty, voltage / supply_V[:, None])
    return duty


def _position_step(part: Even, log_map: JointMap, turns: Array) -> Array:
    """Resolution of the positions [rad or m], shape (J,): noise of rounding adds up through coupled drives."""
    joints = log_map.joints
    at_joint, at_motor = np.zeros(len(joints)), np.zeros(len(joints))
    for k, ((name, joint), channel) in enumerate(log_map.channels.items()):
        if name in POSITIONS:
            step = abs(channel.scale) if channel.counted else step_of(part.raw[:, k])
            (at_joint if name == "q" else at_motor)[joints.index(joint)] = step
    from_motors = np.sqrt(np.linalg.inv(turns) ** 2 @ at_motor**2)
    own = np.array([("q", joint) in log_map.channels for joint in joints])
    return np.where(own, at_joint, from_motors)


def step_of(values: Array) -> float:
    """Step by which a reading repeats, 0 where none shows."""
    starts = np.linspace(0, max(len(values) - _STEP_ROWS, 0), _STEP_BLOCKS).astype(int)
    found = [rounding_step(values[first : first + _STEP_ROWS]) for first in dict.fromkeys(starts.tolist())]
    told = [step for step in found if step > 0]
    return float(np.median(told)) if told else 0.0


def open_joint_log(path: Path | str, log_map: JointMap, episode: int | None = None) -> LogSource:
    """A log that can be read by a map.

    Args:
        path: a file or a folder of any format that ``open_log`` knows.
        log_map: where its channels are.
        episode: of a LeRobot dataset that holds several.

    Raises:
        InputError: there is no such log, or the map does not suit it.
    """
    return open_log(path, log_map.of_source(), episode)


def read_joint_log(
    source: LogSource, log_map: JointMap, advance: Callable[[int], object] = lambda _: None
) -> list[JointLog]:
    """The parts of a log between long gaps, mostly one.

    Args:
        source: the log.
        log_map: its map.
        advance: takes the progress made, in the source's units.

    Raises:
        InputError: the log is damaged, its stamps or values cannot be used, or it is too short.
    """
    return joint_logs_of(source.name, collect(source, advance).streams[0], log_map)


def joint_logs_of(name: str, samples: Samples, log_map: JointMap) -> list[JointLog]:
    """The parts of a log that is in memory.

    Args:
        name: of the log, whose last part may decide about gains.
        samples: its rows, channels in the map's order.
        log_map: its map.

    Raises:
        InputError: see ``read_joint_log``.
    """
    channels = tuple(label(*key) for key in log_map.channels)
    at = [k for k, (quantity, _) in enumerate(log_map.channels) if QUANTITIES[quantity].kind == "position"]
    positions, notes = unwrapped(samples.values[:, at], [channels[k] for k in at])
    if notes:
        values = samples.values.copy()
        values[:, at] = positions
        samples = replace(samples, values=values)
    parts = even_parts(name, channels, samples, log_map.rate_hz)
    parts = [replace(part, notes=(*notes, *part.notes)) for part in parts]
    control = log_map.control_of(Path(name).name)
    logs = [assemble(part, log_map, name, control) for part in parts]
    if len(logs) == 1:
        return logs
    return [replace(log, name=f"{log.name} (part {number})") for number, log in enumerate(logs, 1)]

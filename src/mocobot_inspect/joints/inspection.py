"""A look at a joint log before anyone trusts a number of it: stamps, channels, units, signs, order, delays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_inspect.joints.lags import (
    Follows,
    command_follows,
    exchanged_commands,
    torque_delay,
    velocity_follows,
)
from mocobot_inspect.joints.motion import Motion, motion_of
from mocobot_inspect.joints.robot import Robot
from mocobot_inspect.joints.samples import wrapped
from mocobot_inspect.joints.wiring import Wiring, check_wiring
from mocobot_inspect.stream.channels import Channel, ChannelTally, Stretch, seconds
from mocobot_inspect.stream.noise import wild
from mocobot_inspect.stream.timing import Timing, TimingTally
from mocobot_logs.joints.joint_log import JointLog
from mocobot_logs.joints.joint_map import COMMANDS, EFFORTS, POSITIONS, VELOCITIES, JointMap, label
from mocobot_logs.joints.read import joint_logs_of
from mocobot_logs.log import LogSource, Samples, collect

LEAST_ROWS = 50
"""Fewer samples of smooth motion tell nothing."""
_NOISES, _MOVES = 4.0, 0.05  # a velocity is one beyond so much of its noise, and of its rms


@dataclass(frozen=True)
class TorqueDelay:
    """How torques lag behind the motion.

    Attributes:
        delay_s, delay_se_s: of all torques, and its standard error [s].
        before, after: share of their variance that model and friction leave, without and with it.
    """

    delay_s: float
    delay_se_s: float
    before: float
    after: float


@dataclass(frozen=True, eq=False)
class JointInspection:
    """What was found in a joint log.

    Attributes:
        name: of the log.
        robot: its model.
        log_map: how it was read.
        timing: its stamps.
        channels: every column of the map, in the map's order.
        signs_lost: columns that must have been signed numbers, sentences.
        logs: its parts on even grids, none if it cannot be read so.
        unchecked: why motion and torques could not be looked at, or None.
        moves: whether each joint moves, shape (J,).
        wiring: signs, order and units against the model, or None without torques.
        velocities, commands: how they follow the motion, part by part.
        crossed: pairs of joints whose commands are exchanged, from 0.
        delay: of the torques, or None.
    """

    name: str
    robot: Robot
    log_map: JointMap
    timing: Timing
    channels: tuple[Channel, ...]
    signs_lost: tuple[str, ...]
    logs: tuple[JointLog, ...]
    unchecked: str | None
    moves: NDArray[np.bool_]
    wiring: Wiring | None = None
    velocities: tuple[Follows, ...] = ()
    commands: tuple[Follows, ...] = ()
    crossed: tuple[tuple[int, int], ...] = ()
    delay: TorqueDelay | None = None


def inspect_joints(
    source: LogSource,
    log_map: JointMap,
    robot: Robot,
    advance: Callable[[int], object] = lambda _: None,
    try_advance: Callable[[int], object] = lambda _: None,
) -> JointInspection:
    """Look at a log; whatever is wrong with its samples is reported and not refused.

    Args:
        source: the log.
        log_map: its map.
        robot: its model.
        advance: takes the progress made in reading, in the source's units.
        try_advance: takes the number of mistakes tried.

    Raises:
        InputError: the log cannot be read.
    """
    samples = collect(source, advance).streams[0]
    timing = TimingTally()
    timing.add(samples)
    keys = list(log_map.channels)
    found = JointInspection(
        name=source.name,
        robot=robot,
        log_map=log_map,
        timing=timing.finish(),
        channels=_channels(samples, log_map),
        signs_lost=tuple(wrapped(keys, samples.values, log_map)),
        logs=(),
        unchecked=None,
        moves=np.zeros(len(robot.joints), dtype=bool),
    )
    # Refused, or taken for readings otherwise: they count as missing.
    odd = np.apply_along_axis(wild, 0, samples.values)
    samples = replace(samples, values=np.where(odd, np.nan, samples.values))
    try:
        logs = joint_logs_of(source.name, samples, log_map)
    except InputError as error:
        return replace(found, unchecked=str(error).removeprefix(f"{source.name}: "))
    motions = [motion_of(log) for log in logs]
    whole = [(log, motion) for log, motion in zip(logs, motions, strict=True) if len(motion.q) >= LEAST_ROWS]
    found = replace(found, logs=tuple(logs))
    if not whole:
        return replace(found, unchecked="no part of it is long enough for its motion to be looked at")
    return _with_motion(found, whole, try_advance)


def _channels(samples: Samples, log_map: JointMap) -> tuple[Channel, ...]:
    """Sensors first: commands stand when they please, and so does a supply."""
    keys = list(log_map.channels)
    sensing = [k for k, (name, _) in enumerate(keys) if name in (*POSITIONS, *VELOCITIES, *EFFORTS)]
    order = [*sensing, *(k for k in range(len(keys)) if k not in sensing)]
    tally = ChannelTally(tuple(label(*keys[k]) for k in order), len(sensing))
    if len(samples.stamp_ns):
        time_s = seconds(samples.stamp_ns, int(samples.stamp_ns[0]))
        forward = np.diff(time_s)
        forward = forward[forward > 0]
        rate_hz = 1.0 / float(np.median(forward)) if len(forward) else None
        with np.errstate(all="ignore"):  # absurd values overflow; they are reported by their range
            tally.add(time_s, samples.values[:, order], rate_hz)
    told = dict(zip(order, tally.finish(), strict=True))
    return tuple(_without_rests(k, told, log_map, samples) for k in range(len(keys)))


def _rms(x: Array) -> float:
    """Of what is known."""
    return float(np.sqrt(np.nansum(x**2) / max(len(x), 1)))


def _without_rests(k: int, told: dict[int, Channel], log_map: JointMap, samples: Samples) -> Channel:
    """A channel, without stretches in which a position stands because its joint's velocity or command does, too."""
    c, (quantity, joint) = told[k], list(log_map.channels)[k]
    if quantity not in POSITIONS or not (c.stuck or c.clipped):
        return c
    time_s = seconds(samples.stamp_ns, int(samples.stamp_ns[0]))
    moving = (*VELOCITIES, *(COMMANDS if log_map.control.command == "position" else ()))
    of_joint = [i for i, (other, of) in enumerate(log_map.channels) if of == joint and other in moving]
    speeds = []
    for i in of_joint:
        x = np.where(wild(samples.values[:, i]), np.nan, samples.values[:, i])
        speed = np.diff(x, prepend=x[:1]) if list(log_map.channels)[i][0] in COMMANDS else x
        speeds.append((speed, max(_NOISES * told[i].noise, _MOVES * _rms(speed))))

    def stays(s: Stretch) -> bool:
        inside = (time_s > s.start_s) & (time_s < s.start_s + s.duration_s)
        moves = [_rms(speed[inside]) > least for speed, least in speeds]
        return any(moves) or s.jumps or (not moves and c.lowest != c.highest)

    stuck, clipped = tuple(filter(stays, c.stuck)), tuple(filter(stays, c.clipped))
    return replace(
        c,
        stuck=stuck,
        clipped=clipped,
        stuck_count=c.stuck_count - len(c.stuck) + len(stuck),
        clipped_count=c.clipped_count - len(c.clipped) + len(clipped),
    )


def _with_motion(
    found: JointInspection,
    whole: Sequence[tuple[JointLog, Motion]],
    advance: Callable[[int], object],
) -> JointInspection:
    robot = found.robot
    log, motion = max(whole, key=lambda part: len(part[1].q))
    moves = np.any([part.moves for _, part in whole], axis=0)
    wiring = check_wiring([part for _, part in whole], robot, advance)
    delay = None
    if wiring is not None and not wiring.found:
        late = torque_delay(log, motion, robot.asked(motion.q, motion.dq, motion.ddq, wiring.payload))
        delay = None if late is None else TorqueDelay(*late)
    return replace(
        found,
        moves=moves,
        wiring=wiring,
        velocities=tuple(velocity_follows(log, motion)),
        commands=tuple(command_follows(log, motion)),
        crossed=tuple(exchanged_commands(log, motion)),
        delay=delay,
    )

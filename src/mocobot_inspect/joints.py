"""Inspect a joint log: stamps, channels, units, signs, order and delays."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_inspect.channels import Channel, ChannelTally, Stretch, seconds, wild
from mocobot_inspect.joint_motion import (
    Follows,
    Motion,
    command_follows,
    exchanged_commands,
    motion_of,
    velocity_follows,
)
from mocobot_inspect.joint_wiring import Robot, TorqueDelay, Wiring, check_wiring, torque_delay
from mocobot_inspect.survey import Timing, TimingTally
from mocobot_logs.joints.joint_log import JointLog
from mocobot_logs.joints.joint_map import COMMANDS, EFFORTS, POSITIONS, VELOCITIES, JointMap, label
from mocobot_logs.joints.read import joint_logs_of
from mocobot_logs.log import LogSource, Samples, collect

LEAST_ROWS = 50  # least number of samples of smooth motion that are analysed
WORDS = (8, 10, 12, 16, 24, 32)  # word lengths [bits] of numbers that may have lost their sign
EMPTY = 0.02
"""Largest share of such a number's samples in the middle half of its range; wrapped numbers lie near its ends."""
_NOISES, _MOVES = 4.0, 0.05  # a velocity is motion above this multiple of its noise and this share of its rms


@dataclass(frozen=True, eq=False)
class JointInspection:
    """Results of the inspection of a joint log.

    Attributes:
        name: name of the log.
        robot: model of the robot.
        log_map: map of the log.
        timing: statistics of its stamps.
        channels: every column of the map, in the map's order.
        signs_lost: one sentence for each column that must have been a signed number.
        logs: its parts on uniform grids, empty if it cannot be resampled.
        unchecked: why motion and torques were not checked, or None.
        moves: whether each joint moves, shape (J,).
        wiring: signs, order and units against the model, or None without torques.
        velocities, commands: gain and delay of velocities and commands against the motion, of the longest part.
        crossed: pairs of joints whose commands are exchanged, from 0.
        delay: delay of the torques, or None.
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
    """Inspect a log; faulty samples are reported, not refused.

    ``advance`` is called with the reading progress in the source's units, ``try_advance`` with the mistakes tried.
    """
    log = collect(source, advance)
    samples = log.streams[0]
    timing = TimingTally()
    timing.add(samples)
    found = JointInspection(
        name=source.name,
        robot=robot,
        log_map=log_map,
        timing=timing.finish(),
        channels=_channels(samples, log_map),
        signs_lost=tuple(_signs_lost(samples.values, log_map)),
        logs=(),
        unchecked=None,
        moves=np.zeros(len(robot.joints), dtype=bool),
    )
    # Wild samples count as missing; otherwise they would be refused or used as readings.
    samples = replace(samples, values=np.where(wild(samples.values), np.nan, samples.values))
    try:
        logs = joint_logs_of(source.name, samples, log_map, log.notes)
    except InputError as error:
        return replace(found, unchecked=str(error).removeprefix(f"{source.name}: "))
    found = replace(found, logs=tuple(logs))
    whole = [motion for motion in map(motion_of, logs) if len(motion.q) >= LEAST_ROWS]
    if not whole:
        return replace(found, unchecked="no part of it is long enough for its motion to be looked at")
    return _with_motion(found, whole, try_advance)


def _with_motion(
    found: JointInspection, parts: Sequence[Motion], advance: Callable[[int], object]
) -> JointInspection:
    """Add signs, order and delays."""
    robot, longest = found.robot, max(parts, key=lambda part: len(part.q))
    wiring = check_wiring(parts, robot, advance)
    delay = None
    if wiring is not None and not wiring.found:
        asked = robot.asked(longest.q, longest.dq, longest.ddq, wiring.payload)
        delay = torque_delay(longest, asked)
    return replace(
        found,
        moves=np.any([part.moves for part in parts], axis=0),
        wiring=wiring,
        velocities=tuple(velocity_follows(longest)),
        commands=tuple(command_follows(longest)),
        crossed=tuple(exchanged_commands(longest)),
        delay=delay,
    )


def _channels(samples: Samples, log_map: JointMap) -> tuple[Channel, ...]:
    """Return statistics of all channels; only sensors are checked for stuck stretches."""
    keys = list(log_map.channels)
    sensing = [k for k, (name, _) in enumerate(keys) if name in (*POSITIONS, *VELOCITIES, *EFFORTS)]
    order = [*sensing, *(k for k in range(len(keys)) if k not in sensing)]
    tally = ChannelTally([label(*keys[k]) for k in order], len(sensing))
    time_s = seconds(samples.stamp_ns, int(samples.stamp_ns[0]) if len(samples.stamp_ns) else 0)
    if len(time_s):
        tally.add(time_s, samples.values[:, order])
    told = dict(zip(order, tally.finish(), strict=True))
    return tuple(_without_rests(k, told, log_map, time_s, samples.values) for k in range(len(keys)))


def _without_rests(
    k: int, told: dict[int, Channel], log_map: JointMap, time_s: Array, values: Array
) -> Channel:
    """Remove stuck stretches of a position during which its joint's velocity or position command shows no motion."""
    c, (quantity, joint) = told[k], list(log_map.channels)[k]
    if quantity not in POSITIONS or not (c.stuck or c.clipped):
        return c
    moving = (*VELOCITIES, *(COMMANDS if log_map.control.command == "position" else ()))
    speeds = []
    for i, (other, of) in enumerate(log_map.channels):
        if of == joint and other in moving:
            x = np.where(wild(values[:, i]), np.nan, values[:, i])
            speed = np.diff(x, prepend=x[:1]) if other in COMMANDS else x
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


def _rms(x: Array) -> float:
    """Return the root mean square; NaN counts as zero."""
    return float(np.sqrt(np.nansum(x**2) / max(len(x), 1)))


def _signs_lost(values: Array, log_map: JointMap) -> Iterator[str]:
    """Yield a sentence for each unsigned number that jumps between the ends of its range, so must have been signed."""
    for x, ((quantity, joint), channel) in zip(values.T, log_map.channels.items(), strict=True):
        if channel.bits is not None:
            continue
        raw = channel.undo(x[np.isfinite(x)])
        if len(raw) < 2 or raw.min() < -0.5 or np.abs(raw - np.rint(raw)).max() > 1e-6 * max(raw.max(), 1.0):
            continue
        for bits in WORDS:
            full = 2.0**bits
            middle = np.mean((raw > 0.25 * full) & (raw < 0.75 * full))
            leaps = np.sum(np.abs(np.diff(raw)) > 0.5 * full)
            if 0.75 * full < raw.max() < full and middle < EMPTY and leaps:
                yield (
                    f"{label(quantity, joint)} leaps {leaps} times between {raw.min():g} and {raw.max():g}: is it a "
                    f"signed number of {bits} bits without its sign (bits = {bits} in the map)?"
                )
                break

"""What a map of a joint log says, with every joint in the model's order."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from typing import get_args

import numpy as np

from estimator.arrays import Array
from mocobot_logs.joints.joint_log import Command, GainOf
from mocobot_logs.map.log_map import ChannelMap, CsvMap, LogMap, TimeMap

COMMANDS, GAINS = get_args(Command), get_args(GainOf)


@dataclass(frozen=True)
class JointChannel(ChannelMap):
    """Where one channel of one joint is, and how to bring it to SI.

    Attributes:
        bits: of a number that is signed but was logged without its sign (two's complement), or None.
        counted: whether the raw numbers are counts, whose step is 1.
    """

    bits: int | None = None
    counted: bool = False

    def apply(self, raw: Array) -> Array:
        """Raw samples in SI."""
        if self.bits is not None:
            half = 2.0 ** (self.bits - 1)
            raw = np.mod(raw + half, 2.0 * half) - half
        return super().apply(raw)


@dataclass(frozen=True, eq=False)
class Control:
    """How the robot is commanded, as far as it is known; unknown numbers are NaN.

    Attributes:
        command: what the log's commands are.
        position_gain, velocity_gain: see ``joint_log.Drive``, shape (J,).
        gain_of: what gains make of an error.
        limit: most that the loop gives, in ``gain_of``, shape (J,).
        supply_V: nominal supply voltage, or None.
    """

    command: Command
    position_gain: Array
    velocity_gain: Array
    gain_of: GainOf
    limit: Array
    supply_V: float | None


@dataclass(frozen=True, eq=False)
class Override:
    """What differs in some logs.

    Attributes:
        match: pattern of file names, as a shell has it.
        control: entries of ``Control`` that differ.
    """

    match: str
    control: Mapping[str, object]


@dataclass(frozen=True, eq=False)
class JointMap:
    """A map: strict, complete, joints in the model's order.

    Attributes:
        name: what messages call it.
        joints: names of the J joints in the model.
        time: where time is.
        rate_hz: rate of the grid [Hz], or None for the log's own.
        csv: how a text table is written.
        channels: by quantity and joint; the joint is "" for what the robot has one of.
        turns: motor positions from joint positions, gears and coupled drives, shape (J, J).
        zero: added to positions behind the gear [rad or m], shape (J,).
        torque_constant: [N m/A], NaN where it is free, shape (J,).
        control: how the robot is commanded.
        overrides: what differs in some logs; later ones override.
    """

    name: str
    joints: tuple[str, ...]
    time: TimeMap
    rate_hz: float | None
    csv: CsvMap
    channels: Mapping[tuple[str, str], JointChannel]
    turns: Array
    zero: Array
    torque_constant: Array
    control: Control
    overrides: tuple[Override, ...] = ()

    def control_of(self, file_name: str) -> Control:
        """How the robot is commanded in a log of some name."""
        control = self.control
        for override in self.overrides:
            if fnmatchcase(file_name, override.match):
                control = replace(control, **override.control)  # type: ignore[arg-type]
        return control

    def of_source(self) -> LogMap:
        """The map as readers of logs take it: one robot, one channel after the other."""
        mapped = {label(*key): channel for key, channel in self.channels.items()}
        return _SourceMap(self.name, "joint", 1, None, self.time, self.csv, mapped)


def label(quantity: str, joint: str) -> str:
    """What messages call a channel."""
    return f"{quantity} of {joint}" if joint else quantity


@dataclass(frozen=True)
class _SourceMap(LogMap):
    """A map of any channels of one robot."""

    own: Mapping[int, Mapping[str, ChannelMap]] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        return self.required

    @property
    def required(self) -> tuple[str, ...]:
        return tuple(self.common)

    def meaning(self, name: str, robot: int) -> str:
        del robot
        return name

    def channels(self, robot: int) -> dict[str, ChannelMap]:
        del robot
        return dict(self.common)

    def time_column(self, robot: int) -> str | None:
        del robot
        return self.time.column

    def has_commands(self, robots: int, is_there: Callable[[ChannelMap], bool]) -> bool:
        del robots, is_there
        return False

"""What a map says: where a log has each channel of each robot, and in which unit, sign and zero."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_logs.log import CHANNELS, REF, Level
from mocobot_logs.map.units import TIME_UNITS

GAP_OF_ROBOTS = 20
"""So far beyond the last robot found another one is looked for, which would mean that one is missing."""
PLACEHOLDERS = ("robot", "robot0", "name", "channel")
"""Number of the robot from 1, number of the robot from 0, what it is called, name of the channel."""


@dataclass(frozen=True)
class ChannelMap:
    """Where one channel of one robot is, and how to bring it to SI: ``scale * (raw + offset)``.

    Attributes:
        topic: topic of a bag, or None.
        joint: name of the joint in a sensor_msgs/msg/JointState, or None.
        field: ``position``, ``velocity`` or ``effort`` of that joint, or the dotted path in another message.
        column: column of a table, ``name[i, j]`` inside an array, or None.
        scale: sign times the size of one raw unit in SI.
        offset: added before sign and unit [raw unit].
        optional: whether a log may lack it (commands only).
    """

    topic: str | None = None
    joint: str | None = None
    field: str | None = None
    column: str | None = None
    scale: float = 1.0
    offset: float = 0.0
    optional: bool = False

    def apply(self, raw: Array) -> Array:
        """Raw samples in SI; the same array where nothing is to be done."""
        shifted = raw + self.offset if self.offset else raw
        return shifted * self.scale if self.scale != 1.0 else shifted

    def undo(self, si: Array) -> Array:
        """SI samples as the log has them: the inverse of ``apply``."""
        return si / self.scale - self.offset


@dataclass(frozen=True)
class TimeMap:
    """Where a log's time is.

    Attributes:
        column: column of a table, which may hold ``{robot}`` or ``{name}``; None stands for ``time``, and for
            ``timestamp`` in a LeRobot dataset.
        unit: ``s``, ``ms``, ``us`` or ``ns``; ``iso`` for dates of ISO 8601.
        clock: stamp of a bag's messages: ``header`` (when the robot took the sample) or ``log`` (when it was written).
    """

    column: str | None = None
    unit: str = "s"
    clock: Literal["header", "log"] = "header"

    @property
    def unit_ns(self) -> int | None:
        """Nanoseconds in one unit, None for dates."""
        return TIME_UNITS.get(self.unit)


@dataclass(frozen=True)
class CsvMap:
    """How a text table is written.

    Attributes:
        delimiter: what stands between two cells, or None to find out.
        decimal: the decimal mark.
    """

    delimiter: str | None = None
    decimal: Literal[".", ","] = "."


@dataclass(frozen=True)
class LogMap:
    """A map: strict, complete, and the same for every robot up to overrides.

    Attributes:
        name: what messages call it.
        level: whether angles and torques or wrist positions and forces are logged.
        robots: number of robots, or None to count those that the log has.
        trial: kind of trial, or None.
        time: where time is.
        csv: how a text table is written.
        common: every mapped channel, with placeholders.
        own: by robot (from 1), the channels that differ.
        called: what the robots are called, in order, or nothing.
    """

    name: str
    level: Level
    robots: int | None
    trial: str | None
    time: TimeMap
    csv: CsvMap
    common: Mapping[str, ChannelMap]
    own: Mapping[int, Mapping[str, ChannelMap]] = field(default_factory=dict)
    called: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Mapped channels in the order of ``Samples.values``: those of the level, then the commands if mapped."""
        return tuple(name for name in (*CHANNELS[self.level], *REF) if name in self.common)

    @property
    def required(self) -> tuple[str, ...]:
        """Channels that every log has."""
        return CHANNELS[self.level]

    def meaning(self, name: str, robot: int) -> str:
        """What messages call a channel of one robot, counted from 1."""
        return f"{name} of robot {robot}"

    def channels(self, robot: int) -> dict[str, ChannelMap]:
        """Every mapped channel of one robot, counted from 1, placeholders filled, in the order of ``names``."""
        own, channels = self.own.get(robot, {}), {}
        for name in self.names:
            channel = own.get(name, self.common[name])
            texts = {key: getattr(channel, key) for key in ("topic", "joint", "field", "column")}
            filled = {key: text and self._fill(text, robot, name) for key, text in texts.items()}
            channels[name] = replace(channel, **filled)
        return channels

    def time_column(self, robot: int) -> str | None:
        """The time column of one robot, counted from 1."""
        return None if self.time.column is None else self._fill(self.time.column, robot)

    def _fill(self, text: str, robot: int, channel: str = "") -> str:
        """Put numbers and names in the place of placeholders."""
        values = {"robot": str(robot), "robot0": str(robot - 1), "channel": channel}
        if robot <= len(self.called):
            values["name"] = self.called[robot - 1]
        return re.sub(r"\{(\w+)\}", lambda found: values[found.group(1)], text)

    def require(self, key: Literal["topic", "field", "column"], kind: str) -> None:
        """Check that the map locates every channel in a kind of log.

        Args:
            key: what that kind needs.
            kind: the kind of log in the plural, for the message.

        Raises:
            InputError: a channel lacks the key.
        """
        for robot in (None, *self.own):
            channels = self.common if robot is None else self.own[robot]
            for name, channel in channels.items():
                if getattr(channel, key) is None:
                    table = f"channels.{name}" if robot is None else f"robot.{robot}.channels.{name}"
                    raise InputError(
                        f"map {self.name}: {table}: missing key {key!r}, by which {kind} are read "
                        "(it may also stand in [defaults])"
                    )

    def count_robots(
        self, where: str, is_there: Callable[[int], bool], key: Literal["topic", "column"]
    ) -> int:
        """Robots by the map, or those that a log has.

        Args:
            where: what messages call the log.
            is_there: whether it has anything of a robot, counted from 1.
            key: what locates channels in it.

        Raises:
            InputError: one robot is missing between others.
        """
        if self.robots is not None:
            return self.robots
        if self.one_robot_only(key):
            return 1
        count = 0
        while is_there(count + 1):
            count += 1
        for later in range(count + 2, count + 2 + GAP_OF_ROBOTS):
            if count and is_there(later):
                raise InputError(
                    f"{where}: there are {key}s of robots {count} and {later}, but none of robot {count + 1}; "
                    "robots are counted from 1 without a gap, or set by the key robots in a map"
                )
        return max(count, 1)  # without any robot, what the first one lacks is what is missing

    def has_commands(self, robots: int, is_there: Callable[[ChannelMap], bool]) -> bool:
        """Whether commands are read: mapped, and in the log of any robot unless they must be there."""
        if REF[0] not in self.common:
            return False
        every = [self.channels(robot)[name] for robot in range(1, robots + 1) for name in REF]
        return not all(self.common[name].optional for name in REF) or any(map(is_there, every))

    def one_robot_only(self, key: Literal["topic", "column"]) -> bool:
        """Whether every robot would be read from the same place, so that a log can hold just one."""
        return not self.own and not any(
            re.search(r"\{(robot0?|name)\}", (getattr(channel, key) or "") + (channel.joint or ""))
            for channel in self.common.values()
        )

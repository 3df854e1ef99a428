"""Maps of a team's logs: location, unit, sign and zero of each robot's channels (docs/measured-data.md).

The parsers of places, units, time and text tables also serve the maps of one robot's joints.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.inputs import parse_toml
from estimator.recording.metadata import TRIALS
from estimator.strict import Fields, check_known
from mocobot_logs.formats import detail_of, read_small
from mocobot_logs.log import CHANNELS, REF, Level
from mocobot_logs.units import COUNTS, DATES, TIME_UNITS, si_factor

VERSION = 1
MAX_ROBOTS = 1000
GAP_OF_ROBOTS = 20
"""Number of robots beyond the last one in which another is searched; finding one means that a robot is missing."""
MAPS = ("omnid-ros2", "mocobot-ros2", "mocobot", "mocobot-wrist", "mocobot-arrays", "mocobot-arrays-wrist")
"""Names of the built-in maps."""
PLACES = ("topic", "joint", "field", "column")
JOINT_FIELDS = ("position", "velocity", "effort")
_PLACEHOLDERS = ("robot", "robot0", "name", "channel")
_REQUIRED = ("version", "level", "channels")
_OPTIONAL = ("robots", "names", "trial", "time", "csv", "defaults", "robot")
_TIME = ("column", "nanosec", "unit", "clock")
_CSV = ("delimiter", "decimal")
_CHANNEL = (*PLACES, "unit", "sign", "offset", "counts_per_turn", "optional")
KEYS = (*_REQUIRED, *_OPTIONAL, *_TIME, *_CSV, *_CHANNEL)  # every key of a map except the channels' names
_LARGEST_BYTES = 1 << 20
_DIMENSIONS = {
    "phi": "angle", "theta": "angle", "tau": "torque", "h": "length", "force": "force", "ref": "length"
}  # fmt: skip
_UNITS = {
    "angle": ("rad", "deg", COUNTS),
    "length": ("m", "mm"),
    "torque": ("Nm", "mNm", "N m", "mN m"),
    "force": ("N", "mN"),
}

Values = Mapping[str, Any]


def dimension_of(channel: str) -> str:
    """Return what a channel such as ``phi1``, ``theta_z`` or ``force_x`` measures: angle, length, torque or force."""
    return _DIMENSIONS[channel.partition("_")[0].rstrip("123")]


def units_of(channel: str) -> tuple[str, ...]:
    """Return the units in which a channel may be logged."""
    return _UNITS[dimension_of(channel)]


@dataclass(frozen=True)
class ChannelMap:
    """Location of one channel of one robot, and its conversion to SI: ``scale * (raw + offset)``."""

    topic: str | None = None  # topic of a bag, or None
    joint: str | None = None  # name of the joint in a sensor_msgs/msg/JointState, or None
    # ``position``, ``velocity`` or ``effort`` of that joint, or the dotted path in another message
    field: str | None = None
    column: str | None = None  # column of a table, ``name[i, j]`` inside an array, or None
    scale: float = 1.0  # sign times the size of one raw unit in SI
    offset: float = 0.0  # added before sign and unit apply [raw unit]
    # whether a log may lack the channel: commands of a team; of joints all but positions
    optional: bool = False
    # width of a signed number that was logged as unsigned (two's complement), or None
    bits: int | None = None
    counted: bool = False  # whether raw values are counts, whose step is 1
    held: bool = False  # whether a value holds until the next one, as commands do; else it is interpolated

    def apply(self, raw: Array) -> Array:
        """Convert raw samples to SI; return the same array if nothing changes."""
        if self.bits is not None:
            half = 2.0 ** (self.bits - 1)
            raw = np.mod(raw + half, 2.0 * half) - half
        shifted = raw + self.offset if self.offset else raw
        return shifted * self.scale if self.scale != 1.0 else shifted

    def undo(self, si: Array) -> Array:
        """Convert SI samples to raw values: the inverse of ``apply``, except for ``bits``."""
        return si / self.scale - self.offset

    def filled(self, fill: Callable[[str], str]) -> "ChannelMap":
        """Return the channel with the placeholders in its texts replaced."""
        texts = {key: getattr(self, key) for key in PLACES}
        return replace(self, **{key: text and fill(text) for key, text in texts.items()})


@dataclass(frozen=True)
class TimeMap:
    """Location of a log's time.

    Attributes:
        column: column of a table, which may hold ``{robot}`` or ``{name}``; None stands for ``time``, and for
            ``timestamp`` in a LeRobot dataset.
        unit: ``s``, ``ms``, ``us`` or ``ns``; ``iso`` for ISO 8601 dates.
        clock: stamp of a bag's messages: ``header`` (when the robot took the sample) or ``log`` (when it was written).
        nanosec: column of the nanoseconds that are added to whole seconds in ``column``, or None.
    """

    column: str | None = None
    unit: str = "s"
    clock: Literal["header", "log"] = "header"
    nanosec: str | None = None

    @property
    def unit_ns(self) -> int | None:
        """Nanoseconds per unit, None for dates."""
        return TIME_UNITS.get(self.unit)


@dataclass(frozen=True)
class CsvMap:
    """Form of a text table: delimiter between cells (None to detect it) and decimal mark."""

    delimiter: str | None = None
    decimal: Literal[".", ","] = "."


@dataclass(frozen=True)
class LogMap:
    """A complete, checked map; all robots share it except for overrides."""

    name: str  # name of the map in messages
    level: Level  # whether the log holds angles and torques, or wrist positions and forces
    robots: int | None  # number of robots, or None to count those in the log
    trial: str | None  # kind of trial, or None
    time: TimeMap  # location of the time
    csv: CsvMap  # form of a text table
    # every mapped channel in the order of ``Samples.values``, with placeholders
    common: Mapping[str, ChannelMap]
    required: tuple[str, ...]  # channels that every log must have
    # channels that differ, by robot (from 1)
    own: Mapping[int, Mapping[str, ChannelMap]] = field(default_factory=dict)
    called: tuple[str, ...] = ()  # names of the robots in order, or empty

    @property
    def names(self) -> tuple[str, ...]:
        """Mapped channels in the order of ``Samples.values``: those of the level, then the commands if mapped."""
        return tuple(self.common)

    def meaning(self, name: str, robot: int) -> str:
        """Return the name of a channel of one robot, counted from 1, in messages."""
        return f"{name} of robot {robot}" if name in (*CHANNELS[self.level], *REF) else name

    def channels(self, robot: int) -> dict[str, ChannelMap]:
        """Return the mapped channels of one robot (from 1) in the order of ``names``, placeholders replaced."""
        found = {**self.common, **self.own.get(robot, {})}
        return {
            name: channel.filled(lambda text, name=name: self._fill(text, robot, name))
            for name, channel in found.items()
        }

    def time_column(self, robot: int) -> str | None:
        """Return the time column of one robot, counted from 1."""
        return self.time.column and self._fill(self.time.column, robot)

    def nanosec_column(self, robot: int) -> str | None:
        """Return the column of nanoseconds of one robot, counted from 1."""
        return self.time.nanosec and self._fill(self.time.nanosec, robot)

    def _fill(self, text: str, robot: int, channel: str = "") -> str:
        values = {"robot": str(robot), "robot0": str(robot - 1), "channel": channel}
        if robot <= len(self.called):
            values["name"] = self.called[robot - 1]
        return re.sub(r"\{(\w+)\}", lambda found: values.get(found[1], found[0]), text)

    def require(self, key: Literal["topic", "field", "column"], kind: str) -> None:
        """Check that the map has a location for every channel in one kind of log; ``kind`` names it in the plural."""
        tables = {"channels": self.common, **{f"robot.{r}.channels": own for r, own in self.own.items()}}
        for table, channels in tables.items():
            for name, channel in channels.items():
                if getattr(channel, key) is None:
                    raise InputError(
                        f"map {self.name}: {table}.{name}: missing key {key!r}, by which {kind} are read "
                        "(it may also stand in [defaults])"
                    )

    def count_robots(
        self, where: str, is_there: Callable[[int], bool], key: Literal["topic", "column"]
    ) -> int:
        """Return the number of robots from the map, or count those that are there, from 1.

        A robot missing in the middle is refused; ``key`` says how the log locates channels.
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
        return max(count, 1)  # without any robot, later checks report what robot 1 lacks

    def has_commands(self, robots: int, is_there: Callable[[ChannelMap], bool]) -> bool:
        """Return whether to read commands: they are mapped, and either required or present for some robot."""
        if REF[0] not in self.common:
            return False
        every = [self.channels(robot)[name] for robot in range(1, robots + 1) for name in REF]
        return not all(self.common[name].optional for name in REF) or any(map(is_there, every))

    def one_robot_only(self, key: Literal["topic", "column"]) -> bool:
        """Return whether all robots would read the same place, so that a log can hold only one robot."""
        return not self.own and not any(
            re.search(r"\{(robot0?|name)\}", (getattr(channel, key) or "") + (channel.joint or ""))
            for channel in self.common.values()
        )


# Parts shared by maps of teams and of joints.


def check_version(values: Values, where: str) -> None:
    """Refuse a map of another version; checked first, since its keys may differ."""
    version = values.get("version", VERSION)
    if type(version) is not int or version != VERSION:
        raise InputError(f"{where}: version is {version!r:.40}; this program reads version {VERSION}")


def table_of(values: Values, key: str, where: str) -> dict[str, Any]:
    """Return a table inside another one, empty if it is missing."""
    table = values.get(key, {})
    if not isinstance(table, dict):
        raise InputError(f"{where}: {key} is {table!r:.40}; it must be a table, [{key}]")
    return table


def check_placeholders(fields: Fields, key: str, known: Sequence[str]) -> str | None:
    """Return a text after a check of its placeholders, None if it is missing."""
    if key not in fields:
        return None
    text = fields.text(key)
    for placeholder in re.findall(r"\{([^{}]*)\}", text):
        if placeholder not in known:
            valid = ", ".join(f"{{{name}}}" for name in known)
            rule = f"; the placeholders are {valid}"
            rule = rule if known else ", but the robot has one such column; name it"
            raise InputError(f"{fields.where}: {key} holds the placeholder '{{{placeholder:.40}}}'{rule}")
    return text


def parse_channel(
    fields: Fields, placeholders: Sequence[str], dimension: str, units: Sequence[str], noun: str
) -> ChannelMap:
    """Parse a channel from its table; ``dimension``, ``units`` and ``noun`` as in ``si_factor``."""
    place = {key: check_placeholders(fields, key, placeholders) for key in PLACES}
    if place["column"] is None and (place["topic"] is None or place["field"] is None):
        missing = (
            "topic" if place["field"] is not None else "field" if place["topic"] is not None else "column"
        )
        raise InputError(
            f"{fields.where}: missing key {missing!r}; a channel has a topic and a field (bags) or a column (tables)"
        )
    if place["joint"] is not None and place["field"] not in JOINT_FIELDS:
        raise InputError(
            f"{fields.where}: field is {place['field']!r:.60}; with a joint it must be one of {', '.join(JOINT_FIELDS)}"
        )
    sign = fields.values.get("sign", 1)
    if type(sign) is not int or sign not in (1, -1):
        fields.refuse("sign", "1 or -1")
    return ChannelMap(
        topic=place["topic"],
        joint=place["joint"],
        field=place["field"],
        column=place["column"],
        scale=sign * si_factor(fields, dimension, units, noun),
        offset=fields.number("offset") if "offset" in fields else 0.0,
        counted=fields.values["unit"] == COUNTS,
    )


def parse_time(values: Values, where: str) -> TimeMap:
    fields = Fields(values, ("unit",) if "column" in values else (), where, _TIME)
    if "nanosec" in fields and ("column" not in fields or fields.values["unit"] != "s"):
        raise InputError(f'{where}: nanosec goes with a column of whole seconds: column, and unit = "s"')
    return TimeMap(
        column=check_placeholders(fields, "column", _PLACEHOLDERS),
        nanosec=check_placeholders(fields, "nanosec", _PLACEHOLDERS),
        unit=fields.one_of("unit", (*TIME_UNITS, DATES)) if "unit" in fields else "s",
        clock=fields.one_of("clock", ("header", "log")) if "clock" in fields else "header",
    )


def parse_csv(values: Values, where: str) -> CsvMap:
    fields = Fields(values, (), where, _CSV)
    delimiter = values.get("delimiter")
    decimal: Literal[".", ","] = fields.one_of("decimal", (".", ",")) if "decimal" in fields else "."
    if delimiter is not None:
        single = isinstance(delimiter, str) and len(delimiter) == 1 and delimiter.isascii()
        if not single or delimiter in '"\r\n.':
            fields.refuse("delimiter", 'one character such as ",", ";" or "\\t"')
        if delimiter == decimal:
            raise InputError(f"{where}: delimiter and decimal are both {decimal!r}; they must differ")
    return CsvMap(delimiter, decimal)


def read_toml_map(path: Path) -> dict[str, object]:
    names = ", ".join(MAPS)
    try:
        if not path.exists():
            raise InputError(f"map {path}: there is no such file, and the built-in maps are {names}")
        if not path.is_file():
            raise InputError(f"map {path}: is not a file; name a TOML file or one of {names}")
        return _toml(read_small(path, _LARGEST_BYTES, f"map {path}", "map").decode("utf-8"), f"map {path}")
    except UnicodeDecodeError as error:
        raise InputError(f"map {path}: is not a text file in UTF-8 ({error.reason})") from error
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(f"map {str(path)!r:.80}: cannot be read ({detail_of(error)})") from error


def _toml(text: str, where: str) -> dict[str, object]:
    try:
        return parse_toml(text)
    except (RecursionError, ValueError) as error:
        raise InputError(f"{where}: is not TOML ({detail_of(error)})") from error


# Maps of teams.


def read_map(path_or_name: Path | str) -> LogMap:
    """Read a map from a file, or return a built-in map by name; built-in names take precedence."""
    if str(path_or_name) in MAPS:
        return builtin_map(str(path_or_name))
    path = Path(path_or_name)
    return parse_map(read_toml_map(path), str(path))


@cache
def builtin_map(name: str) -> LogMap:
    return parse_map(_toml(builtin_map_text(name), f"map {name}"), name)


def builtin_map_text(name: str) -> str:
    """Return the TOML of a built-in map, as a template for new maps."""
    if name not in MAPS:
        raise InputError(f"map {name!r} does not exist; the built-in maps are {', '.join(MAPS)}")
    return (resources.files("mocobot_logs") / "builtin_maps" / f"{name}.toml").read_text(encoding="utf-8")


def parse_map(values: Values, name: str) -> LogMap:
    """Check and parse the TOML values of a map; ``name`` is its name in messages."""
    where = f"map {name}"
    check_version(values, where)
    if "joints" in values and "level" not in values:
        raise InputError(
            f"{where}: is of one robot's joints, not of a team; inspect, watch, diagnose and replay read its log with "
            "--model"
        )
    top = Fields(values, _REQUIRED, where, _OPTIONAL)
    level: Level = top.one_of("level", get_args(Level))
    robots = values.get("robots")
    if robots is not None and (type(robots) is not int or not 1 <= robots <= MAX_ROBOTS):
        top.refuse("robots", f"a whole number from 1 to {MAX_ROBOTS}")
    called = _robot_names(top, robots)
    robots = len(called) or robots
    trial = top.one_of("trial", TRIALS) if "trial" in top else None
    defaults = table_of(values, "defaults", where)
    check_known(defaults, _CHANNEL, f"{where}: defaults")
    common, own = _common_tables(values, level, defaults, where), _own_tables(values, robots, called, where)
    for robot, tables in own.items():
        check_known(tables, tuple(common), f"{where}: robot.{robot}.channels")
    found = LogMap(
        name=name,
        level=level,
        robots=robots,
        trial=trial,
        time=parse_time(table_of(values, "time", where), f"{where}: time"),
        csv=parse_csv(table_of(values, "csv", where), f"{where}: csv"),
        common={
            key: _team_channel(key, [defaults, common[key]], f"{where}: channels.{key}")
            for key in (*CHANNELS[level], *REF)
            if key in common
        },
        required=CHANNELS[level],
        own={
            robot: {
                key: _team_channel(
                    key, [defaults, common[key], table], f"{where}: robot.{robot}.channels.{key}"
                )
                for key, table in tables.items()
            }
            for robot, tables in own.items()
        },
        called=called,
    )
    _check_names(found, where)
    return found


def _robot_names(top: Fields, robots: int | None) -> tuple[str, ...]:
    """Return the names of the robots, empty if the map has none."""
    if "names" not in top:
        return ()
    names = top.values["names"]
    if (
        not isinstance(names, list)
        or not 1 <= len(names) <= MAX_ROBOTS
        or not all(isinstance(name, str) and name for name in names)
        or len(set(names)) < len(names)
    ):
        top.refuse("names", 'a list of distinct names, one for each robot, such as ["left", "right"]')
    if robots is not None and robots != len(names):
        raise InputError(f"{top.where}: robots is {robots}, but names has {len(names)}; leave robots out")
    return tuple(names)


def _check_names(found: LogMap, where: str) -> None:
    """Check that names are given if and only if a text holds ``{name}``."""
    channels = [*found.common.values(), *(c for own in found.own.values() for c in own.values())]
    texts = [found.time.column, found.time.nanosec, *(getattr(c, key) for c in channels for key in PLACES)]
    holds = any("{name}" in text for text in texts if text is not None)
    if holds and not found.called:
        raise InputError(
            f"{where}: missing key 'names', which goes with the placeholder '{{name}}': names = [\"left\", ...]"
        )
    if found.called and not holds:
        raise InputError(
            f"{where}: names is given, but neither a channel nor time holds the placeholder '{{name}}'"
        )


def _common_tables(values: Values, level: Level, defaults: Values, where: str) -> dict[str, dict[str, Any]]:
    tables, inside = table_of(values, "channels", where), f"{where}: channels"
    with_commands = any(name in tables for name in REF)
    Fields(tables, (*CHANNELS[level], *(REF if with_commands else ())), inside, () if with_commands else REF)
    found = _channel_tables(tables, inside)
    for name, table in found.items():
        if "unit" not in table and "unit" not in defaults:
            units = ", ".join(units_of(name))
            raise InputError(f"{inside}.{name}: missing key 'unit'; it is one of {units}")
    return found


def _own_tables(
    values: Values, robots: int | None, called: tuple[str, ...], where: str
) -> dict[int, dict[str, dict[str, Any]]]:
    """Return the tables of channels that differ, by robot."""
    own: dict[int, dict[str, dict[str, Any]]] = {}
    for key, table in table_of(values, "robot", where).items():
        inside = f"{where}: robot.{key}"
        last = MAX_ROBOTS if robots is None else robots
        number = str(called.index(key) + 1) if key in called else key
        if not re.fullmatch(r"[1-9][0-9]{0,3}", number) or int(number) > last:
            named = f", or called {', '.join(called)}" if called else ""
            raise InputError(f"{inside}: there is no such robot; robots are counted from 1 to {last}{named}")
        if int(number) in own:
            raise InputError(f"{inside}: robot {number} has a table already")
        if not isinstance(table, dict):
            raise InputError(f"{inside} is {table!r:.40}; it must be a table with the key channels")
        check_known(table, ("channels",), inside)
        own[int(number)] = _channel_tables(table_of(table, "channels", inside), f"{inside}.channels")
    return own


def _channel_tables(tables: Values, where: str) -> dict[str, dict[str, Any]]:
    found = {name: table_of(tables, name, where) for name in tables}
    for name, table in found.items():
        check_known(table, _CHANNEL, f"{where}.{name}")
    return found


def _team_channel(name: str, tables: Sequence[Values], where: str) -> ChannelMap:
    """Parse a channel from several tables; later tables override earlier ones."""
    values = {key: value for table in tables for key, value in table.items()}
    if values.get("unit") != COUNTS and not any("counts_per_turn" in table for table in tables[1:]):
        values.pop("counts_per_turn", None)  # a default for counts does not apply to channels in other units
    dimension = dimension_of(name)
    fields = Fields(values, ("unit",), where, _CHANNEL)
    if "counts_per_turn" in fields:
        fields.number("counts_per_turn", 1.0)
    found = parse_channel(fields, _PLACEHOLDERS, dimension, units_of(name), f"{dimension}s")
    optional = values.get("optional", False)
    if type(optional) is not bool or (optional and name not in REF):
        fields.refuse("optional", f"true or false, and true for {', '.join(REF)} only")
    return replace(found, optional=optional)

"""From the TOML of a map to a ``LogMap``: every key known, every value allowed, nothing missing."""

import re
from collections.abc import Mapping
from typing import Any, Literal, get_args

from estimator.errors import InputError
from estimator.recording.metadata import TRIALS
from estimator.strict import Fields, check_known
from mocobot_logs.log import CHANNELS, REF, Level
from mocobot_logs.map.log_map import PLACEHOLDERS, ChannelMap, CsvMap, LogMap, TimeMap
from mocobot_logs.map.units import COUNTS, DATES, TIME_UNITS, si_factor, units_of

VERSION = 1
MAX_ROBOTS = 1000
_REQUIRED = ("version", "level", "channels")
_OPTIONAL = ("robots", "names", "trial", "time", "csv", "defaults", "robot")
_TIME = ("column", "unit", "clock")
_CSV = ("delimiter", "decimal")
_CHANNEL = ("topic", "joint", "field", "column", "unit", "sign", "offset", "counts_per_turn", "optional")
KEYS = (*_REQUIRED, *_OPTIONAL, *_TIME, *_CSV, *_CHANNEL)
"""Every key of a map but the channels' names."""
JOINT_FIELDS = ("position", "velocity", "effort")

Values = Mapping[str, Any]


def parse_map(values: Values, name: str) -> LogMap:
    """Check a map and bring it into shape.

    Args:
        values: the parsed TOML.
        name: what to call the map in messages.

    Raises:
        InputError: a key is unknown or missing, or a value is not allowed; the sentence lists what is.
    """
    where = f"map {name}"
    version = values.get("version", VERSION)
    if type(version) is not int or version != VERSION:  # before all else: other versions may have other keys
        raise InputError(f"{where}: version is {version!r:.40}; this program reads version {VERSION}")
    if "joints" in values and "level" not in values:
        raise InputError(
            f"{where}: is of one robot's joints, not of a team; inspect, diagnose and replay read its log with --model"
        )
    top = Fields(values, _REQUIRED, where, _OPTIONAL)
    level: Level = top.one_of("level", get_args(Level))
    robots = values.get("robots")
    if robots is not None and (type(robots) is not int or not 1 <= robots <= MAX_ROBOTS):
        top.refuse("robots", f"a whole number from 1 to {MAX_ROBOTS}")
    called = _names(top, values, robots)
    robots = len(called) or robots
    trial = top.one_of("trial", TRIALS) if "trial" in top else None
    defaults = table_of(values, "defaults", where)
    check_known(defaults, _CHANNEL, f"{where}: defaults")
    common, own = _channels(values, level, defaults, where), _overrides(values, robots, called, where)
    found = LogMap(
        name=name,
        level=level,
        robots=robots,
        trial=trial,
        time=time_map(table_of(values, "time", where), f"{where}: time"),
        csv=csv_map(table_of(values, "csv", where), f"{where}: csv"),
        common={
            key: _channel(key, _merged(defaults, c), f"{where}: channels.{key}") for key, c in common.items()
        },
        own={
            robot: {
                key: _channel(
                    key, _merged(defaults, common[key], c), f"{where}: robot.{robot}.channels.{key}"
                )
                for key, c in channels.items()
                if _mapped(key, common, f"{where}: robot.{robot}.channels")
            }
            for robot, channels in own.items()
        },
        called=called,
    )
    _check_names(found, where)
    return found


def _names(top: Fields, values: Values, robots: int | None) -> tuple[str, ...]:
    """What the robots are called, nothing if the map does not say."""
    if "names" not in values:
        return ()
    names = values["names"]
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
    """Whether names and what holds ``{name}`` go together."""
    channels = [*found.common.values(), *(c for own in found.own.values() for c in own.values())]
    texts = [found.time.column, *(t for c in channels for t in (c.topic, c.joint, c.field, c.column))]
    holds = any("{name}" in text for text in texts if text is not None)
    if holds and not found.called:
        raise InputError(
            f"{where}: missing key 'names', which goes with the placeholder '{{name}}': names = [\"left\", ...]"
        )
    if found.called and not holds:
        raise InputError(
            f"{where}: names is given, but neither a channel nor time holds the placeholder '{{name}}'"
        )


def _channels(values: Values, level: Level, defaults: Values, where: str) -> dict[str, dict[str, Any]]:
    tables, inside = table_of(values, "channels", where), f"{where}: channels"
    with_commands = any(name in tables for name in REF)
    Fields(tables, (*CHANNELS[level], *(REF if with_commands else ())), inside, () if with_commands else REF)
    found = {name: table_of(tables, name, inside) for name in tables}
    for name, table in found.items():
        check_known(table, _CHANNEL, f"{inside}.{name}")
        if "unit" not in table and "unit" not in defaults:
            units = ", ".join(units_of(name))
            raise InputError(f"{inside}.{name}: missing key 'unit'; it is one of {units}")
    return found


def _overrides(
    values: Values, robots: int | None, called: tuple[str, ...], where: str
) -> dict[int, dict[str, Values]]:
    own: dict[int, dict[str, Values]] = {}
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
        channels = table_of(table, "channels", inside)
        own[int(number)] = {name: table_of(channels, name, f"{inside}.channels") for name in channels}
        for name, entry in own[int(number)].items():
            check_known(entry, _CHANNEL, f"{inside}.channels.{name}")
    return own


def _mapped(name: str, common: Values, where: str) -> bool:
    check_known((name,), tuple(common), where)
    return True


def _merged(*tables: Values) -> dict[str, Any]:
    """Later tables override; a default for counts does not bind channels in other units."""
    merged = {key: value for table in tables for key, value in table.items()}
    explicit = any("counts_per_turn" in table for table in tables[1:])
    if merged.get("unit") != COUNTS and not explicit:
        merged.pop("counts_per_turn", None)
    return merged


def _channel(name: str, values: Values, where: str) -> ChannelMap:
    fields = Fields(values, ("unit",), where, _CHANNEL)
    parts = {key: _text(fields, key) for key in ("topic", "joint", "field", "column")}
    check_place(parts, where)
    sign = sign_of(fields, values)
    unit, per_turn = values["unit"], None
    if "counts_per_turn" in fields:
        if unit != COUNTS:
            raise InputError(f"{where}: counts_per_turn goes with unit 'counts' only, not with {unit!r:.40}")
        per_turn = fields.number("counts_per_turn", 1.0)
    if not isinstance(unit, str):
        fields.refuse("unit", f"one of {', '.join(units_of(name))}")
    optional = values.get("optional", False)
    if type(optional) is not bool or (optional and name not in REF):
        fields.refuse("optional", f"true or false, and true for {', '.join(REF)} only")
    return ChannelMap(
        **parts,
        scale=sign * si_factor(name, unit, per_turn, where),
        offset=fields.number("offset") if "offset" in fields else 0.0,
        optional=optional,
    )


def check_place(parts: Mapping[str, str | None], where: str) -> None:
    """Check where a channel is: its ``topic``, ``joint``, ``field`` and ``column``.

    Raises:
        InputError: one is missing, or does not go with another.
    """
    if parts["column"] is None and (parts["topic"] is None or parts["field"] is None):
        missing = (
            "topic" if parts["field"] is not None else "field" if parts["topic"] is not None else "column"
        )
        raise InputError(
            f"{where}: missing key {missing!r}; a channel has a topic and a field (bags) or a column (tables)"
        )
    if parts["joint"] is not None and parts["field"] not in JOINT_FIELDS:
        raise InputError(
            f"{where}: field is {parts['field']!r:.60}; with a joint it must be one of {', '.join(JOINT_FIELDS)}"
        )


def sign_of(fields: Fields, values: Values) -> int:
    """Sign of a channel, 1 or -1.

    Raises:
        InputError: it is another.
    """
    sign = values.get("sign", 1)
    if type(sign) is not int or sign not in (1, -1):
        fields.refuse("sign", "1 or -1")
    return sign


def time_map(values: Values, where: str) -> TimeMap:
    """Where time is, by the table ``[time]``.

    Raises:
        InputError: a key is unknown, or a value not allowed.
    """
    fields = Fields(values, ("unit",) if "column" in values else (), where, _TIME)
    return TimeMap(
        column=_text(fields, "column"),
        unit=fields.one_of("unit", (*TIME_UNITS, DATES)) if "unit" in fields else "s",
        clock=fields.one_of("clock", ("header", "log")) if "clock" in fields else "header",
    )


def csv_map(values: Values, where: str) -> CsvMap:
    """How a text table is written, by the table ``[csv]``.

    Raises:
        InputError: a key is unknown, or a value not allowed.
    """
    fields = Fields(values, (), where, _CSV)
    delimiter = values.get("delimiter")
    decimal: Literal[".", ","] = fields.one_of("decimal", (".", ",")) if "decimal" in fields else "."
    if delimiter is not None and (
        not isinstance(delimiter, str)
        or len(delimiter) != 1
        or delimiter in '"\r\n.'
        or not delimiter.isascii()
    ):
        fields.refuse("delimiter", 'one character such as ",", ";" or "\\t"')
    if delimiter is not None and delimiter == decimal:
        raise InputError(f"{where}: delimiter and decimal are both {decimal!r}; they must differ")
    return CsvMap(delimiter, decimal)


def table_of(values: Values, key: str, where: str) -> dict[str, Any]:
    """A table inside another one, empty where there is none.

    Raises:
        InputError: it is no table.
    """
    table = values.get(key, {})
    if not isinstance(table, dict):
        raise InputError(f"{where}: {key} is {table!r:.40}; it must be a table, [{key}]")
    return table


def _text(fields: Fields, key: str) -> str | None:
    if key not in fields:
        return None
    text = fields.text(key)
    for placeholder in re.findall(r"\{([^{}]*)\}", text):
        if placeholder not in PLACEHOLDERS:
            valid = ", ".join(f"{{{name}}}" for name in PLACEHOLDERS)
            raise InputError(
                f"{fields.where}: {key} holds the placeholder '{{{placeholder:.40}}}'; the placeholders are {valid}"
            )
    return text

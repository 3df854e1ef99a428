"""Draft a map: TOML that reads a log as far as names and values tell, with comments on doubtful lines."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_logs.draft_names import (
    HOLE,
    TOKEN,
    UNITS,
    Candidate,
    Found,
    Robots,
    Templates,
    find_channels,
    of_bag,
    of_table,
    templates_of,
)
from mocobot_logs.formats import Kind, log_kind
from mocobot_logs.joints.joint_map import QUANTITIES, units_of
from mocobot_logs.log import CHANNELS, REF
from mocobot_logs.maps import CsvMap, dimension_of
from mocobot_logs.open_log import open_table
from mocobot_logs.table.table import Table, Wanted
from mocobot_logs.units import COUNTS, DATES, FACTORS

DOUBTFUL = "doubtful: "
"""Prefix of the comment on a line that the user must check."""
_LISTED = 12
_PLAUSIBLE = {"angle": 3.2, "torque": 60.0, "length": 1.5, "force": 600.0}
"""Largest plausible angle, torque, reach and force of an arm [rad, N m, m, N]."""
_SURE = {"angle": (1.8, 10.0), "torque": (30.0, 200.0), "length": (1.0, 10.0), "force": (300.0, 2000.0)}
"""Largest values that are certainly in SI, and smallest that are certainly in the smaller unit; in between, either may
be."""
_SMALLER = {"angle": "deg", "torque": "mNm", "length": "mm", "force": "mN"}
_MOST_DEGREES = 400.0
"""Largest angle in degrees; larger whole numbers are counts."""
_ONE_TURN = 0.01
"""A range within this share of a full turn means an encoder that wraps around."""
_RATES_HZ = (10.0, 20_000.0)


@dataclass(frozen=True)
class Draft:
    """A draft of a map.

    Attributes:
        text: the map in TOML.
        doubtful: number of lines that the user must check.
        missing: required channels that were not found; the map is incomplete without them.
        robots: number of robots found.
    """

    text: str
    doubtful: int
    missing: tuple[str, ...]
    robots: int = 1


def draft_of(path: Path, episode: int | None = None) -> Draft:
    """Draft the map of a team's log.

    Args:
        path: a log of any format, with any names.
        episode: episode of a LeRobot dataset; may be None if it holds only one.

    Raises:
        InputError: there is no such log, or it is damaged.
    """
    kind = log_kind(path)
    if kind == "bag":
        candidates, unstamped = of_bag(path)
        found = find_channels(candidates)
        silent = any(c.place(c.name)["topic"] in unstamped for each in found.channels.values() for c in each)
        time = ["[time]", 'clock = "log"  # messages have no stamps of their own', ""] if silent else []
        return team_draft(path, found, time)
    table, candidates, csv = _opened(path, kind, episode)
    found = find_channels(candidates)
    return team_draft(path, found, [*_time_lines(table, candidates, found.robots), *csv])


def draft_joint_map(
    path: Path, joints: Sequence[str], slides: Sequence[bool], episode: int | None = None
) -> Draft:
    """Draft the map of a log of one robot's joints.

    Args:
        path: a log of any format, with any names.
        joints: names of the model's joints.
        slides: whether each joint slides.
        episode: episode of a LeRobot dataset; may be None if it holds only one.

    Raises:
        InputError: there is no such log, or it is damaged.
    """
    head = [*_head(path, "docs/serial/guide.md says what may stand here."), "version = 1"]
    head += [f"joints = {json.dumps(list(joints), ensure_ascii=False)}", ""]
    kind = log_kind(path)
    if kind == "bag":
        places, unused = _joint_topics(path, joints)
        lines = [_joint_line(name, place, None, slides) for name, place in places.items()]
        return _joint_draft(head, lines, places, unused)
    table, candidates, csv = _opened(path, kind, episode)
    time = [*_time_lines(table, candidates, Robots((), "")), *csv]
    column = next((found for line in time if (found := re.fullmatch(r"column = (\".*\")", line))), None)
    places, unused = _joint_columns(table, joints, None if column is None else json.loads(column[1]))
    lines = [_joint_line(name, p, _first_values(table, p.columns), slides) for name, p in places.items()]
    return _joint_draft([*head, *time], lines, places, unused)


def _head(path: Path, help_text: str) -> list[str]:
    return [
        f"# Draft of a map for {_printable(str(path))}. Lines that need a look say that they are doubtful;",
        f"# {help_text}",
    ]


def _unused(names: Sequence[str]) -> list[str]:
    more = ", ..." if len(names) > _LISTED else ""
    return ["", f"# not used: {_printable(', '.join(names[:_LISTED]))}{more}"] if names else []


def _printable(text: str) -> str:
    """Return text that fits a comment: one line, without control characters."""
    return "".join(c if c.isprintable() else " " for c in text)


def _opened(path: Path, kind: Kind, episode: int | None) -> tuple[Table, list[Candidate], list[str]]:
    """Return a table, the candidates among its columns, and the map's lines on the text format if it is unusual."""

    def has_values(candidates: list[Candidate]) -> bool:
        return any(c.values is not None and len(c.values) for c in candidates if c.reading.group != "time")

    table = open_table(path, kind, CsvMap(), episode)
    candidates = of_table(table)
    if kind == "csv" and not has_values(candidates):
        try:
            other = open_table(path, kind, CsvMap(decimal=","))
            again = of_table(other)
        except InputError:  # the rows do not fit the header with a decimal comma
            return table, candidates, []
        if has_values(again):
            return other, again, ["[csv]", 'decimal = ","', ""]
    return table, candidates, []


# Time.


def _time_lines(table: Table, candidates: Sequence[Candidate], robots: Robots) -> list[str]:
    """Return the lines of [time], from the candidates with names of time."""
    times = [candidate for candidate in candidates if candidate.reading.group == "time"]
    if not times:
        return ["[time]", f"# {DOUBTFUL}nothing is called like time", '# column = "?"', '# unit = "s"', ""]
    name, column, doubts = _choose_time(table, times, robots)
    unit, said = column.reading.unit, ""
    if unit is None and column.values is not None and len(column.values):
        unit, doubt = _guess_time(column.values)
        said = "by the intervals"
        doubts += [doubt] if doubt else []
    elif column.values is None or not len(column.values):
        dates = _has_dates(table, column.name)
        if not dates:
            doubts.append("its values cannot be read")
        unit = unit or (DATES if dates else "s")
    comment = f"  # {DOUBTFUL}{'; '.join(doubts)}" if doubts else f"  # {said}" if said else ""
    text = json.dumps(name, ensure_ascii=False)
    return ["[time]", f"column = {text}", f'unit = "{unit}"{_printable(comment)}', ""]


def _choose_time(table: Table, times: list[Candidate], robots: Robots) -> tuple[str, Candidate, list[str]]:
    """Return the column's name (with a placeholder if each robot has its own), the column, and the doubts."""
    if robots.called:
        for template, each in templates_of(times).items():
            if set(robots.called) <= set(each):
                return template.replace(HOLE, robots.placeholder), each[robots.called[0]], []
    exact = [c for c in times if c.name == table.time_column]
    best = (exact or sorted(times, key=lambda c: (len(c.reading.rest), len(c.name))))[0]
    others = [c.name for c in times if c is not best and len(c.reading.rest) <= len(best.reading.rest)]
    return best.name, best, [f"or {others[0]}?"] if others and not exact else []


def _has_dates(table: Table, column: str) -> bool:
    try:
        block = next(table.blocks(Wanted((), (column,), None), lambda _: None), None)
    except InputError:
        return False
    return block is not None and bool(np.any(block.clocks[column][1]))


def _guess_time(values: Array) -> tuple[str, str | None]:
    """Guess the unit of time from the intervals between stamps; return it and the doubt, if any."""
    steps = np.diff(values)
    steps = steps[steps > 0]
    step = float(np.median(steps)) if len(steps) else 0.0
    sizes = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
    fit = [unit for unit, size in sizes.items() if step and _RATES_HZ[0] <= 1 / (step * size) <= _RATES_HZ[1]]
    return (fit[0], None if len(fit) == 1 else f"{' or '.join(fit)}?") if fit else ("s", "which unit?")


# Teams.


def team_draft(path: Path, found: Found, settings: Sequence[str]) -> Draft:
    """Draft the whole map of a team; ``settings`` are the lines of [time] and [csv]."""
    channels, robots = found.channels, found.robots
    level = max(CHANNELS, key=lambda each: sum(channel in channels for channel in CHANNELS[each]))
    wanted = [*CHANNELS[level], *(REF if all(channel in channels for channel in REF) else ())]
    entries = {
        channel: _team_line(channel, channels.get(channel, []), found.templates.get(channel, {}), robots)
        for channel in wanted
    }
    missing = tuple(channel for channel, entry in entries.items() if entry.startswith("#"))
    help_text = "docs/measured-data.md says what may stand here. Then: mocobot inspect "
    lines = _head(path, f"{help_text}{_printable(str(path))} --map THIS_FILE")
    lines += ["version = 1", f'level = "{level}"']
    if robots.placeholder == "{name}":
        lines.append(f"names = {json.dumps(robots.called, ensure_ascii=False)}")
    elif robots.called:
        lines.append(f"robots = {len(robots.called)}")
    used = {c.name for channel in wanted for c in channels.get(channel, [])}
    rest = [c.name for c in found.candidates if c.name not in used and c.reading.group != "time"]
    text = "\n".join([*lines, "", *settings, "[channels]", *entries.values(), *_unused(rest)]) + "\n"
    return Draft(text, text.count(DOUBTFUL), missing, max(len(robots.called), 1))


def _team_line(channel: str, candidates: Sequence[Candidate], templates: Templates, robots: Robots) -> str:
    if not candidates:
        return f"# {DOUBTFUL}nothing is called like {channel}\n# {channel} = {{ ... }}"
    name, mine, doubts = _choose(candidates, templates, robots)
    reading = mine[0].reading
    values = [c.values for c in mine if c.values is not None and len(c.values)]
    every = np.concatenate(values) if values else np.empty(0)
    said = ""
    if reading.unit is not None:
        unit, doubt = reading.unit, _doubt_unit(channel, reading.unit, every)
    elif len(every):
        (unit, doubt), said = _guess_unit(channel, every), ", unit by the values"
    else:
        (unit, doubt) = _guess_unit(channel, every)[0], "its values cannot be read"
    doubts += [each for each in (reading.doubt, doubt) if each is not None]
    pairs = [*_pairs(mine[0].place(name)), f'unit = "{unit}"']
    if unit == COUNTS:
        pairs.append("counts_per_turn = ?")
    if channel in REF:
        pairs.append("optional = true")
    extent = f"{np.min(every):.4g} to {np.max(every):.4g} {unit}{said}" if len(every) else ""
    line = f"{channel} = {{ {', '.join(pairs)} }}"
    return ("# " if unit == COUNTS else "") + line + _comment(doubts, extent)


def _pairs(place: Mapping[str, str]) -> list[str]:
    return [f"{key} = {json.dumps(text, ensure_ascii=False)}" for key, text in place.items()]


def _comment(doubts: Sequence[str], extent: str) -> str:
    if doubts:
        return _printable(f"  # {DOUBTFUL}{'; '.join(doubts)}" + (f" ({extent})" if extent else ""))
    return _printable(f"  # {extent}") if extent else ""


def _choose(
    candidates: Sequence[Candidate], templates: Templates, robots: Robots
) -> tuple[str, list[Candidate], list[str]]:
    """Return a channel's name with the placeholder, the candidates that it stands for, and the doubts."""
    if not robots.called:
        best = min(candidates, key=lambda c: (c.reading.unit is None, len(c.name)))
        others = [c.name for c in candidates if c is not best]
        return best.name, [best], [f"or {_printable(others[0])}?"] if others else []
    fit: Mapping[str, list[str]] = {
        template: [told for told in robots.called if told in each] for template, each in templates.items()
    }
    ranked = sorted(fit, key=lambda t: (-len(fit[t]), len(t)))
    best = ranked[0]
    lacking = [told for told in robots.called if told not in fit[best]]
    doubts = [f"no such name for {', '.join(lacking)}"] if lacking else []
    if len(ranked) > 1 and len(fit[ranked[1]]) == len(fit[best]):
        doubts.append(f"or {_printable(ranked[1].replace(HOLE, robots.placeholder))}?")
    mine = [templates[best][told] for told in fit[best]]
    return best.replace(HOLE, robots.placeholder), mine or [candidates[0]], doubts


def _guess_unit(channel: str, values: Array) -> tuple[str, str | None]:
    """Guess the unit of a channel from all its values; return it and the doubt, if any."""
    dimension = dimension_of(channel)
    si, smaller = next(iter(FACTORS[dimension])), _SMALLER[dimension]
    largest = float(np.max(np.abs(values), initial=0.0))
    if dimension == "angle" and largest > _MOST_DEGREES and np.all(values == np.rint(values)):
        return COUNTS, "counts_per_turn must be filled in"
    if largest == 0.0:
        return si, "it is zero throughout: which unit?"
    if dimension == "angle" and abs(float(np.ptp(values)) / (2 * np.pi) - 1.0) < _ONE_TURN:
        return si, "rad that jump by a full turn, which has to be taken out before? or deg?"
    si_up_to, smaller_from = _SURE[dimension]
    if largest <= si_up_to:
        return si, None
    doubt = None if largest >= smaller_from else f"{si} or {smaller}?"
    return (smaller if largest > _PLAUSIBLE[dimension] else si), doubt


def _doubt_unit(channel: str, unit: str, values: Array) -> str | None:
    """Return the doubt about a unit that a name states, or None."""
    if unit == COUNTS:
        return "counts_per_turn must be filled in"
    dimension = dimension_of(channel)
    largest = float(np.max(np.abs(values), initial=0.0)) * FACTORS[dimension][unit]
    if largest <= _PLAUSIBLE[dimension]:
        return None
    return f"{largest:.3g} {next(iter(FACTORS[dimension]))} is no {dimension} of an arm: which unit?"


# One robot's joints.

_WORDS: dict[str, set[str]] = {
    "enabled": {"enable", "enabled"},
    "command": {
        "cmd", "command", "commanded", "goal", "target", "ref", "reference", "desired", "des", "action", "setpoint"
    },
    "dq": {"dq", "qd", "vel", "velocity", "speed", "omega", "qdot"},
    "torque": {"tau", "torque", "trq", "effort", "force"},
    "current": {"current", "cur", "amp", "amps"},
    "duty": {"pwm", "duty", "load"},
    "supply": {"supply", "bus", "battery", "vin", "volts"},
    "q": {"q", "pos", "position", "angle", "joint", "state", "ang"},
}  # fmt: skip
"""Words that identify a quantity, most specific first."""
_MOTOR = {"motor", "drive", "actuator", "rotor"}
_AT_MOTOR = {
    "q": "motor_position",
    "dq": "motor_velocity",
    "torque": "motor_torque",
    "command": "motor_command",
}
_TURNS = 4.0 * np.pi
"""Largest range of a turning joint in radians; a larger one counts as degrees."""
_METRES = 20.0
"""Largest range of a sliding joint in metres; a larger one counts as millimetres."""
_ROWS = 20_000


@dataclass(frozen=True)
class _Place:
    """Location of one quantity of all joints: keys of a map with placeholders, and the columns that they stand for."""

    keys: Mapping[str, str]
    columns: tuple[str, ...] = ()


def _joint_draft(
    head: list[str], lines: list[str], places: Mapping[str, _Place], unused: Sequence[str]
) -> Draft:
    missing = [] if {"q", "motor_position"} & set(places) else ["a position"]
    if not set(places) - {"q", "motor_position", "dq", "motor_velocity", "supply", "enabled"}:
        missing.append("a torque, a current, a command or a duty")
    tail = _unused(unused)
    if {"command", "motor_command"} & set(places):
        tail += ["", "[control]", f'command = "position"  # {DOUBTFUL}or velocity, or torque?']
    if {"motor_position", "motor_torque", "current"} & set(places):
        what = "motors are logged; how often does each turn for one turn of its joint?"
        tail += ["", f"# {DOUBTFUL}{what}", "# [drive]", "# gear = [ ... ]"]
    if "current" in places:
        tail += ['# torque_constant = "free"']
    absent = [f"# {DOUBTFUL}nothing was found that is {what}" for what in missing]
    text = "\n".join([*head, "[channels]", *lines, *absent, *tail]) + "\n"
    return Draft(text, text.count(DOUBTFUL), tuple(missing))


def _joint_columns(
    table: Table, joints: Sequence[str], time: str | None
) -> tuple[dict[str, _Place], list[str]]:
    """Return places by quantity, and the unused columns."""
    names = [name for name in dict.fromkeys([*table.aliases, *table.shapes]) if name != time]
    templates: dict[str, dict[int, str]] = {}
    for name in names:
        shape = table.shapes.get(name, ())
        if len(shape) == 1 and shape[0] == len(joints):
            templates[f"{name}[{{index}}]"] = {j: f"{name}[{j}]" for j in range(len(joints))}
        elif shape in ((), (1,)):
            for template, j in _joint_templates(name, joints):
                templates.setdefault(template, {}).setdefault(j, name)
    places: dict[str, _Place] = {}
    for template, of in templates.items():
        shared = "{" not in template and len(joints) > 1
        if not shared and len(of) < len(joints):
            continue
        quantity = _quantity(template)
        if quantity is not None and QUANTITIES[quantity].shared == (
            shared or quantity in ("supply", "enabled")
        ):
            places.setdefault(quantity, _Place({"column": template}, tuple(of[j] for j in sorted(of))))
    used = {column.partition("[")[0] for place in places.values() for column in place.columns}
    used |= {column for place in places.values() for column in place.columns}
    return places, [name for name in names if name not in used and name in table.shapes]


def _joint_templates(name: str, joints: Sequence[str]) -> Iterator[tuple[str, int]]:
    """Yield a name with a placeholder for a joint's name or number, and that joint's index.

    If the name holds no joint's name, the name itself comes last, with index 0.
    """
    for j, joint in sorted(enumerate(joints), key=lambda each: -len(each[1])):
        at = re.search(rf"(?<![A-Za-z0-9]){re.escape(joint)}(?![A-Za-z0-9])", name)
        if at is not None:
            yield name[: at.start()] + "{joint}" + name[at.end() :], j
            return
    for found in re.finditer(r"\d+", name):
        for placeholder, j in (("{number}", int(found[0]) - 1), ("{index}", int(found[0]))):
            if 0 <= j < len(joints) and len(joints) > 1:
                yield name[: found.start()] + placeholder + name[found.end() :], j
    yield name, 0


def _quantity(name: str) -> str | None:
    """Return the quantity that a name states, or None."""
    words = {token.lower() for token in TOKEN.findall(re.sub(r"\{\w+\}|\[.*?\]", " ", name))}
    for quantity, telling in _WORDS.items():
        if words & telling:
            return _AT_MOTOR.get(quantity, quantity) if words & _MOTOR else quantity
    return None


def _joint_line(name: str, place: _Place, values: Array | None, slides: Sequence[bool]) -> str:
    kind, motor, doubts = QUANTITIES[name].kind, QUANTITIES[name].motor, []
    slide = all(slides) and not motor
    if any(slides) and not all(slides) and kind in ("position", "velocity", "effort"):
        doubts.append("sliding joints need their own unit: [joint.NAME.channels]")
    chunks = re.split(r"[^a-z]+", re.sub(r"\{\w+\}", " ", place.keys.get("column", "")).lower())
    said = [UNITS[chunk] for chunk in chunks if chunk in UNITS]
    if kind == "velocity":
        said += [f"{unit}/s" for unit in said if unit != "rpm"]
    allowed = units_of(kind, slides=slide)
    unit = next((each for each in reversed(said) if each in allowed), None)
    more = ""
    if unit is None:
        unit = allowed[0]
        if values is not None and kind != "flag":
            doubts.append("unit?")
        largest = 0.0 if values is None or not len(values) else float(np.nanmax(np.abs(values)))
        if kind == "position" and not slide and not motor and largest > _TURNS:
            unit = "deg"
        if kind == "position" and slide and largest > _METRES:
            unit = "mm"
        if kind == "duty" and largest > 1.0:
            unit, more = COUNTS, ", full_scale = 1.0" + (", bits = 16" if largest > 32767 else "")
            doubts.append("full scale?")
    if unit == COUNTS and kind == "position":
        more, doubts = ", counts_per_turn = 1.0", [*doubts, "counts per turn?"]
    unit_text = "" if kind == "flag" else f', unit = "{unit}"'
    extent = "" if values is None or not len(values) else f"{np.min(values):.4g} to {np.max(values):.4g}"
    return f"{name} = {{ {', '.join(_pairs(place.keys))}{unit_text}{more} }}{_comment(doubts, extent)}"


def _first_values(table: Table, columns: Sequence[str]) -> Array | None:
    """Return the first finite values of some columns, concatenated; None if they cannot be read."""
    plain = {c: c if c in table.shapes else c.partition("[")[0] for c in columns}  # brackets may hold a unit
    wanted = tuple(dict.fromkeys(table.aliases.get(c, (plain[c], None))[0] for c in columns))
    if not all(name in table.shapes for name in wanted):
        return None
    block = next(table.blocks(Wanted(wanted, (), 1), lambda _: None), None)
    if block is None:
        return None
    values = np.concatenate([np.asarray(block.columns[n], dtype=float)[:_ROWS].ravel() for n in wanted])
    return values[np.isfinite(values)]


def _joint_topics(path: Path, joints: Sequence[str]) -> tuple[dict[str, _Place], list[str]]:
    """Return the places in the joint state topic with most of the model's joints, and the other topics."""
    from mocobot_logs.bag.cdr import JOINT_STATE, type_name  # the import takes a third of a second
    from mocobot_logs.bag.files import BagFiles
    from mocobot_logs.bag.read import Look

    files = BagFiles(path)
    look = Look(str(path), files)
    topics = [topic for topic, told in files.topics.items() if type_name(told) == JOINT_STATE]
    best = max(topics, key=lambda topic: len(set(joints) & set(look.joints(topic))), default=None)
    if best is None:
        return {}, list(files.topics)
    fields = {"q": "position", "dq": "velocity", "torque": "effort"}
    places = {name: _Place({"topic": best, "joint": "{joint}", "field": f}) for name, f in fields.items()}
    return places, [topic for topic in files.topics if topic != best]

"""Draft a team's map: TOML that reads a log as far as names and values tell, with comments on doubtful lines."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_logs.draft_names import (
    HOLE,
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
from mocobot_logs.log import CHANNELS, REF
from mocobot_logs.maps import CsvMap, dimension_of
from mocobot_logs.open_log import open_table
from mocobot_logs.table.table import Table, Wanted
from mocobot_logs.units import COUNTS, DATES, FACTORS

DOUBTFUL = "doubtful: "  # prefix of the comment on a line that the user must check
_LISTED = 12
_PLAUSIBLE = {"angle": 3.2, "torque": 60.0, "length": 1.5, "force": 600.0}
"""Largest plausible angle, torque, reach and force of an arm [rad, N m, m, N]."""
_SURE = {"angle": (1.8, 10.0), "torque": (30.0, 200.0), "length": (1.0, 10.0), "force": (300.0, 2000.0)}
"""Largest values that are certainly in SI, and smallest that are certainly in the smaller unit; in between, either may
be."""
_SMALLER = {"angle": "deg", "torque": "mNm", "length": "mm", "force": "mN"}
_MOST_DEGREES = 400.0  # largest angle in degrees; larger whole numbers are counts
_ONE_TURN = 0.01  # a range within this share of a full turn means an encoder that wraps around
_RATES_HZ = (10.0, 20_000.0)


@dataclass(frozen=True)
class Draft:
    text: str  # the map in TOML
    doubtful: int  # number of lines that the user must check
    missing: tuple[str, ...]  # required channels that were not found; the map is incomplete without them
    robots: int = 1  # number of robots found


def draft_of(path: Path, episode: int | None = None) -> Draft:
    """Draft the map of a team's log of any format; ``episode`` of a LeRobot dataset may be None if it has only one."""
    kind = log_kind(path)
    if kind == "bag":
        candidates, unstamped = of_bag(path)
        found = find_channels(candidates)
        silent = any(c.place(c.name)["topic"] in unstamped for each in found.channels.values() for c in each)
        time = ["[time]", 'clock = "log"  # messages have no stamps of their own', ""] if silent else []
        return team_draft(path, found, time)
    table, candidates, csv = opened_table(path, kind, episode)
    found = find_channels(candidates)
    return team_draft(path, found, [*time_lines(table, candidates, found.robots), *csv])


def head_lines(path: Path, help_text: str) -> list[str]:
    return [
        f"# Draft of a map for {printable(str(path))}. Lines that need a look say that they are doubtful;",
        f"# {help_text}",
    ]


def unused_lines(names: Sequence[str]) -> list[str]:
    more = ", ..." if len(names) > _LISTED else ""
    return ["", f"# not used: {printable(', '.join(names[:_LISTED]))}{more}"] if names else []


def printable(text: str) -> str:
    """Return text that fits a comment: one line, without control characters."""
    return "".join(c if c.isprintable() else " " for c in text)


def opened_table(path: Path, kind: Kind, episode: int | None) -> tuple[Table, list[Candidate], list[str]]:
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


def time_lines(table: Table, candidates: Sequence[Candidate], robots: Robots) -> list[str]:
    """Return the lines of [time], from the candidates with names of time."""
    times = [candidate for candidate in candidates if candidate.reading.group == "time"]
    if below := _whole_seconds(table):
        found = [time for time in times if time.name in below]
        name = _choose_time(table, found, robots)[0] if found else min(below, key=len)
        word = below[found[0].name if found else name]
        told = (name, _SECONDS.sub(word, name))
        column, nanosec = (json.dumps(each, ensure_ascii=False) for each in told)
        return ["[time]", f"column = {column}", f"nanosec = {nanosec}", 'unit = "s"', ""]
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
    return ["[time]", f"column = {text}", f'unit = "{unit}"{printable(comment)}', ""]


_SECONDS = re.compile(r"(?<![A-Za-z])(secs?|seconds|s)$", re.IGNORECASE)
_BELOW = ("nanosec", "nanosecs", "nsec", "nsecs", "nanoseconds", "nanos", "ns")
"""Words for the nanoseconds of a stamp whose whole seconds have a column of their own."""


def _whole_seconds(table: Table) -> dict[str, str]:
    """Return the columns of whole seconds, each with the word that makes its name that of the nanoseconds."""
    names = {name.lower() for name in table.shapes}
    return {
        name: word
        for name in table.shapes
        for word in _BELOW
        if _SECONDS.search(name) and _SECONDS.sub(word, name).lower() in names
    }


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
    lines = head_lines(path, f"{help_text}{printable(str(path))} --map THIS_FILE")
    lines += ["version = 1", f'level = "{level}"']
    if robots.placeholder == "{name}":
        lines.append(f"names = {json.dumps(robots.called, ensure_ascii=False)}")
    elif robots.called:
        lines.append(f"robots = {len(robots.called)}")
    used = {c.name for channel in wanted for c in channels.get(channel, [])}
    rest = [c.name for c in found.candidates if c.name not in used and c.reading.group != "time"]
    text = "\n".join([*lines, "", *settings, "[channels]", *entries.values(), *unused_lines(rest)]) + "\n"
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
    pairs = [*pairs_of(mine[0].place(name)), f'unit = "{unit}"']
    if unit == COUNTS:
        pairs.append("counts_per_turn = ?")
    if channel in REF:
        pairs.append("optional = true")
    extent = f"{np.min(every):.4g} to {np.max(every):.4g} {unit}{said}" if len(every) else ""
    line = f"{channel} = {{ {', '.join(pairs)} }}"
    return ("# " if unit == COUNTS else "") + line + comment_of(doubts, extent)


def pairs_of(place: Mapping[str, str]) -> list[str]:
    return [f"{key} = {json.dumps(text, ensure_ascii=False)}" for key, text in place.items()]


def comment_of(doubts: Sequence[str], extent: str) -> str:
    if doubts:
        return printable(f"  # {DOUBTFUL}{'; '.join(doubts)}" + (f" ({extent})" if extent else ""))
    return printable(f"  # {extent}") if extent else ""


def _choose(
    candidates: Sequence[Candidate], templates: Templates, robots: Robots
) -> tuple[str, list[Candidate], list[str]]:
    """Return a channel's name with the placeholder, the candidates that it stands for, and the doubts."""
    if not robots.called:
        best = min(candidates, key=lambda c: (c.reading.unit is None, len(c.name)))
        others = [c.name for c in candidates if c is not best]
        return best.name, [best], [f"or {printable(others[0])}?"] if others else []
    fit: Mapping[str, list[str]] = {
        template: [told for told in robots.called if told in each] for template, each in templates.items()
    }
    ranked = sorted(fit, key=lambda t: (-len(fit[t]), len(t)))
    best = ranked[0]
    lacking = [told for told in robots.called if told not in fit[best]]
    doubts = [f"no such name for {', '.join(lacking)}"] if lacking else []
    if len(ranked) > 1 and len(fit[ranked[1]]) == len(fit[best]):
        doubts.append(f"or {printable(ranked[1].replace(HOLE, robots.placeholder))}?")
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

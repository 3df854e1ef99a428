"""Parse names of columns and topics: quantity, joint or axis, unit, robot.

Each name is first parsed alone (``Reading``). Names that differ only by the robot then form one channel of all robots.
"""

import re
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_logs.presets import TEAM_WORDS, UNITS
from mocobot_logs.table.table import Table, Wanted
from mocobot_logs.table.text import BrokenRowsError

if TYPE_CHECKING:
    from mocobot_logs.bag.cdr import MessageType

JOINED = "\x1f"  # separator between topic, joint and field in a combined name
INDEX = {"z": 2, "y": 1, "x": 0, "yaw": 2, "pitch": 1, "roll": 0}
_TURNS = ("yaw", "pitch", "roll")
_COMMAND, _TORQUE, _EFFORT, _FORCE, _GIMBAL, _DRIVEN, _WRIST, _PLACE, _TIME, _OTHER = (
    TEAM_WORDS[key]
    for key in ("command", "torque", "effort", "force", "gimbal", "driven", "wrist", "place", "time", "other")
)
_WORDS = _COMMAND | _TORQUE | _EFFORT | _FORCE | _GIMBAL | _DRIVEN | _WRIST | _PLACE
_UNIT = re.compile(r"(?:\s*[\[(]\s*([^\[\]()]{1,12}?)\s*[\])]|[_.\s/-]([A-Za-z°µ]{1,7}))\s*$")
TOKEN = re.compile(r"[A-Z]?[a-z°µ]+|[A-Z]+(?![a-z])|\d+")
_GLUED = re.compile(r"(f|h|force|theta|ref|gimbal|cmd|pos|p)([xyz])")


@dataclass(frozen=True)
class Reading:
    """What a name says."""

    group: str  # "phi", "tau", "theta", "h", "force", "ref" or "time"
    index: int | None  # joint number as in the name, or axis (x 0, y 1, z 2), or None for time
    axis: bool  # whether ``index`` is an axis
    unit: str | None  # unit in a map, or None if the name has none
    rest: tuple[tuple[int, int], ...]  # spans of the remaining tokens, one of which may identify the robot
    doubt: str | None = None  # what is uncertain, or None


def read_name(name: str, *, element: bool = False) -> Reading | None:
    """Parse a name, which may end in the index of an array ``element``; return None if it names no channel."""
    unit, end = _unit(name)
    for told, stop in dict.fromkeys([(unit, end), (None, len(name))]):
        found = _read(name, _tokens(name, stop), told, element=element)
        if found is not None and (told is None or _suits(told, found.group)):
            return found
    return None


def _unit(name: str) -> tuple[str | None, int]:
    """Return the unit at the end of a name, and the end of the rest."""
    found = _UNIT.search(name)
    if found is None:
        return None, len(name)
    text = re.sub(r"[\s*·.]", "", found[1] or found[2])
    unit = UNITS.get(text.lower()) if text.lower() != "mn" or text == "mN" else None
    return (unit, found.start()) if unit else (None, len(name))


def _suits(unit: str, group: str) -> bool:
    allowed = {
        "phi": ("rad", "deg", "counts"), "theta": ("rad", "deg", "counts"), "tau": ("Nm", "mNm"),
        "h": ("m", "mm"), "ref": ("m", "mm"), "force": ("N", "mN"), "time": ("s", "ms", "us", "ns"),
    }  # fmt: skip
    return unit in allowed[group]


def _tokens(name: str, stop: int) -> list[tuple[str, int, int]]:
    tokens = []
    for found in TOKEN.finditer(name, 0, stop):
        text, start = found[0].lower(), found.start()
        if (glued := _GLUED.fullmatch(text)) is not None:
            middle = start + len(glued[1])
            tokens += [(glued[1], start, middle), (glued[2], middle, found.end())]
        else:
            tokens.append((text, start, found.end()))
    return tokens


def _read(
    name: str, tokens: list[tuple[str, int, int]], unit: str | None, *, element: bool
) -> Reading | None:
    words = {text for text, _, _ in tokens}
    if words & _OTHER or "{" in name:
        return None
    axes = [k for k, (text, _, _) in enumerate(tokens) if text in INDEX]
    if axes and (words & _WORDS or tokens[axes[-1]][0] in _TURNS):
        return _axis(tokens, words, axes[-1], unit)
    digits = [k for k, (text, _, _) in enumerate(tokens) if text.isdigit()]
    if element and words & (_COMMAND | _FORCE | _WRIST) and not words & _TORQUE:
        group = "ref" if words & _COMMAND else "force" if words & _FORCE else "h"
        return Reading(group, int(tokens[digits[-1]][0]), True, unit, _rest(tokens, _WORDS, digits[-1]))
    if digits and words & _WORDS:
        return _joint(tokens, words, digits, unit)
    if words & _TIME:
        return Reading("time", None, False, unit, _rest(tokens, _TIME, None))
    return None


def _axis(tokens: list[tuple[str, int, int]], words: set[str], at: int, unit: str | None) -> Reading | None:
    if words & _COMMAND:
        group = "ref"
    elif words & _FORCE and not words & _TORQUE:
        group = "force"
    elif words & _TORQUE:
        return None  # the moment of a force sensor is no channel
    elif words & _GIMBAL or tokens[at][0] in _TURNS:
        group = "theta"
    elif words & _EFFORT:
        group = "force"
    else:
        group = "h"
    if group == "theta" and words & _EFFORT:
        return None
    doubt = f"{tokens[at][0]} is taken for the axis" if tokens[at][0] in _TURNS else None
    return Reading(group, INDEX[tokens[at][0]], True, unit, _rest(tokens, _WORDS, at), doubt)


def _joint(
    tokens: list[tuple[str, int, int]], words: set[str], digits: list[int], unit: str | None
) -> Reading | None:
    if words & _COMMAND or (words & _FORCE and not words & (_TORQUE | _EFFORT)):
        return None
    group = "tau" if words & (_TORQUE | _EFFORT) else "theta" if words & _GIMBAL else "phi"
    after_word = [k for k in digits if k and tokens[k - 1][0] in _WORDS]
    at = after_word[0] if after_word else digits[-1]
    index = int(tokens[at][0])
    if index > 3:
        return None
    doubt = None
    if at + 1 in digits and tokens[at + 1][1] - tokens[at][2] == 1:
        doubt = "which number is the joint, and which the robot?"
    elif not after_word and len(digits) > 1:
        doubt = "which number is the joint?"
    elif group == "theta":
        doubt = "numbers are taken for the axes z, y, x in this order"
    return Reading(group, index, False, unit, _rest(tokens, _WORDS, at), doubt)


def _rest(tokens: list[tuple[str, int, int]], used: set[str], at: int | None) -> tuple[tuple[int, int], ...]:
    """Return the spans of the remaining tokens; only whole tokens are removed, since a robot's name may hold a
    quantity."""
    return tuple((a, b) for k, (text, a, b) in enumerate(tokens) if k != at and text not in used)


ROWS = 200_000  # number of rows that are read
_LONGEST_ARRAY = 64

Place = tuple[str, tuple[int, ...]]  # a column and an index in it


@dataclass(frozen=True, eq=False)
class Candidate:
    """A number that a log has in every row or message."""

    name: str  # a column; or topic, joint and field, or topic and field, with ``JOINED`` between them
    keys: tuple[str, ...]  # keys of a map for these parts
    reading: Reading  # what the name says
    values: Array | None  # first values without NaN, or None if they could not be read

    def place(self, name: str) -> dict[str, str]:
        """Return keys and values of a map for the name, or for the name with a placeholder."""
        return dict(zip(self.keys, name.split(JOINED), strict=True))


def of_table(table: Table) -> list[Candidate]:
    """Return the candidates of a table."""
    places: dict[Place, str] = {}
    for column, shape in table.shapes.items():
        if np.prod(shape, dtype=object) == 1:
            places[column, (0,) * len(shape)] = column
    for alias, place in sorted(table.aliases.items(), key=lambda entry: len(entry[0])):
        places.setdefault(place, alias)
    for column, shape in table.shapes.items():
        if len(shape) == 1 and 1 < shape[0] <= _LONGEST_ARRAY:
            for k in range(shape[0]):
                places.setdefault((column, (k,)), f"{column}[{k}]")
    readings = {place: _reading(name, place) for place, name in places.items()}
    for column, shape in table.shapes.items():
        if len(shape) == 2 and shape[1] == 3 and shape[0] <= _LONGEST_ARRAY:
            for robot in range(shape[0]):
                for k in range(3):
                    places[column, (robot, k)] = f"{column}[{robot}, {k}]"
                    readings[column, (robot, k)] = _of_robots(column, robot, k)
    found = {place: reading for place, reading in readings.items() if reading is not None}
    if not found and places:
        _values(
            table, [next(iter(places))]
        )  # reads one column, to refuse a table whose rows do not fit its header
    values = _values(table, [place for place, reading in found.items() if reading.group != "time"])
    for place, reading in found.items():
        if reading.group == "time":
            values |= _values(table, [place])
    return [
        Candidate(places[place], ("column",), reading, values.get(place)) for place, reading in found.items()
    ]


def _reading(name: str, place: Place) -> Reading | None:
    return read_name(name, element=bool(place[1]) and name.endswith("]"))


def _of_robots(column: str, robot: int, k: int) -> Reading | None:
    """Parse an element of an array (N, 3) whose first index counts robots."""
    reading, start = read_name(f"{column}[{k}]", element=True), len(column) + 1
    if reading is None:
        return None
    return replace(
        reading, rest=((start, start + len(str(robot))), *(r for r in reading.rest if r[1] < start))
    )


def _values(table: Table, places: list[Place]) -> dict[Place, Array]:
    """Return the first values of some places; columns without numbers are left out."""
    try:
        return _values_of(table, places)
    except BrokenRowsError:
        raise
    except InputError:
        found: dict[Place, Array] = {}
        for place in places:  # find out which place has no numbers
            try:
                found |= _values_of(table, [place])
            except InputError:
                continue
        return found


def _values_of(table: Table, places: list[Place]) -> dict[Place, Array]:
    columns = tuple(dict.fromkeys(column for column, _ in places))
    parts: dict[Place, list[Array]] = {place: [] for place in places}
    rows = 0
    for block in table.blocks(Wanted(columns, (), 1), lambda _: None):
        for column, index in places:
            values = np.asarray(block.columns[column][(slice(None), *index)], float)
            parts[column, index].append(values[np.isfinite(values)])
            rows += len(values)
        if rows > ROWS * max(1, len(places)):
            break
    return {place: np.concatenate(each) if each else np.empty(0) for place, each in parts.items()}


_BAG_BYTES = 1 << 20
_DEEPEST, _MOST = 4, 64


def of_bag(path: Path) -> tuple[list[Candidate], frozenset[str]]:
    """Return the candidates of a bag (joints of joint states, numbers of other messages), and topics without stamps."""
    from mocobot_logs.bag.cdr import JOINT_STATE, CdrReader, Selector  # the import takes a third of a second
    from mocobot_logs.bag.read import Look

    look = Look(path)
    found: list[Candidate] = []
    unstamped: set[str] = set()
    for name in look.types:
        try:
            kind = look.kind(name)
            if kind.name == JOINT_STATE:
                joints = look.joints(name)
                selectors = [Selector(field, joint) for joint in joints for field in ("position", "effort")]
            else:
                selectors = [Selector(field) for field in _numbers(kind, kind.name, 0)[:_MOST]]
        except InputError:
            continue  # the type cannot be read
        messages = look.first(name, _BAG_BYTES) if selectors else None
        if messages is None:
            continue
        stamps, values = CdrReader(kind, selectors, _is_stamped(kind)).read(messages)
        if not stamps.any():
            unstamped.add(name)
        for k, selector in enumerate(selectors):
            keys = ("topic", "field") if selector.joint is None else ("topic", "joint", "field")
            joined = JOINED.join(p for p in (name, selector.joint, selector.field) if p is not None)
            reading = read_name(joined)
            given = values[np.isfinite(values[:, k]), k]
            if reading is not None and reading.group != "time" and len(given):
                found.append(Candidate(joined, keys, reading, given))
    return found, frozenset(unstamped)


def _numbers(kind: "MessageType", name: str, depth: int) -> list[str]:
    """Return the dotted paths of the floating-point numbers outside arrays."""
    from rosbags.interfaces import Nodetype

    paths = []
    for field, (node, detail) in kind.fields(name):
        if node == Nodetype.NAME and depth < _DEEPEST and field != "header":
            paths += [f"{field}.{rest}" for rest in _numbers(kind, str(detail), depth + 1)]
        elif node == Nodetype.BASE and detail[0] in ("float32", "float64"):
            paths.append(field)
    return paths


def _is_stamped(kind: "MessageType") -> bool:
    try:
        kind.require_stamp()
    except InputError:
        return False
    return True


HOLE = "\0"  # placeholder for the robot in a name


@dataclass(frozen=True)
class Robots:
    """How names distinguish robots."""

    # the part of the name that identifies each robot, in order; empty for a single robot
    called: tuple[str, ...]
    placeholder: str  # placeholder in a map: ``{robot}``, ``{robot0}`` or ``{name}``; "" for a single robot


Templates = dict[str, dict[str, Candidate]]
"""Names with ``HOLE`` in place of the robot, then candidates by the text that fills it."""


def templates_of(candidates: Sequence[Candidate]) -> Templates:
    """Return every way in which names of one channel may differ only by the robot."""
    found: Templates = defaultdict(dict)
    for candidate in candidates:
        name = candidate.name
        for told in {name[a:b] for a, b in candidate.reading.rest}:
            template, at = "", 0
            for a, b in candidate.reading.rest:
                if name[a:b] == told:
                    template, at = template + name[at:a] + HOLE, b
            found[template + name[at:]][told] = candidate
    return dict(found)


def find_robots(channels: Mapping[str, Templates]) -> Robots:
    """Find the texts that identify robots in most channels; ties go to numbers from 1 or 0, then to the larger set."""
    votes: Counter[frozenset[str]] = Counter()
    for templates in channels.values():
        for told in {frozenset(each) for each in templates.values() if len(each) > 1}:
            votes[told] += 1
    if not votes:
        return Robots((), "")
    order = {name: k for k, name in enumerate(n for t in channels.values() for e in t.values() for n in e)}
    best = max(votes, key=lambda told: (votes[told], _placeholder(told) != "{name}", len(told)))
    placeholder = _placeholder(best)
    numbered = all(name.isdigit() for name in best)
    called = sorted(best, key=int) if numbered else sorted(best, key=order.__getitem__)
    return Robots(tuple(called), placeholder)


def _placeholder(told: frozenset[str]) -> str:
    for first, placeholder in ((1, "{robot}"), (0, "{robot0}")):
        if told == {str(k) for k in range(first, first + len(told))}:
            return placeholder
    return "{name}"


_AXES = "xyz"


@dataclass(frozen=True)
class Found:
    """Channels and robots found in the names of a log."""

    candidates: Sequence[Candidate]  # all candidates
    channels: Mapping[str, list[Candidate]]  # candidates by channel
    templates: Mapping[str, Templates]  # by channel, how names differ by the robot
    robots: Robots  # how names distinguish robots


def find_channels(candidates: Sequence[Candidate]) -> Found:
    """Sort candidates by channel and robot."""
    channels = _by_channel(candidates)
    templates = {channel: templates_of(each) for channel, each in channels.items()}
    return Found(candidates, channels, templates, find_robots(templates))


def _by_channel(candidates: Sequence[Candidate]) -> dict[str, list[Candidate]]:
    """Group candidates by the channel that their names state."""
    from_0 = {
        group
        for group in ("phi", "tau", "theta")
        if (seen := {c.reading.index for c in candidates if c.reading.group == group and not c.reading.axis})
        and 0 in seen
        and 3 not in seen
    }
    found: dict[str, list[Candidate]] = defaultdict(list)
    for candidate in candidates:
        reading = candidate.reading
        if reading.index is None:
            continue
        if reading.axis:
            if reading.index < 3:
                found[f"{reading.group}_{_AXES[reading.index]}"].append(candidate)
            continue
        joint = reading.index + (reading.group in from_0)
        if 1 <= joint <= 3:
            name = f"theta_{'zyx'[joint - 1]}" if reading.group == "theta" else f"{reading.group}{joint}"
            found[name].append(candidate)
    return dict(found)

"""Draft the map of one robot's joint log: what is there, for which joints, and what is not."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_logs.draft import (
    DOUBTFUL,
    Draft,
    comment_of,
    head_lines,
    opened_table,
    pairs_of,
    printable,
    time_lines,
    unused_lines,
)
from mocobot_logs.draft_names import TOKEN, UNITS, Robots
from mocobot_logs.formats import log_kind
from mocobot_logs.joints.joint_map import (
    COMMANDS,
    DUTIES,
    EFFORTS,
    POSITIONS,
    QUANTITIES,
    VELOCITIES,
    units_of,
)
from mocobot_logs.joints.read import unwrapped
from mocobot_logs.presets import TYPES, Meaning, column_meaning, effort_meaning
from mocobot_logs.table.table import Table, Wanted
from mocobot_logs.table.text import BrokenRowsError
from mocobot_logs.units import COUNTS, FACTORS

if TYPE_CHECKING:
    from mocobot_logs.bag.read import Look

WORDS: dict[str, set[str]] = {
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
MOTOR = {"motor", "drive", "actuator", "rotor"}
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


_WEAK = {"joint", "state"}
"""Words that identify a quantity only if no other column does."""


@dataclass(frozen=True)
class _Place:
    """Location of one quantity of all joints.

    Attributes:
        keys: keys of a map with placeholders.
        values: first finite values of each joint, one for all if the quantity is shared; None if they cannot be read.
        meaning: unit and comment, where the name is well known.
        own: keys of single joints that differ.
        lacks: why a joint has no value.
    """

    keys: Mapping[str, str]
    values: Sequence[Array | None] = ()
    meaning: Meaning | None = None
    own: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    lacks: Mapping[str, str] = field(default_factory=dict)

    @property
    def every(self) -> Array | None:
        """All values, None if they cannot be read."""
        known = [values for values in self.values if values is not None]
        return np.concatenate(known) if known else None


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
    head = [*head_lines(path, "docs/serial/guide.md says what may stand here."), "version = 1"]
    kind, lacking = log_kind(path), []
    if kind == "bag":
        places, time, unused, doubts, lost = _in_bag(path, joints)
    else:
        table, candidates, csv = opened_table(path, kind, episode)
        time, doubts, lost = [*time_lines(table, candidates, Robots((), "")), *csv], [], []
        clock = tomllib.loads("\n".join(time)).get("time", {})
        lacking = _unlogged(table, joints)
        if lacking:
            slides = [slide for joint, slide in zip(joints, slides, strict=True) if joint not in lacking]
            joints = [joint for joint in joints if joint not in lacking]
            lost = [f"joint {joint}" for joint in lacking]
        places, unused = in_table(table, joints, {clock.get("column"), clock.get("nanosec")})
    where = "message" if kind == "bag" else "column; if it does not move, name it by --lock"
    found = _sections(places, slides, [*doubts, *(f"{joint} is in no {where}" for joint in lost)])
    lines, missing = found
    head += [f"joints = {json.dumps(list(joints), ensure_ascii=False)}", ""]
    text = "\n".join([*head, *time, "[channels]", *lines, *unused_lines(unused)]) + "\n"
    return Draft(text, text.count(DOUBTFUL), (*missing, *lost))


def _unlogged(table: Table, joints: Sequence[str]) -> list[str]:
    """Return the joints that no column names, if columns name others; empty if columns name none."""
    names = [*table.aliases, *table.shapes]
    lost = [joint for joint in joints if not any(_named(joint, name) for name in names)]
    return lost if len(lost) < len(joints) else []


def _sections(
    places: Mapping[str, _Place], slides: Sequence[bool], doubts: list[str]
) -> tuple[list[str], list[str]]:
    """Return the lines from [channels] on, and what is missing; ``doubts`` are further doubts."""
    absent = {
        name: place for name, place in places.items() if place.every is not None and not len(place.every)
    }
    places = {name: place for name, place in places.items() if name not in absent}
    # One torque, velocity, command and duty of a joint are used.
    others = {
        name
        for group in (EFFORTS, VELOCITIES, COMMANDS, DUTIES)
        for name in [each for each in group if each in places][1:]
    }
    spare = [f"# or {_line(name, places[name], slides)}" for name in places if name in others]
    places = {name: place for name, place in places.items() if name not in others}
    missing = [] if set(POSITIONS) & set(places) else ["a position"]
    if not {*EFFORTS, *COMMANDS, *DUTIES} & set(places):
        missing.append("a torque, a current, a command or a duty")
    lines = [*(_line(name, place, slides) for name, place in places.items()), *spare]
    for name, place in absent.items():
        reasons = "; ".join(dict.fromkeys(place.lacks.values())) or "its columns have no value"
        lines.append(f"# no {name}: {printable(reasons)}")
    for name in set(POSITIONS) & set(places):
        doubts += [f"{name} of {joint}: {why}" for joint, why in places[name].lacks.items()]
        places[name] = replace(places[name], lacks={})
    lines += [f"# {DOUBTFUL}nothing was found that is {what}" for what in missing]
    lines += [f"# {DOUBTFUL}{printable(doubt)}" for doubt in doubts]
    tail = _own_lines(places)
    if command := places.get("command") or places.get("motor_command"):
        doubt = "" if command.meaning else f"  # {DOUBTFUL}or velocity, or torque?"
        tail += ["", "[control]", f'command = "position"{doubt}']
        if not {*EFFORTS, *DUTIES} & set(places):
            what = "no torque is logged; the loop's gains tell it, where they are known:"
            tail += [
                f"# {DOUBTFUL}{what}",
                '# gain_of = "torque"',
                "# position_gain = ...",
                "# velocity_gain = ...",
            ]
    motors = {"motor_position", "motor_velocity", "motor_torque"} & set(places)
    if motors:
        what = "motors are logged; how often does each turn for one turn of its joint?"
        tail += ["", f"# {DOUBTFUL}{what}"]
    if "current" in places:
        what = 'torque at the joint per ampere [N m/A]; a list where some are known: [12.5, "free", ...]'
        what = "of the motor, per ampere [N m/A]" if motors else what
        tail += [*([] if motors else [""]), "[drive]", *(["# gear = [ ... ]"] if motors else [])]
        tail += [f'torque_constant = "free"  # {what}']
    elif motors:
        tail += ["# [drive]", "# gear = [ ... ]"]
    return [*lines, *tail], missing


def _own_lines(places: Mapping[str, _Place]) -> list[str]:
    """Return tables of the joints that lack a quantity, or have it elsewhere."""
    tables: dict[str, list[str]] = {}
    for name, place in places.items():
        for joint, keys in place.own.items():
            if joint not in place.lacks:
                tables.setdefault(joint, []).append(f"{name} = {{ {', '.join(pairs_of(keys))} }}")
        for joint, why in place.lacks.items():
            tables.setdefault(joint, []).append(f"{name} = false  # {printable(why)}")
    lines = []
    for joint, of in tables.items():
        lines += ["", f"[joint.{json.dumps(joint, ensure_ascii=False)}.channels]", *of]
    return lines


def in_table(
    table: Table, joints: Sequence[str], time: set[str | None]
) -> tuple[dict[str, _Place], list[str]]:
    """Return places by quantity, and the unused columns; ``time`` are the columns of time."""
    names = [name for name in dict.fromkeys([*table.aliases, *table.shapes]) if name not in time]
    templates: dict[str, dict[int, str]] = {}
    for name in names:
        shape = table.shapes.get(name, ())
        if len(shape) == 1 and shape[0] == len(joints):
            templates[f"{name}[{{index}}]"] = {j: f"{name}[{j}]" for j in range(len(joints))}
        elif shape in ((), (1,)):
            for template, j in _joint_templates(name, joints):
                templates.setdefault(template, {}).setdefault(j, name)
    found: dict[str, list[tuple[int, str, Meaning | None]]] = {}
    for template, of in templates.items():
        shared = "{" not in template and len(joints) > 1
        if not shared and len(of) < len(joints):
            continue
        quantity, rank, meaning = quantity_in(template)
        if quantity is not None and QUANTITIES[quantity].shared == (
            shared or quantity in ("supply", "enabled")
        ):
            found.setdefault(quantity, []).append((rank, template, meaning))
    places = {}
    for quantity, each in found.items():
        _, template, meaning = min(each, key=lambda told: told[0])
        columns = [templates[template][j] for j in sorted(templates[template])]
        values = _first_values(table, columns)
        lacks = {
            joint: f"{column} has no value"
            for joint, column, x in zip(joints, columns, values, strict=False)
            if x is not None and not len(x) and not QUANTITIES[quantity].shared
        }
        places[quantity] = _Place({"column": template}, values, meaning, lacks=lacks)
    used = {name for quantity in places for name in _columns_of(places[quantity].keys["column"], templates)}
    return places, [name for name in names if name not in used and name in table.shapes]


def _columns_of(template: str, templates: Mapping[str, Mapping[int, str]]) -> set[str]:
    return {name for column in templates[template].values() for name in (column, column.partition("[")[0])}


def _named(joint: str, name: str) -> re.Match[str] | None:
    return re.search(rf"(?<![A-Za-z0-9]){re.escape(joint)}(?![A-Za-z0-9])", name)


def _joint_templates(name: str, joints: Sequence[str]) -> Iterator[tuple[str, int]]:
    """Yield a name with a placeholder for a joint's name or number, and that joint's index.

    If the name holds no joint's name, the name itself comes last, with index 0.
    """
    for j, joint in sorted(enumerate(joints), key=lambda each: -len(each[1])):
        at = _named(joint, name)
        if at is not None:
            yield name[: at.start()] + "{joint}" + name[at.end() :], j
            return
    for found in re.finditer(r"\d+", name):
        for placeholder, j in (("{number}", int(found[0]) - 1), ("{index}", int(found[0]))):
            if 0 <= j < len(joints) and len(joints) > 1:
                yield name[: found.start()] + placeholder + name[found.end() :], j
    yield name, 0


def quantity_in(name: str) -> tuple[str | None, int, Meaning | None]:
    """Return the quantity that a name states, or None, a rank, and the meaning if the name is well known.

    The rank is 0 for well-known names, and 2 if the words are weak.
    """
    meaning = column_meaning(name)
    if meaning is not None:
        return meaning.quantity, 0, meaning
    words = {token.lower() for token in TOKEN.findall(re.sub(r"\{\w+\}|\[.*?\]", " ", name))}
    for quantity, telling in WORDS.items():
        if words & telling:
            rank = 1 + (words & telling <= _WEAK)
            return _AT_MOTOR.get(quantity, quantity) if words & MOTOR else quantity, rank, None
    return None, 0, None


def _line(name: str, place: _Place, slides: Sequence[bool]) -> str:
    kind, motor, doubts = QUANTITIES[name].kind, QUANTITIES[name].motor, []
    values = place.every
    slide = all(slides) and not motor
    if any(slides) and not all(slides) and kind in ("position", "velocity", "effort"):
        doubts.append("sliding joints need their own unit: [joint.NAME.channels]")
    unit, said = (None, "") if place.meaning is None else (place.meaning.unit, place.meaning.said)
    if unit is None or unit not in units_of(kind, slides=slide):
        unit = _unit_in(place.keys.get("column", ""), kind, slide=slide)
    if place.meaning is not None and place.meaning.doubtful:
        doubts, said = [*doubts, said], ""
    more = ""
    if unit is None:
        unit = units_of(kind, slides=slide)[0]
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
    if kind == "position" and not slide and unit in FACTORS["angle"] and _wraps(place, unit):
        extent += ", told within one turn: full turns are taken out"
    extent = "; ".join(filter(None, (extent, said)))
    return f"{name} = {{ {', '.join(pairs_of(place.keys))}{unit_text}{more} }}{comment_of(doubts, extent)}"


def _unit_in(column: str, kind: str, *, slide: bool) -> str | None:
    """Return the unit that a column's name states, or None."""
    bare = re.sub(r"\{\w+\}", " ", column)
    chunks = [*TOKEN.findall(bare), *re.split(r"[^A-Za-z]+", bare)]  # posDeg, then pos_mNm
    said = [UNITS[chunk.lower()] for chunk in chunks if chunk.lower() in UNITS]
    if kind == "velocity":
        said += [f"{unit}/s" for unit in said if unit != "rpm"]
    allowed = units_of(kind, slides=slide)  # type: ignore[arg-type]
    return next((each for each in reversed(said) if each in allowed), None)


def _wraps(place: _Place, unit: str) -> bool:
    """Return whether some joint's position starts again after a turn."""
    scale = FACTORS["angle"][unit]
    return any(x is not None and unwrapped(scale * x[:, None], [""])[1] for x in place.values)


def _first_values(table: Table, columns: Sequence[str]) -> list[Array | None]:
    """Return the first finite values of each column, None where they cannot be read."""
    places = [_place_in(table, column) for column in columns]
    wanted = tuple(dict.fromkeys(name for name, _ in places))
    if not all(name in table.shapes for name in wanted):
        return [None] * len(columns)
    try:
        block = next(table.blocks(Wanted(wanted, (), 1), lambda _: None), None)
    except BrokenRowsError:
        raise
    except InputError:  # text
        return [None] if len(columns) == 1 else [_first_values(table, [column])[0] for column in columns]
    if block is None:
        return [None] * len(columns)
    found = [np.asarray(block.columns[name], float)[(slice(_ROWS), *index)].ravel() for name, index in places]
    return [values[np.isfinite(values)] for values in found]


def _place_in(table: Table, column: str) -> tuple[str, tuple[int, ...]]:
    if column in table.aliases:
        return table.aliases[column]
    at = (
        None if column in table.shapes else re.fullmatch(r"(.+)\[(\d+)\]", column)
    )  # brackets may hold a unit
    return (column, ()) if at is None else (at[1], (int(at[2]),))


# Bags.


def _in_bag(
    path: Path, joints: Sequence[str]
) -> tuple[dict[str, _Place], list[str], list[str], list[str], list[str]]:
    """Return places by quantity, the lines of [time], unused topics, doubts, and joints that no message names."""
    from mocobot_logs.bag.cdr import JOINT_STATE, type_name  # the import takes a third of a second
    from mocobot_logs.bag.files import BagFiles
    from mocobot_logs.bag.read import Look

    files = BagFiles(path)
    look = Look(str(path), files)
    types = {topic: type_name(told) for topic, told in files.topics.items()}
    named = {topic: set(joints) & set(look.joints(topic)) for topic in types if types[topic] == JOINT_STATE}
    of: dict[str, str] = {}  # the topic of each joint: that with most joints of the model
    for topic in sorted(named, key=lambda topic: -len(named[topic])):
        of = {joint: topic for joint in joints if joint in named[topic]} | of
    known = next((topic for topic in types if types[topic] in TYPES), None)
    doubts: list[str] = []
    if of or known is None:
        places, used = _states(look, joints, of) if of else {}, set(of.values())
    else:
        fields = TYPES[types[known]].items()
        places = {
            quantity: _Place({"topic": known, "field": path}, (), meaning)
            for quantity, (path, meaning) in fields
        }
        order = ", ".join(f"{k} is {joint}" for k, joint in enumerate(joints))
        used, of = {known}, dict.fromkeys(joints, known)
        doubts = [f"messages number the joints; is this their order? {order}"]
    time = [] if all(map(look.is_stamped, used)) else ["[time]", 'clock = "log"  # no header stamps', ""]
    lost = [f"joint {joint}" for joint in joints if joint not in of] if of else []
    return places, time, [topic for topic in types if topic not in used], doubts, lost


def _states(look: Look, joints: Sequence[str], of: Mapping[str, str]) -> dict[str, _Place]:
    """Return the places in joint states; ``of`` is the topic of each joint that has one."""
    best, effort = next(iter(of.values())), effort_meaning(joints)
    meanings = {"position": Meaning("q"), "velocity": Meaning("dq"), "effort": effort}
    places = {}
    for at, meaning in meanings.items():
        found = {
            joint: told
            for topic in dict.fromkeys(of.values())
            for joint, told in look.numbers(topic, [j for j in of if of[j] == topic], at).items()
        }
        places[meaning.quantity or "torque"] = _Place(
            {"topic": best, "joint": "{joint}", "field": at},
            [found[joint][0] for joint in joints if joint in found],
            replace(meaning, unit=meaning.unit or {"position": "rad", "velocity": "rad/s"}[at]),
            {joint: {"topic": topic} for joint, topic in of.items() if topic != best},
            {joint: why for joint, (x, why) in found.items() if not len(x)},
        )
    return places

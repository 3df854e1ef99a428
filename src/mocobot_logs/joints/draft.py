"""Draft the map of a joint log: which column is what of which joint, by names, the units in them, and values."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from estimator.arrays import Array
from mocobot_logs.draft.of_log import opened
from mocobot_logs.draft.robots import Robots
from mocobot_logs.draft.time import time_lines
from mocobot_logs.draft.values import DOUBTFUL, printable
from mocobot_logs.formats import log_kind
from mocobot_logs.joints.quantities import QUANTITIES, Kind, units_of
from mocobot_logs.table.table import Table, Wanted

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
"""Words that tell a quantity, the most telling first."""
_MOTOR = {"motor", "drive", "actuator", "rotor"}
_AT_MOTOR = {
    "q": "motor_position",
    "dq": "motor_velocity",
    "torque": "motor_torque",
    "command": "motor_command",
}
_UNITS = {
    "rad": "rad", "deg": "deg", "degrees": "deg", "turns": "turn", "counts": "counts", "ticks": "counts",
    "rpm": "rpm", "nm": "Nm", "mnm": "mNm", "nmm": "Nmm", "n": "N", "a": "A", "ma": "mA", "m": "m", "mm": "mm",
    "v": "V", "mv": "mV", "volts": "V",
}  # fmt: skip
_SI: dict[Kind, tuple[str, str]] = {
    "position": ("rad", "m"), "velocity": ("rad/s", "m/s"), "effort": ("Nm", "N"), "current": ("A", "A"),
    "duty": ("1", "1"), "voltage": ("V", "V"), "flag": ("1", "1"),
}  # fmt: skip
_TURNS = 4.0 * np.pi
"""Joints that turn farther than that are taken to be logged in degrees [rad]."""
_METRES = 20.0
"""Slides that go farther than that are taken to be logged in millimetres [m]."""
_ROWS = 20_000
_LISTED = 12


@dataclass(frozen=True)
class JointDraft:
    """A draft of a map.

    Attributes:
        text: TOML.
        doubtful: number of lines that need a look.
        missing: what was not found, without which the map is of no use.
    """

    text: str
    doubtful: int
    missing: tuple[str, ...]


@dataclass(frozen=True)
class _Place:
    """Where one quantity of all joints is.

    Attributes:
        keys: ``column``, or ``topic`` and ``field``, with placeholders.
        columns: the columns that it stands for.
    """

    keys: Mapping[str, str]
    columns: tuple[str, ...] = ()


def draft_joint_map(
    path: Path, joints: Sequence[str], slides: Sequence[bool], episode: int | None = None
) -> JointDraft:
    """Draft a map.

    Args:
        path: a log of any format, whatever its names.
        joints: the model's.
        slides: whether each of them slides.
        episode: which episode of a LeRobot dataset; may be None if it holds only one.

    Raises:
        InputError: there is no such log, or it is damaged.
    """
    kind = log_kind(path)
    head = [
        f"# Draft of a map for {printable(str(path))}. Lines that need a look say that they are doubtful;",
        "# docs/serial/guide.md says what may stand here.",
        "version = 1",
        f"joints = {json.dumps(list(joints), ensure_ascii=False)}",
        "",
    ]
    if kind == "bag":
        places, unused = _of_bag(path, joints)
        lines = [_line(name, place, None, slides) for name, place in places.items()]
        return _drafted(head, [], lines, places, unused)
    table, candidates, csv = opened(path, kind, episode)
    time = [*time_lines(table, candidates, Robots((), "")), *csv]
    places, unused = _of_table(table, joints, _time_column(time))
    lines = [_line(name, place, _values(table, place.columns), slides) for name, place in places.items()]
    return _drafted(head, time, lines, places, unused)


def _drafted(
    head: list[str], time: list[str], lines: list[str], places: Mapping[str, _Place], unused: Sequence[str]
) -> JointDraft:
    missing = [] if {"q", "motor_position"} & set(places) else ["a position"]
    if not set(places) - {"q", "motor_position", "dq", "motor_velocity", "supply", "enabled"}:
        missing.append("a torque, a current, a command or a duty")
    tail = []
    if unused:
        more = ", ..." if len(unused) > _LISTED else ""
        tail += ["", f"# not used: {printable(', '.join(unused[:_LISTED]))}{more}"]
    if {"command", "motor_command"} & set(places):
        tail += ["", "[control]", f'command = "position"  # {DOUBTFUL}or velocity, or torque?']
    if {"motor_position", "motor_torque", "current"} & set(places):
        what = "motors are logged; how often does each turn for one turn of its joint?"
        tail += ["", f"# {DOUBTFUL}{what}", "# [drive]", "# gear = [ ... ]"]
    if "current" in places:
        tail += ['# torque_constant = "free"']
    absent = [f"# {DOUBTFUL}nothing was found that is {what}" for what in missing]
    text = "\n".join([*head, *time, "[channels]", *lines, *absent, *tail]) + "\n"
    return JointDraft(text, text.count(DOUBTFUL), tuple(missing))


def _of_table(table: Table, joints: Sequence[str], time: str | None) -> tuple[dict[str, _Place], list[str]]:
    """Places by quantity, and columns that are of no use."""
    names = [name for name in dict.fromkeys([*table.aliases, *table.shapes]) if name != time]
    templates: dict[str, dict[int, str]] = {}
    for name in names:
        shape = table.shapes.get(name, ())
        if len(shape) == 1 and shape[0] == len(joints):
            templates[f"{name}[{{index}}]"] = {j: f"{name}[{j}]" for j in range(len(joints))}
        elif shape in ((), (1,)):
            for template, j in _templates(name, joints):
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


def _templates(name: str, joints: Sequence[str]) -> Iterator[tuple[str, int]]:
    """A name with a placeholder in the place of a joint's name or number, and which joint that is."""
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


def _tokens(name: str) -> list[str]:
    plain = re.sub(r"\{\w+\}|\[.*?\]", " ", name)
    return [token.lower() for token in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", plain)]


def _quantity(name: str) -> str | None:
    """What a name says that it holds."""
    words = set(_tokens(name))
    for quantity, telling in _WORDS.items():
        if words & telling:
            return _AT_MOTOR.get(quantity, quantity) if words & _MOTOR else quantity
    return None


def _line(name: str, place: _Place, values: Array | None, slides: Sequence[bool]) -> str:
    """The line of one channel."""
    kind, doubts = QUANTITIES[name].kind, []
    slide = all(slides) and not QUANTITIES[name].motor
    if any(slides) and not all(slides) and kind in ("position", "velocity", "effort"):
        doubts.append("sliding joints need their own unit: [joint.NAME.channels]")
    chunks = re.split(r"[^a-z]+", re.sub(r"\{\w+\}", " ", place.keys.get("column", "")).lower())
    said = [_UNITS[chunk] for chunk in chunks if chunk in _UNITS]
    if kind == "velocity":
        said += [f"{unit}/s" for unit in said if unit != "rpm"]
    allowed = units_of(kind, slides=slide)
    unit = next((each for each in reversed(said) if each in allowed), None)
    more = ""
    if unit is None:
        unit = _SI[kind][slide]
        doubts.append("unit?" if values is not None else "") if kind not in ("flag",) else None
        largest = 0.0 if values is None or not len(values) else float(np.nanmax(np.abs(values)))
        if kind == "position" and not slide and not QUANTITIES[name].motor and largest > _TURNS:
            unit = "deg"
        if kind == "position" and slide and largest > _METRES:
            unit = "mm"
        if kind == "duty" and largest > 1.0:
            unit, more = "counts", ", full_scale = 1.0"
            if largest > 32767:
                more += ", bits = 16"
            doubts.append("full scale?")
    pairs = [f"{key} = {json.dumps(text, ensure_ascii=False)}" for key, text in place.keys.items()]
    unit_text = "" if kind == "flag" else f', unit = "{unit}"'
    if unit == "counts" and kind == "position":
        more, doubts = ", counts_per_turn = 1.0", [*doubts, "counts per turn?"]
    comment = "; ".join(each for each in doubts if each)
    extent = (
        "" if values is None or not len(values) else f"{np.nanmin(values):.4g} to {np.nanmax(values):.4g}"
    )
    note = f"  # {DOUBTFUL}{comment} ({extent})" if comment else f"  # {extent}" if extent else ""
    return f"{name} = {{ {', '.join(pairs)}{unit_text}{more} }}{printable(note)}"


def _values(table: Table, columns: Sequence[str]) -> Array | None:
    """The first values of some columns, all together."""
    plain = {
        c: c if c in table.shapes else c.partition("[")[0] for c in columns
    }  # a unit may stand in brackets
    places = {c: table.aliases.get(c, (plain[c], None))[0] for c in columns}
    wanted = tuple(dict.fromkeys(places.values()))
    if not all(name in table.shapes for name in wanted):
        return None
    block = next(table.blocks(Wanted(wanted, (), 1), lambda _: None), None)
    if block is None:
        return None
    found = [np.asarray(block.columns[name], dtype=float)[:_ROWS].ravel() for name in wanted]
    values = np.concatenate(found)
    return values[np.isfinite(values)]


def _time_column(lines: Sequence[str]) -> str | None:
    found = [re.fullmatch(r"column = (\".*\")", line) for line in lines]
    return next((json.loads(each[1]) for each in found if each is not None), None)


def _of_bag(path: Path, joints: Sequence[str]) -> tuple[dict[str, _Place], list[str]]:
    """The topic of joint states that has the model's joints."""
    from mocobot_logs.bag.look import Look
    from mocobot_logs.bag.storage.files import BagFiles
    from mocobot_logs.bag.types import JOINT_STATE, type_name

    files = BagFiles(path)
    look = Look(str(path), files)
    topics = [topic for topic, told in files.topics.items() if type_name(told) == JOINT_STATE]
    best = max(topics, key=lambda topic: len(set(joints) & set(look.joints(topic))), default=None)
    if best is None:
        return {}, list(files.topics)
    fields = {"q": "position", "dq": "velocity", "torque": "effort"}
    places = {
        name: _Place({"topic": best, "joint": "{joint}", "field": field}) for name, field in fields.items()
    }
    return places, [topic for topic in files.topics if topic != best]

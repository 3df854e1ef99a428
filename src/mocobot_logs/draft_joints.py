"""Draft the map of one robot's joint log: what is there, for which joints, and what is not."""

from __future__ import annotations

import json
import re
import shlex
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
from mocobot_logs.draft_drives import (
    Place,
    follow,
    gain_lines,
    lerobot_places,
    motors_of,
    numbered,
    zero_lines,
)
from mocobot_logs.draft_names import TOKEN, Robots
from mocobot_logs.formats import Kind, log_kind
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
from mocobot_logs.presets import (
    JOINT_WORDS,
    MESSAGES,
    UNITS,
    Meaning,
    Message,
    column_meaning,
    effort_meaning,
)
from mocobot_logs.table.table import Block, Table, Wanted
from mocobot_logs.table.text import BrokenRowsError
from mocobot_logs.units import COUNTS, FACTORS, TIME_UNITS

if TYPE_CHECKING:
    from mocobot_logs.bag.read import Clock, Look

MOTOR = {"motor", "drive", "actuator", "rotor"}
_AT_MOTOR = {
    "q": "motor_position",
    "dq": "motor_velocity",
    "torque": "motor_torque",
    "command": "motor_command",
}
GAINS = ("position_gain", "velocity_gain")  # keys of [control] that columns may tell
_TURNS = 4.0 * np.pi  # largest range of a turning joint in radians; a larger one counts as degrees
_METRES = 20.0  # largest range of a sliding joint in metres; a larger one counts as millimetres
_NO_POSITION = 1e6  # positions beyond it are none: Unitree's PosStopF is 2.146e9
_ROWS = 20_000


_ADDED = ("command_velocity", "feedforward")  # quantities of no use if they are zero throughout
_WEAK = {"joint", "state"}  # words that identify a quantity only if no other column does


def draft_joint_map(
    path: Path,
    joints: Sequence[str],
    slides: Sequence[bool],
    episode: int | None = None,
    rest: Sequence[float] | None = None,
) -> Draft:
    """Draft the map of a log of one robot's joints.

    Args:
        path: a log of any format, with any names.
        joints, slides: names of the model's joints, and whether each slides.
        episode: episode of a LeRobot dataset; may be None if it holds only one.
        rest: position at which each joint may be locked [rad or m]; None: zeros.
    """
    head = [*head_lines(path, "docs/serial/guide.md says what may stand here."), "version = 1"]
    kind = log_kind(path)
    if kind == "bag":
        found, where = _in_bag(path, joints), "message"
    else:
        found, where = _in_columns(path, kind, joints, episode), "column"
    lost = [f"joint {joint}" for joint in found.lost]
    slides = [slide for joint, slide in zip(joints, slides, strict=True) if joint in found.joints]
    doubts = [*found.doubts, *(f"{joint} is in no {where}" for joint in lost)]
    if lost and found.joints:
        at = dict(zip(joints, rest or [0.0] * len(joints), strict=True))
        locks = " ".join(f"--lock {shlex.quote(f'{joint}={at[joint]:.4g}')}" for joint in found.lost)
        doubts.append(f"joints that do not move are locked where they are: {locks}")
    lines, missing = _sections(found, slides, doubts)
    head += [f"joints = {json.dumps(list(found.joints), ensure_ascii=False)}", ""]
    text = "\n".join([*head, *found.time, "[channels]", *lines, *unused_lines(found.unused)]) + "\n"
    return Draft(text, text.count(DOUBTFUL), (*missing, *lost))


@dataclass(eq=False)
class _Found:
    """What a log holds of a robot."""

    joints: Sequence[str]  # joints of the model that it holds, in its order
    lost: Sequence[str]  # joints of the model that it does not hold
    places: dict[str, Place]  # places by quantity
    time: list[str]  # lines of [time] and [csv]
    unused: list[str]  # names of what is not used
    doubts: list[str]  # what the user must check
    # gains of all rows by key of [control], shape (q, J) each
    gains: dict[str, Array] = field(default_factory=dict)
    gain_of: str = "torque"  # what the gains make
    known: bool = False  # whether the command is known to be a position
    free: bool = False  # whether zeros and signs are the user's choice
    spare: dict[str, Place] = field(default_factory=dict)  # places that the map may hold instead, by quantity


def _in_columns(path: Path, kind: Kind, joints: Sequence[str], episode: int | None) -> _Found:
    table, candidates, csv = opened_table(path, kind, episode)
    time = [*time_lines(table, candidates, Robots((), "")), *csv]
    clock = tomllib.loads("\n".join(time)).get("time", {})
    lacking = _unlogged(table, joints)
    joints = [joint for joint in joints if joint not in lacking]
    motors = motors_of(joints)
    if motors and any(re.search(r"motor_(state|cmd)", name) for name in table.shapes):
        joints = sorted(joints, key=lambda joint: motors[joint])
    places, unused = in_table(table, joints, {clock.get("column"), clock.get("nanosec")})
    found = _Found(joints, lacking, places, time, unused, [])
    for name in GAINS:
        if name in places:
            gain = places.pop(name)
            found.gains[name] = _rows(table, _columns(gain, joints), clock)[1]
            found.gain_of = "firmware" if "p_gain" in gain.keys["column"].lower() else "torque"
    q, command = places.get("q"), places.get("command")
    if q is not None and command is not None and "column" in clock:
        at, rows = _rows(table, _columns(q, joints), clock)
        tried = [
            (follow(at, rows, *_rows(table, _columns(c, joints), clock)), c)
            for c in (command, *command.others)
        ]
        if any(each for each, _ in tried):
            best, chosen = min(((each, c) for each, c in tried if each), key=lambda pair: pair[0].left)
            places["command"] = best.of(chosen, joints)
    found.known = command is not None and command.meaning is not None
    if kind == "lerobot" and q is not None and all(x is not None for x in q.values):
        columns = _columns(q, joints)
        where = {place: name for name, place in table.aliases.items()}
        named = [where.get(_place_in(table, column), column) for column in columns]
        names = [name.removeprefix("observation.state.").removesuffix(".pos") for name in named]
        found.places, doubts = lerobot_places(path, places, joints, names)
        found.doubts += doubts
        found.known = True
        if found.places != places:
            found.gain_of, found.free = "duty", True
    found.free |= any(place.meaning is not None and place.meaning.whole for place in (q, command) if place)
    return found


def _columns(place: Place, joints: Sequence[str]) -> list[str]:
    told = [{"{joint}": joint, "{number}": f"{k + 1}", "{index}": f"{k}"} for k, joint in enumerate(joints)]
    return [re.sub(r"\{\w+\}", lambda at, own=own: own[at[0]], place.keys["column"]) for own in told]


def _rows(table: Table, columns: Sequence[str], clock: Mapping[str, str]) -> tuple[Array, Array]:
    """Return times after the first row [s], shape (q,), and the first rows of columns, NaN where there is no value."""
    places = [_place_in(table, column) for column in columns]
    below = [clock["nanosec"]] if "nanosec" in clock else []
    names = tuple(dict.fromkeys([*(name for name, _ in places), *below]))
    wanted = Wanted(names, (clock["column"],), TIME_UNITS.get(clock["unit"]))
    try:
        block = next(table.blocks(wanted, lambda _: None), None)
    except InputError:  # text
        block = None
    if block is None:
        return np.empty(0), np.empty((0, len(columns)))
    ns = block.clocks[clock["column"]][0][:_ROWS]
    time: Array = 1e-9 * (ns - ns[:1]).astype(np.float64)
    for name in below:
        time = time + 1e-9 * np.asarray(block.columns[name], float).ravel()[:_ROWS]
    return time, np.column_stack([_numbers(block, *place) for place in places])


def _unlogged(table: Table, joints: Sequence[str]) -> list[str]:
    """Return the joints that no column names, if columns name others; empty if columns name none."""
    names = [*table.aliases, *table.shapes]
    lost = [joint for joint in joints if not any(_named(joint, name) for name in names)]
    return lost if len(lost) < len(joints) else []


def _sections(found: _Found, slides: Sequence[bool], doubts: list[str]) -> tuple[list[str], list[str]]:
    """Return the lines from [channels] on, and what is missing; ``doubts`` are further doubts."""
    places: Mapping[str, Place] = found.places
    absent = {
        name: place
        for name, place in places.items()
        if place.every is not None and not (place.every.any() if name in _ADDED else len(place.every))
    }
    places = {name: place for name, place in places.items() if name not in absent}
    # One torque, velocity, command and duty of a joint are used.
    others = {
        name
        for group in (EFFORTS, VELOCITIES, COMMANDS, DUTIES)
        for name in [each for each in group if each in places][1:]
    }
    spare = [f"# or {_line(name, places[name], slides)}" for name in places if name in others]
    spare += [f"# or {_line(name, place, slides)}" for name, place in found.spare.items()]
    places = {name: place for name, place in places.items() if name not in others}
    missing = [] if set(POSITIONS) & set(places) else ["a position"]
    if not {*EFFORTS, *COMMANDS, *DUTIES} & set(places):
        missing.append("a torque, a current, a command or a duty")
    lines = [*(_line(name, place, slides) for name, place in places.items()), *spare]
    for name, place in absent.items():
        empty = "it is zero throughout" if name in _ADDED else "its columns have no value"
        reasons = "; ".join(dict.fromkeys(place.lacks.values())) or empty
        lines.append(f"# no {name}: {printable(reasons)}")
    for name in set(POSITIONS) & set(places):
        doubts += [f"{name} of {joint}: {why}" for joint, why in places[name].lacks.items()]
        places[name] = replace(places[name], lacks={})
    lines += [f"# {DOUBTFUL}nothing was found that is {what}" for what in missing]
    lines += [f"# {DOUBTFUL}{printable(doubt)}" for doubt in doubts]
    tail = _own_lines(places)
    if {*COMMANDS} & set(places):
        doubt = "" if found.known else f"  # {DOUBTFUL}or velocity, or torque?"
        tail += ["", "[control]", f'command = "position"{doubt}']
        if found.gains:
            tail += [f'gain_of = "{found.gain_of}"', *gain_lines(found.gains, found.joints)]
        elif not {*EFFORTS, *DUTIES} & set(places):
            what = (
                'no torque is logged; which gains has the loop, of torque or of duty? unknown ones are "free"'
            )
            tail += [
                f"# {DOUBTFUL}{what}",
                f'gain_of = "{found.gain_of}"',
                *(f'{name} = "free"' for name in GAINS),
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
    if found.free:
        tail += [*([] if "[drive]" in tail else ["", "[drive]"]), *zero_lines()]
    return [*lines, *tail], missing


def _own_lines(places: Mapping[str, Place]) -> list[str]:
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
) -> tuple[dict[str, Place], list[str]]:
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
        if quantity in GAINS and not shared:
            found.setdefault(quantity, []).append((rank, template, None))
        elif quantity in QUANTITIES and QUANTITIES[quantity].shared == (
            shared or (quantity in ("supply", "enabled") and "{" not in template)
        ):
            found.setdefault(quantity, []).append((rank, template, meaning))

    def placed(quantity: str, template: str, meaning: Meaning | None) -> Place:
        columns = [templates[template][j] for j in sorted(templates[template])]
        values = _first_values(table, columns)
        alone = quantity in QUANTITIES and QUANTITIES[quantity].shared
        lacks = {
            joint: f"{column} has no value"
            for joint, column, x in zip(joints, columns, values, strict=False)
            if x is not None and not len(x) and not alone
        }
        whole = all(x is not None and bool((x == np.rint(x)).all()) for x in values)
        meaning = None if meaning and meaning.whole and not whole else meaning
        return Place({"column": template}, values, meaning, lacks=lacks)

    places = {}
    for quantity, each in found.items():
        first, *others = sorted(each, key=lambda told: told[0])
        more = [placed(quantity, *told[1:]) for told in others] if quantity == "command" else []
        places[quantity] = replace(placed(quantity, *first[1:]), others=tuple(more))
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
    for quantity, telling in JOINT_WORDS.items():
        if words & telling:
            rank = 1 + (words & telling <= _WEAK)
            return _AT_MOTOR.get(quantity, quantity) if words & MOTOR else quantity, rank, None
    return None, 0, None


def _line(name: str, place: Place, slides: Sequence[bool]) -> str:
    kind, motor, doubts = QUANTITIES[name].kind, QUANTITIES[name].motor, [*place.doubts]
    values = place.every
    slide = all(slides) and not motor
    if any(slides) and not all(slides) and kind in ("position", "velocity", "effort"):
        doubts.append("sliding joints need their own unit: [joint.NAME.channels]")
    unit, said = (None, "") if place.meaning is None else (place.meaning.unit, place.meaning.said)
    if unit is None or unit not in units_of(kind, slides=slide):
        unit = _unit_in(place.keys.get("column", ""), kind, slide=slide)
    if place.meaning is not None and place.meaning.doubtful:
        doubts, said = [*doubts, said], ""
    more = f", {place.meaning.more}" if place.meaning is not None and place.meaning.more else ""
    largest = 0.0 if values is None or not len(values) else float(np.nanmax(np.abs(values)))
    bits = ", bits = 16" if kind == "duty" and largest > 32767 else ""
    if unit is None:
        unit = units_of(kind, slides=slide)[0]
        if values is not None and kind != "flag":
            doubts.append("unit?")
        if kind == "position" and not slide and not motor and largest > _TURNS:
            unit = "deg"
        if kind == "position" and slide and largest > _METRES:
            unit = "mm"
        if kind == "duty" and largest > 1.0:
            unit, more = COUNTS, ", full_scale = 1.0"
            doubts.append("full scale?")
    if unit == COUNTS and kind == "position" and not more:
        more, doubts = ", counts_per_turn = 1.0", [*doubts, "counts per turn?"]
    unit_text = "" if kind == "flag" else f', unit = "{unit}"'
    extent = "" if values is None or not len(values) else f"{np.min(values):.4g} to {np.max(values):.4g}"
    if kind == "position" and not slide and unit in FACTORS["angle"] and _wraps(place, unit):
        extent += ", told within one turn: full turns are taken out"
    extent = "; ".join(filter(None, (extent, said)))
    return (
        f"{name} = {{ {', '.join(pairs_of(place.keys))}{unit_text}{more}{bits} }}{comment_of(doubts, extent)}"
    )


def _unit_in(column: str, kind: str, *, slide: bool) -> str | None:
    """Return the unit that a column's name states, or None."""
    bare = re.sub(r"\{\w+\}", " ", column)
    chunks = [*TOKEN.findall(bare), *re.split(r"[^A-Za-z]+", bare)]  # posDeg, then pos_mNm
    said = [UNITS[chunk.lower()] for chunk in chunks if chunk.lower() in UNITS]
    if kind == "velocity":
        said += [f"{unit}/s" for unit in said if unit != "rpm"]
    allowed = units_of(kind, slides=slide)  # type: ignore[arg-type]
    return next((each for each in reversed(said) if each in allowed), None)


def _wraps(place: Place, unit: str) -> bool:
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
    found = [_numbers(block, *place) for place in places]
    return [values[np.isfinite(values)] for values in found]


def _numbers(block: Block, name: str, index: tuple[int, ...]) -> Array:
    return np.asarray(block.columns[name], float)[(slice(_ROWS), *index)].ravel()


def _place_in(table: Table, column: str) -> tuple[str, tuple[int, ...]]:
    if column in table.aliases:
        return table.aliases[column]
    at = (
        None if column in table.shapes else re.fullmatch(r"(.+)\[(\d+)\]", column)
    )  # brackets may hold a unit
    return (column, ()) if at is None else (at[1], (int(at[2]),))


# Bags.


def _in_bag(path: Path, joints: Sequence[str]) -> _Found:
    from mocobot_logs.bag.read import Look  # the import takes a third of a second

    look = Look(path)
    types = look.types
    named = {topic: set(joints) & set(look.joints(topic)) for topic in types}
    of: dict[str, str] = {}  # the topic of each joint: that with most joints of the model
    for topic in sorted(named, key=lambda topic: -len(named[topic])):
        of = {joint: topic for joint in joints if joint in named[topic]} | of
    listed = {topic: MESSAGES[kind] for topic, kind in types.items() if kind in MESSAGES}
    orders = {topic: _index(look, topic, told, joints) for topic, told in listed.items() if told.commands}
    order = max(orders, key=lambda topic: len(orders[topic]), default=None)
    at, seat = orders[order] if order is not None else {}, dict[str, int]()
    known = None if of else next((topic for topic, told in listed.items() if not told.commands), None)
    if known is not None:
        seat = _seats(joints)
    elif not of and order is not None and listed[order].named:
        known = order
    has = [joint for joint in joints if joint in (of or (at if known == order and order else joints))]
    has.sort(key=lambda joint: (seat or at).get(joint, len(joints)))
    used = {*of.values(), *filter(None, (known, order))}
    clock: Clock = "header" if all(map(look.is_stamped, used)) else "log"
    time = [] if clock == "header" else ["[time]", 'clock = "log"  # no header stamps', ""]
    lost = [joint for joint in joints if joint not in has]
    found = _Found(has, lost, {}, time, [topic for topic in types if topic not in used], [])
    if of:
        found.places = _states(look, has, {joint: of[joint] for joint in of if joint in has})
    elif known is not None and known != order:
        for quantity, meaning in listed[known].fields.items():
            found.places[quantity] = replace(numbered(known, meaning.paths[0], seat, has), meaning=meaning)
        if motors_of(joints) is None or "unitree" not in types[known]:
            numbers = ", ".join(f"{seat[joint]} is {joint}" for joint in has)
            found.doubts.append(f"messages number the joints; is this their order? {numbers}")
    if order is not None and at:
        _order(found, look, order, listed[order], at, clock)
    return found


def _seats(joints: Sequence[str]) -> dict[str, int]:
    """Return the place of each joint in messages that number them; those of the model if nobody knows."""
    return motors_of(joints) or {joint: k for k, joint in enumerate(joints)}


def _index(look: Look, topic: str, told: Message, joints: Sequence[str]) -> dict[str, int]:
    """Return the index of each joint in messages that tell the robot what to do; empty if they name none."""
    names = look.joint_names(topic) if told.named else ()
    return {joint: names.index(joint) for joint in joints if joint in names} if names else _seats(joints)


def _order(
    found: _Found, look: Look, topic: str, message: Message, at: Mapping[str, int], clock: Clock
) -> None:
    """Add what a topic of commands holds, and how the positions follow."""
    there = look.fields(topic)
    fields = {
        name: (next((p for p in field.paths if p.partition(".")[0] in there), field.paths[0]), field)
        for name, field in message.fields.items()
    }
    told = [joint for joint in found.joints if joint in at]
    paths = [path.replace("{index}", str(at[joint])) for path, _ in fields.values() for joint in told]
    stamps, values = look.series(topic, [(path, None) for path in paths], clock)
    columns = [found.joints.index(joint) for joint in told]
    if not message.named and "current" in found.places:
        said = 'instead of torques by the gains, with [drive] torque_constant = "free"'
        found.spare["current"] = found.places.pop("current").told(said)
    rows: dict[str, Array] = {}
    for k, (name, (path, meaning)) in enumerate(fields.items()):
        rows[name] = np.full((len(stamps), len(found.joints)), np.nan)
        rows[name][:, columns] = values[:, k * len(told) : (k + 1) * len(told)]
        if name in GAINS:
            found.gains[name] = rows[name]
        elif name not in found.places:
            x = [column[np.isfinite(column)] for column in rows[name].T]
            lacks = {joint: f"{topic} does not name it" for joint in found.joints if joint not in at}
            place = numbered(topic, path, at, found.joints)
            found.places[name] = replace(place, values=x, meaning=meaning, lacks=lacks)
    found.known = True
    if np.nanmax(np.abs(rows["command"]), initial=0.0) > _NO_POSITION:
        said = "2.146e9 says that no position is commanded: cut the log to where positions are"
        found.places["command"] = found.places["command"].told("", said)
    keys = [{**found.places["q"].keys, **found.places["q"].own.get(joint, {})} for joint in told]
    if len({each["topic"] for each in keys}) == 1:
        index = {joint: f"{k}" for k, joint in enumerate(found.joints)}
        places = [
            (each["field"].replace("{index}", index[joint]), joint if "joint" in each else None)
            for each, joint in zip(keys, told, strict=True)
        ]
        when, seen = look.series(keys[0]["topic"], places, clock)
        at_s, told_s = (1e-9 * (ns - when[:1]).astype(np.float64) for ns in (when, stamps))
        follows = follow(at_s, seen, told_s, rows["command"][:, columns])
        if follows is not None:
            found.places["command"] = follows.of(found.places["command"], told)


def _states(look: Look, joints: Sequence[str], of: Mapping[str, str]) -> dict[str, Place]:
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
        places[meaning.quantity or "torque"] = Place(
            {"topic": best, "joint": "{joint}", "field": at},
            [found[joint][0] for joint in joints if joint in found],
            replace(meaning, unit=meaning.unit or {"position": "rad", "velocity": "rad/s"}[at]),
            {joint: {"topic": topic} for joint, topic in of.items() if topic != best},
            {joint: why for joint, (x, why) in found.items() if not len(x)},
        )
    return places

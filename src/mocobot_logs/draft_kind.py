"""Draft the map of a log of unknown kind: of a team if the log has a team's channels, else of one robot's joints."""

import re
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

from mocobot_logs.draft import DOUBTFUL, Draft, draft_of, opened_table
from mocobot_logs.draft_joints import MOTOR, draft_joint_map, in_table, quantity_in
from mocobot_logs.draft_names import TOKEN
from mocobot_logs.formats import log_kind
from mocobot_logs.joints.joint_map import COMMANDS, DUTIES, EFFORTS, POSITIONS
from mocobot_logs.presets import JOINT_WORDS, MESSAGES, UNITS
from mocobot_logs.table.table import Table

_MEASURED = {"act", "actual", "feedback", "meas", "measured", "present"}
_NO_NAMES = set.union(*JOINT_WORDS.values()) | MOTOR | _MEASURED | set(UNITS)
"""Words of a column's name that are not part of the joint's name."""
_JOINT = {"joint", "axis"}
"""Words that belong to a joint's name if they stand beside it, as in ``joint_1`` and ``elbow_joint``."""
_WITHIN = _JOINT | MOTOR  # words that may stand inside a joint's name, as in ``arm_joint_1``


def draft_any(path: Path, episode: int | None = None) -> tuple[Draft, int | None]:
    """Draft the map of a log, of a team or of one robot's joints; return their number, too, None for a team."""
    team = draft_of(path, episode)
    if not team.missing:
        return team, None
    kind = log_kind(path)
    named = False
    if kind == "bag":
        joints, named = _joints_of_bag(path)
    else:
        joints = _joints_of_table(opened_table(path, kind, episode)[0])
    if not joints:
        return team, None
    drafted = draft_joint_map(path, joints, [False] * len(joints), episode)
    if not named:
        said = f"# {DOUBTFUL}named after the log; the model's names must stand here, and --model ROBOT fills them in"
        text = drafted.text.replace("\njoints = ", f"\n{said}\njoints = ", 1)
        drafted = replace(drafted, text=text, doubtful=drafted.doubtful + 1)
    return drafted, len(joints)


def _joints_of_bag(path: Path) -> tuple[list[str], bool]:
    """Return the joints of the largest joint state, else those of a Franka, and whether messages name them."""
    from mocobot_logs.bag.read import Look  # the import takes a third of a second

    look = Look(path)
    told = max((list(look.joints(topic)) for topic in look.types), key=len, default=[])
    known = [MESSAGES[kind].joints for kind in look.types.values() if kind in MESSAGES]
    return (told, True) if told else (_numbered(max(known, default=0)), False)


def _joints_of_table(table: Table) -> list[str]:
    """Return the joints that have a position and a torque, current, command or duty; empty if there are none."""
    scalar = [n for n in [*table.aliases, *table.shapes] if table.shapes.get(n, ()) in ((), (1,))]
    names = [name for name in dict.fromkeys(scalar) if quantity_in(name)[0]]
    telling = [{token[0].lower() for _, token in _left(name)} for name in names]
    shared = set.intersection(*telling) if names[1:] else set()
    quantities: dict[str, set[str]] = {}
    for name in names:
        if (joint := _joint_in(name, shared)) is not None:
            quantities.setdefault(joint, set()).add(quantity_in(name)[0] or "")
    named = [joint for joint, known in quantities.items() if _is_driven(known)]
    if all(map(str.isdigit, named)):
        named = _numbered(len(named))
    for each in (named, *_joints_of_arrays(table), ["joint_1"]):
        if each and _is_driven(set(in_table(table, each, {table.time_column})[0])):
            return each
    return []


def _joints_of_arrays(table: Table) -> Iterator[list[str]]:
    for name, shape in table.shapes.items():
        if len(shape) == 1 and shape[0] > 1 and quantity_in(name)[0] in POSITIONS:
            yield _numbered(shape[0])


def _numbered(joints: int) -> list[str]:
    return [f"joint_{k + 1}" for k in range(joints)]


def _is_driven(quantities: set[str]) -> bool:
    return bool(quantities & {*POSITIONS} and quantities & {*EFFORTS, *COMMANDS, *DUTIES})


def _left(name: str) -> list[tuple[int, re.Match[str]]]:
    """Return those tokens of a column's name, with their numbers, that may be of the joint's name."""
    plain = re.sub(r"\[.*?\]|\(.*?\)", lambda found: " " * len(found[0]), name)
    return [(k, t) for k, t in enumerate(TOKEN.finditer(plain)) if t[0].lower() not in _NO_NAMES]


def _joint_in(name: str, shared: Collection[str]) -> str | None:
    """Return the part of a column's name that names a joint or its number; ``shared`` words are in all columns."""
    tokens = list(TOKEN.finditer(name))
    left = [k for k, token in _left(name) if token[0].lower() not in shared]
    if not left:
        return None
    first, last = left[0], left[-1]
    if {tokens[k][0].lower() for k in range(first, last) if k not in left} - _WITHIN:
        return None
    while first and tokens[first - 1][0].lower() in _JOINT:
        first -= 1
    while last + 1 < len(tokens) and tokens[last + 1][0].lower() in _JOINT:
        last += 1
    return name[tokens[first].start() : tokens[last].end()]

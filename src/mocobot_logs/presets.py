"""What names in logs mean, read from ``names.toml``: words, well-known columns, and message types of robots."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources

import msgspec


@dataclass(frozen=True)
class Meaning:
    quantity: str | None = None  # quantity of a map, or None for what is no measurement of a joint
    unit: str | None = None  # unit of a map, or None if the name does not tell
    said: str = ""  # comment for the map
    doubtful: bool = False  # whether the user must check it
    more: str = ""  # further keys of the map
    whole: bool = False  # whether it holds for whole numbers alone


@dataclass(frozen=True, kw_only=True)
class FieldMeaning(Meaning):
    paths: list[str]  # paths of the field with ``{index}`` for the joint, the newest first


@dataclass(frozen=True)
class Message:
    """What the messages of some types hold of every joint."""

    types: list[str]
    fields: dict[str, FieldMeaning]  # by quantity
    joints: int = 0  # number of the robot's joints, 0 if the type does not tell
    commands: bool = False  # whether they tell the robot what to do
    named: bool = False  # whether they hold ``joint_names``; else joints are numbered


@dataclass(frozen=True)
class _Names:
    units: dict[str, list[str]]
    team: dict[str, set[str]]
    joints: dict[str, set[str]]
    columns: dict[str, Meaning]
    efforts: dict[str, Meaning]
    messages: list[Message]
    motors: dict[str, list[str]]


_FILE = resources.files("mocobot_logs") / "names.toml"
_NAMES = msgspec.toml.decode(_FILE.read_text(encoding="utf-8"), type=_Names)
UNITS = {word: unit for unit, words in _NAMES.units.items() for word in words}
"""Units of maps by the words in names."""
TEAM_WORDS = _NAMES.team  # words in the names of a team's channels
JOINT_WORDS = _NAMES.joints  # words that identify a quantity of a joint, most specific first
MESSAGES = {name: message for message in _NAMES.messages for name in message.types}
"""Message types that are no joint states, by name."""
MOTORS = _NAMES.motors.values()  # joints in the order of the motors in a Unitree's messages


def column_meaning(name: str) -> Meaning | None:
    """Return the meaning of a column's name with placeholders, None if no well-known robot has such a name."""
    words = re.sub(r"[^a-z0-9]+", "_", re.sub(r"\{\w+\}", "_", name).lower()).strip("_")
    every = _NAMES.columns.items()
    return next((told for pattern, told in every if re.search(rf"(?:^|_)(?:{pattern})$", words)), None)


def effort_meaning(joints: Sequence[str]) -> Meaning:
    """Return what ``effort`` is in the joint states of a robot whose joints have these names."""
    for pattern, told in _NAMES.efforts.items():
        if any(re.search(pattern, joint) for joint in joints):
            return told
    return Meaning("torque", "Nm")

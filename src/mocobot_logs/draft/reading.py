"""What a column's name, or that of a number in a message, says: quantity, joint or axis, unit, and what is left."""

import re
from dataclasses import dataclass

JOINED = "\x1f"
"""Stands between topic, joint and field where these are read as one name."""
INDEX = {"z": 2, "y": 1, "x": 0, "yaw": 2, "pitch": 1, "roll": 0}
_TURNS = ("yaw", "pitch", "roll")
_COMMAND = {"ref", "reference", "cmd", "command", "commanded", "setpoint", "desired", "target", "goal"}
_TORQUE = {"tau", "torque", "trq", "tq", "moment"}
_EFFORT = {"effort", "eff"}
_FORCE = {"force", "f", "frc"}
_GIMBAL = {"theta", "gimbal", "th"}
_DRIVEN = {"phi", "q", "joint", "motor", "driven", "leg", "sea", "actuator"}
_WRIST = {"h", "wrist", "hand"}
_PLACE = {"pos", "position", "p", "point", "angle"}
_OTHER = {
    "velocity", "vel", "dq", "qd", "speed", "rate", "current", "temp", "temperature", "voltage", "acc", "imu", "status"
}  # fmt: skip
_TIME = {"time", "t", "stamp", "timestamp", "clock", "ts", "epoch"}
_WORDS = _COMMAND | _TORQUE | _EFFORT | _FORCE | _GIMBAL | _DRIVEN | _WRIST | _PLACE
_UNITS = {
    "rad": "rad", "rads": "rad", "radian": "rad", "radians": "rad",
    "deg": "deg", "degs": "deg", "degree": "deg", "degrees": "deg", "°": "deg",
    "count": "counts", "counts": "counts", "cnt": "counts", "cnts": "counts", "ticks": "counts",
    "nm": "Nm", "mnm": "mNm", "n": "N", "mn": "mN", "m": "m", "mm": "mm",
    "s": "s", "sec": "s", "secs": "s", "seconds": "s", "ms": "ms", "msec": "ms", "us": "us", "usec": "us",
    "µs": "us", "ns": "ns", "nsec": "ns",
}  # fmt: skip
_UNIT = re.compile(r"(?:\s*[\[(]\s*([^\[\]()]{1,12}?)\s*[\])]|[_.\s/-]([A-Za-z°µ]{1,7}))\s*$")
_TOKEN = re.compile(r"[A-Z]?[a-z°µ]+|[A-Z]+(?![a-z])|\d+")
_GLUED = re.compile(r"(f|h|force|theta|ref|gimbal|cmd|pos|p)([xyz])")


@dataclass(frozen=True)
class Reading:
    """What a name says.

    Attributes:
        group: "phi", "tau", "theta", "h", "force", "ref" or "time".
        index: joint as the name counts it, or axis (x 0, y 1, z 2), or None for time.
        axis: whether ``index`` is an axis.
        unit: as a map calls it, or None where the name does not say.
        rest: spans of the name's tokens that say neither, one of which may tell the robot.
        doubt: what is not sure about it, or None.
    """

    group: str
    index: int | None
    axis: bool
    unit: str | None
    rest: tuple[tuple[int, int], ...]
    doubt: str | None = None


def read_name(name: str, *, element: bool = False) -> Reading | None:
    """What a name says, None if it is of no use.

    Args:
        name: the name.
        element: whether it ends in the index of an element of an array.
    """
    unit, end = _unit(name)
    for told, stop in dict.fromkeys([(unit, end), (None, len(name))]):
        found = _read(name, _tokens(name, stop), told, element=element)
        if found is not None and (told is None or _suits(told, found.group)):
            return found
    return None


def _unit(name: str) -> tuple[str | None, int]:
    """The unit that a name ends in, and where the rest ends."""
    found = _UNIT.search(name)
    if found is None:
        return None, len(name)
    text = re.sub(r"[\s*·.]", "", found[1] or found[2])
    unit = _UNITS.get(text.lower()) if text.lower() != "mn" or text == "mN" else None
    return (unit, found.start()) if unit else (None, len(name))


def _suits(unit: str, group: str) -> bool:
    allowed = {
        "phi": ("rad", "deg", "counts"), "theta": ("rad", "deg", "counts"), "tau": ("Nm", "mNm"),
        "h": ("m", "mm"), "ref": ("m", "mm"), "force": ("N", "mN"), "time": ("s", "ms", "us", "ns"),
    }  # fmt: skip
    return unit in allowed[group]


def _tokens(name: str, stop: int) -> list[tuple[str, int, int]]:
    tokens = []
    for found in _TOKEN.finditer(name, 0, stop):
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
    """Spans of what is left; a robot may be called like a quantity, so only whole words of it are taken out."""
    return tuple((a, b) for k, (text, a, b) in enumerate(tokens) if k != at and text not in used)

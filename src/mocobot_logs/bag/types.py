"""Message types of a bag: from their definitions to typed fields, and dotted paths through them."""

import re
from dataclasses import dataclass
from functools import cache

from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc, Typesdict
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.msg import normalize_msgtype

from estimator.errors import InputError
from mocobot_logs.bag.messages import Topic, printable

JOINT_STATE = "sensor_msgs/msg/JointState"
STRING = "std_msgs/msg/String"
SIZES = {
    "bool": 1, "byte": 1, "char": 1, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4,
    "int64": 8, "uint64": 8, "float32": 4, "float64": 8,
}  # fmt: skip
"""Numbers of a message and their sizes [bytes]."""
_TIME = "builtin_interfaces/msg/Time"
_DEEPEST = 32
_IDL = "=" * 80 + "\n"
_EMPTY: list[tuple[str, FieldDesc]] = [("structure_needs_at_least_one_member", (Nodetype.BASE, ("uint8", 0)))]


@dataclass(frozen=True, eq=False)
class MessageType:
    """A message type with all that it is made of.

    Attributes:
        name: such as ``sensor_msgs/msg/JointState``.
        types: fields of this and of every type inside it.
        where: what messages call it: the bag and the topic.
    """

    name: str
    types: Typesdict
    where: str

    def fields(self, name: str) -> list[tuple[str, FieldDesc]]:
        """Names and types of a type's fields; one byte where it has none, as ROS 2 does.

        Raises:
            InputError: the bag does not define the type, and no ROS 2 distribution does.
        """
        if name not in self.types and name not in _known():
            raise InputError(
                f"{self.where}: its messages hold the type {printable(name)}, which the bag does not define"
            )
        return (self.types[name] if name in self.types else _known()[name])[1] or _EMPTY

    def require(self, path: str) -> None:
        """Check that a dotted path leads to a number, such as ``point.x`` or ``data[2]``.

        Raises:
            InputError: it does not.
        """
        here, walked = self.name, ""
        parts = path.split(".")
        for number, part in enumerate(parts):
            found = re.fullmatch(r"(\w+)(?:\[(\d{1,6})\])?", part)
            fields = dict(self.fields(here))
            if found is None or found[1] not in fields:
                names = ", ".join(map(printable, list(fields)[:20]))
                at = f"{walked} " if walked else ""
                raise InputError(
                    f"{self.where}: {at}has no field {part!r:.60}; the fields of {here} are {names}"
                )
            walked = f"{walked}.{part}" if walked else part
            kind, detail = fields[found[1]]
            is_array = kind in (Nodetype.ARRAY, Nodetype.SEQUENCE)
            if is_array != (found[2] is not None):
                hint = f"is an array; name one element, such as {part}[0]" if is_array else "is not an array"
                raise InputError(f"{self.where}: field {walked!r:.80} {hint}")
            if is_array:
                kind, detail = detail[0]  # type: ignore[misc]
            if kind == Nodetype.NAME:
                here = str(detail)
                if number == len(parts) - 1:
                    raise InputError(
                        f"{self.where}: field {walked!r:.80} is a {printable(here)}, not a number"
                    )
            elif str(detail[0]) not in SIZES:
                raise InputError(f"{self.where}: field {walked!r:.80} is a {detail[0]}, not a number")
            elif number < len(parts) - 1:
                raise InputError(f"{self.where}: field {walked!r:.80} is a number and has no fields")

    def require_stamp(self) -> None:
        """Check that messages carry ``header.stamp``.

        Raises:
            InputError: they do not.
        """
        if dict(self.fields(self.name)).get("header") != (Nodetype.NAME, "std_msgs/msg/Header"):
            raise InputError(
                f"{self.where}: {printable(self.name)} has no header and so no stamp of its own; "
                "with clock = 'log' in the map's [time], the recorder's clock is taken"
            )
        stamp = dict(self.fields("std_msgs/msg/Header")).get("stamp")
        if stamp != (Nodetype.NAME, _TIME) or dict(self.fields(_TIME)) != dict(_known()[_TIME][1]):
            raise InputError(
                f"{self.where}: the bag defines a header without the stamp that headers of ROS 2 have"
            )

    def require_joints(self, field: str) -> None:
        """Check that messages have named joints with such numbers.

        Raises:
            InputError: they are not joint states.
        """
        if self.name != JOINT_STATE:
            raise InputError(
                f"{self.where} holds {printable(self.name)}; a map's key joint goes with {JOINT_STATE}, and a dotted "
                "path as field with other messages"
            )
        fields = dict(self.fields(self.name))
        string, numbers = fields.get("name"), fields.get(field)
        if string is None or string[0] != Nodetype.SEQUENCE or string[1][0][1] != ("string", 0):
            raise InputError(
                f"{self.where}: the bag defines {JOINT_STATE} without string[] name, which it must have"
            )
        if numbers is None or numbers[0] != Nodetype.SEQUENCE or numbers[1][0][1] != ("float64", 0):
            raise InputError(f"{self.where}: the bag defines {JOINT_STATE} without float64[] {field}")


def message_type(topic: Topic, bag: str) -> MessageType:
    """The type of a topic's messages, as the bag defines it, or as ROS 2 does where the bag does not say.

    Args:
        topic: the topic.
        bag: what messages call the bag.

    Raises:
        InputError: messages are not CDR, or the type is neither defined in the bag nor known.
    """
    where = f"{bag}: topic {printable(topic.name)}"
    if topic.encoding != "cdr":
        raise InputError(
            f"{where} is encoded as {topic.encoding!r:.40}; only cdr, as ROS 2 writes it, is read"
        )
    name = type_name(topic)
    types = _parsed(topic, name, where) if topic.definition else {}
    if name not in types and name not in _known():
        raise InputError(f"{where} holds {name or 'messages'!s:.80}, a type that the bag does not define")
    found = MessageType(name, types, where)
    _check_depth(found, name, 0, set())
    return found


def type_name(topic: Topic) -> str:
    """Name of a topic's type in full: some writers leave out ``/msg/``."""
    name = topic.type
    return normalize_msgtype(name) if re.fullmatch(r"\w+/\w+", name) else name


def string_of(message: bytes, where: str) -> str:
    """The text of a std_msgs/msg/String.

    Raises:
        InputError: it is not one.
    """
    try:
        return get_typestore(Stores.LATEST).deserialize_cdr(message, STRING).data  # type: ignore[attr-defined]
    except Exception as error:  # the library raises its own type, and others on damaged bytes
        raise InputError(f"{where}: its message is not a readable {STRING}") from error


def _parsed(topic: Topic, name: str, where: str) -> Typesdict:
    text = topic.definition.replace("\r\n", "\n")
    try:
        if topic.definition_format in ("ros2idl", "omgidl"):
            parts = [text]
            if text.startswith(f"{_IDL}IDL: "):
                parts = [part.partition("\n")[2] for part in text.split(_IDL)[1:]]
            return {key: value for part in parts for key, value in get_types_from_idl(part).items()}
        if topic.definition_format == "ros2msg":
            return get_types_from_msg(text, name)
    except Exception as error:  # the parser raises its own type, and others on damaged text
        raise InputError(f"{where}: the definition of its type {printable(name)} is not readable") from error
    raise InputError(
        f"{where}: its type is defined by {topic.definition_format!r:.40}; ros2msg and ros2idl are read"
    )


def _check_depth(found: MessageType, name: str, depth: int, done: set[str]) -> None:
    if depth > _DEEPEST:
        raise InputError(
            f"{found.where}: the definition of {printable(found.name)} holds itself, or is too deep"
        )
    for field, (kind, detail) in found.fields(name):
        if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            kind, detail = detail[0]  # type: ignore[misc]
        if kind == Nodetype.NAME:
            # Types seen at this depth need no second look: the work stays in proportion to the definition.
            if (mark := f"{depth} {detail}") not in done:
                done.add(mark)
                _check_depth(found, str(detail), depth + 1, done)
        elif str(detail[0]) not in SIZES and detail[0] != "string":
            raise InputError(
                f"{found.where}: field {printable(field)} of {printable(name)} is a {detail[0]}, which is not read"
            )


@cache
def _known() -> Typesdict:
    """Types that come with ROS 2."""
    return get_typestore(Stores.LATEST).fielddefs

"""Read numbers from many CDR messages at once.

In a CDR message, the position of a number depends on the lengths of the strings and arrays before it. The lengths of a
robot's messages rarely change. The reader therefore walks one message field by field to find its layout. It then reads
all messages with the same lengths and joint names at those positions at once. Other lengths get a layout of their own.

Encapsulation follows OMG DDSI-RTPS 2.5, section 10; alignment is plain CDR (XCDR1), as ROS 2 writes it. Every error is
an ``InputError`` that names the bag and the topic.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc, Typesdict
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.msg import normalize_msgtype

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_logs.bag.storage import Messages, Topic, printable
from mocobot_logs.log import Stamps

JOINT_STATE = "sensor_msgs/msg/JointState"
STRING = "std_msgs/msg/String"
LARGEST_NESTED = 10_000
"""Largest number of strings and structures in one message; numbers in arrays do not count."""
_SIZES = {
    "bool": 1, "byte": 1, "char": 1, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4,
    "int64": 8, "uint64": 8, "float32": 4, "float64": 8,
}  # fmt: skip
"""Sizes of number types [bytes]."""
_SEC, _NANOSEC = "header.stamp.sec", "header.stamp.nanosec"
_TIME = "builtin_interfaces/msg/Time"
_DEEPEST = 32
_IDL = "=" * 80 + "\n"
_EMPTY: list[tuple[str, FieldDesc]] = [("structure_needs_at_least_one_member", (Nodetype.BASE, ("uint8", 0)))]
_REFUSED = {
    **dict.fromkeys((2, 3), "PL_CDR"),
    **dict.fromkeys((6, 7, 16, 17), "CDR2"),
    **dict.fromkeys((8, 9, 20, 21), "delimited CDR2"),
    **dict.fromkeys((10, 11, 18, 19), "PL_CDR2"),
}  # numbers of RTPS and of older XTypes
_PADDING = 3  # most padding bytes, to a multiple of four
_NEW_LAYOUTS = 4
"""Number of unstored layouts of one size that are matched against all messages of a group; later ones match one
message."""
_KEPT_LAYOUTS = 64
_GROUP = 8192  # number of messages that are read at once


@dataclass(frozen=True, eq=False)
class MessageType:
    """A message type with the types it contains."""

    name: str  # such as ``sensor_msgs/msg/JointState``
    types: Typesdict  # fields of this type and of every type inside it
    where: str  # bag and topic in messages

    def fields(self, name: str) -> list[tuple[str, FieldDesc]]:
        """Return names and types of a type's fields; a type without fields has one byte, as in ROS 2."""
        if name not in self.types and name not in _known():
            raise InputError(
                f"{self.where}: its messages hold the type {printable(name)}, which the bag does not define"
            )
        return (self.types[name] if name in self.types else _known()[name])[1] or _EMPTY

    def require(self, path: str) -> None:
        """Refuse a dotted path, such as ``point.x`` or ``data[2]``, that does not lead to a number."""
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
            is_array, is_last = kind in (Nodetype.ARRAY, Nodetype.SEQUENCE), number == len(parts) - 1
            what = None
            if is_array != (found[2] is not None):
                what = f"is an array; name one element, such as {part}[0]" if is_array else "is not an array"
            elif is_array:
                kind, detail = detail[0]  # type: ignore[misc]
            if what is None and kind == Nodetype.NAME:
                here = str(detail)
                what = f"is a {printable(here)}, not a number" if is_last else None
            elif what is None and str(detail[0]) not in _SIZES:
                what = f"is a {detail[0]}, not a number"
            elif what is None and not is_last:
                what = "is a number and has no fields"
            if what is not None:
                raise InputError(f"{self.where}: field {walked!r:.80} {what}")

    def require_stamp(self) -> None:
        """Refuse messages without ``header.stamp``."""
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
        """Refuse messages that are no joint states with the array ``field``."""
        if self.name != JOINT_STATE:
            raise InputError(
                f"{self.where} holds {printable(self.name)}; a map's key joint goes with {JOINT_STATE}, and a dotted "
                "path as field with other messages"
            )
        fields = dict(self.fields(self.name))
        for wanted, base, text in (
            ("name", "string", "string[] name"),
            (field, "float64", f"float64[] {field}"),
        ):
            found = fields.get(wanted)
            if found is None or found[0] != Nodetype.SEQUENCE or found[1][0][1] != (base, 0):
                needed = ", which it must have" if base == "string" else ""
                raise InputError(f"{self.where}: the bag defines {JOINT_STATE} without {text}{needed}")


def message_type(topic: Topic, bag: str) -> MessageType:
    """Return the type of a topic's messages as the bag defines it, else as ROS 2 does."""
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
    """Return the full name of a topic's type; some writers omit ``/msg/``."""
    name = topic.type
    return normalize_msgtype(name) if re.fullmatch(r"\w+/\w+", name) else name


def string_of(message: bytes, where: str) -> str:
    """Return the text of a std_msgs/msg/String."""
    try:
        return get_typestore(Stores.LATEST).deserialize_cdr(message, STRING).data  # type: ignore[attr-defined]
    except Exception as error:  # the library raises its own type, and others for damaged bytes
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
    except Exception as error:  # the parser raises its own type, and others for damaged text
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
            # Types already seen at this depth are skipped, so the work is proportional to the definition.
            if (mark := f"{depth} {detail}") not in done:
                done.add(mark)
                _check_depth(found, str(detail), depth + 1, done)
        elif str(detail[0]) not in _SIZES and detail[0] != "string":
            raise InputError(
                f"{found.where}: field {printable(field)} of {printable(name)} is a {detail[0]}, which is not read"
            )


@cache
def _known() -> Typesdict:
    """Return the types that come with ROS 2."""
    return get_typestore(Stores.LATEST).fielddefs


class CdrError(ValueError):
    """A message does not match its type; the text says how, ``row`` says which message."""

    def __init__(self, what: str, row: int = 0) -> None:
        """``row`` is the index of the message among those read together."""
        super().__init__(what)
        self.row = row


@dataclass(frozen=True)
class Leaf:
    """One number or an array of numbers at ``offset`` in a message; ``kind`` is a NumPy type."""

    offset: int
    kind: str
    count: int


class Walk:
    """One message, parsed field by field.

    Attributes:
        leaves: the wanted numbers and arrays of numbers, by dotted path.
        joints: strings of the field ``name`` or ``joint_names``, if wanted.
        fixed: positions of all bytes that determine the layout: encapsulation, lengths, and names if wanted.
        unread: bytes after the last field, without padding; ROS 2 leaves them unread, too.
    """

    def __init__(self, message: bytes, kind: MessageType, wanted: set[str], names: bool) -> None:
        """Parse a message with its encapsulation; CdrError if it does not match its type, or is no plain CDR.

        ``wanted`` are dotted paths of numbers or of arrays of numbers; ``names`` says whether to collect ``joints``.
        """
        if len(message) < 4:
            raise CdrError(f"it is cut off, at {len(message)} bytes")
        scheme = int.from_bytes(message[:2], "big")
        if scheme not in (0, 1):
            known = _REFUSED.get(scheme, "an unknown one")
            raise CdrError(
                f"its encapsulation is {scheme:#06x} ({known}); plain CDR (0x0000, 0x0001) is read"
            )
        self._order = "<" if scheme else ">"
        self._message, self._kind, self._wanted, self._names = message, kind, wanted, names
        self._at, self._nested = 4, 0
        self.leaves: dict[str, Leaf] = {}
        self.joints: list[str] = []
        self.fixed: list[int] = [0, 1]
        self._structure(kind.name, "")
        rest = len(message) - self._at
        self.unread = rest if rest > _PADDING else 0

    def _structure(self, name: str, path: str) -> None:
        for field, description in self._kind.fields(name):
            self._field(description, f"{path}.{field}" if path else field)

    def _field(self, description: FieldDesc, path: str) -> None:
        kind, detail = description
        if kind == Nodetype.NAME:
            self._count(1)
            self._structure(str(detail), path)
        elif kind == Nodetype.BASE:
            if str(detail[0]) == "string":
                self._string(path)
            else:
                self._numbers(str(detail[0]), 1, path)
        else:
            (inner, what), count = detail  # type: ignore[misc]
            if kind == Nodetype.SEQUENCE:
                count = self._length()
            if inner == Nodetype.BASE and (base := str(what[0])) != "string":
                self._numbers(base, int(count), path)
                return
            self._count(int(count))
            for number in range(int(count)):
                self._field((inner, what), f"{path}[{number}]")  # type: ignore[arg-type]

    def _string(self, path: str) -> None:
        length = self._length()
        begin = self._at
        self._skip(length)
        if self._names and path.startswith(("name[", "joint_names[")):
            self.fixed += range(begin, self._at)
            self.joints.append(self._message[begin : self._at].rstrip(b"\0").decode(errors="replace"))

    def _numbers(self, base: str, count: int, path: str) -> None:
        size = _SIZES[base]
        if count:
            self._align(size)
        if path in self._wanted:
            letter = "f" if base.startswith("float") else "i" if base.startswith("int") else "u"
            self.leaves[path] = Leaf(self._at, f"{self._order}{letter}{size}", count)
        self._skip(size * count)

    def _length(self) -> int:
        self._align(4)
        begin = self._at
        self._skip(4)
        self.fixed += range(begin, self._at)
        return int.from_bytes(self._message[begin : self._at], "little" if self._order == "<" else "big")

    def _align(self, size: int) -> None:
        self._at += (4 - self._at) % size  # alignment counts from the end of the encapsulation

    def _skip(self, length: int) -> None:
        self._at += length
        if self._at > len(self._message):
            missing = self._at - len(self._message)
            raise CdrError(f"it has {len(self._message)} bytes, {missing} less than its lengths say")

    def _count(self, more: int) -> None:
        self._nested += more
        if self._nested > LARGEST_NESTED:
            raise CdrError(f"it holds more than {LARGEST_NESTED} strings and structures")


@dataclass(frozen=True)
class Selector:
    """One number of a message."""

    # dotted path such as ``point.x`` or ``data[2]``; with a joint, the name of an array of numbers
    field: str
    joint: str | None = None  # name of the joint whose number it is, or None


def record_of(places: Mapping[str, tuple[Any, int]], size: int) -> np.dtype:
    """Return the record with named numbers or arrays of a kind at an offset in messages of ``size`` bytes."""
    kinds, offsets = zip(*places.values(), strict=True) if places else ((), ())
    return np.dtype({"names": [*places], "formats": [*kinds], "offsets": [*offsets], "itemsize": size})


EMPTY = "has no"  # first words of what a selector lacks if the array of a field is empty
_UNEQUAL = "cannot be told from the others"


class Layout:
    """Positions of the wanted numbers in messages of one size.

    Attributes:
        joints: names of the joints, if joints are wanted.
        lacking: for each selector, why messages of this layout lack the number; None if they have it.
        named: for each selector, whether messages of this layout name its joint; true without a joint.
        unread: bytes after the last field.
    """

    def __init__(self, message: bytes, kind: MessageType, selectors: Sequence[Selector], stamp: bool) -> None:
        """Find the positions in one message; CdrError if it does not match its type."""
        names = any(selector.joint is not None for selector in selectors)
        arrays = {re.sub(r"\[\d+\]$", "", selector.field) for selector in selectors}
        time = {_SEC, _NANOSEC} if stamp else set()
        walk = Walk(message, kind, arrays | time, names)
        self.joints, self.unread = walk.joints, walk.unread
        self.named = np.array([s.joint is None or s.joint in walk.joints for s in selectors], bool)
        self._at = np.array(walk.fixed, np.intp)
        self._fixed = np.frombuffer(message, np.uint8)[self._at]
        places = {path: (walk.leaves[path].kind, walk.leaves[path].offset) for path in time}
        self.lacking: list[str | None] = []
        for number, selector in enumerate(selectors):
            place = self._place(selector, walk)
            self.lacking.append(place if isinstance(place, str) else None)
            if not isinstance(place, str):
                places[str(number)] = place
        self._record = record_of(places, len(message))

    @staticmethod
    def _place(selector: Selector, walk: Walk) -> tuple[str, int] | str:
        found = re.fullmatch(r"(.*)\[(\d+)\]", selector.field)
        path, index = (found[1], int(found[2])) if found else (selector.field, 0)
        if selector.joint is not None:
            if (times := walk.joints.count(selector.joint)) != 1:
                return "is missing" if not times else "is named more than once"
            index = walk.joints.index(selector.joint)
        leaf = walk.leaves.get(path)
        if selector.joint is not None and leaf is not None and leaf.count not in (0, len(walk.joints)):
            # JointState.msg: "All arrays in this message should have the same size, or be empty."
            return f"{_UNEQUAL}: {selector.field} holds {leaf.count} numbers for {len(walk.joints)} names"
        if leaf is None or index >= leaf.count:
            return f"{EMPTY} {selector.field}" if selector.joint is not None else "is missing"
        return leaf.kind, leaf.offset + index * np.dtype(leaf.kind).itemsize

    def fits(self, rows: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Return which messages, one per row, have this layout."""
        return (rows[:, self._at] == self._fixed).all(axis=1)

    def read(self, rows: NDArray[np.uint8]) -> tuple[Stamps, Array]:
        """Return stamps [ns] (0 without a header) and numbers, NaN where lacking; CdrError for a faulty stamp."""
        table = np.ascontiguousarray(rows).view(self._record)[:, 0]
        stamps = np.zeros(len(rows), np.int64)
        if _SEC in (self._record.names or ()):
            nanoseconds = table[_NANOSEC].astype(np.int64)
            if (bad := nanoseconds >= 1_000_000_000).any():
                row = int(np.argmax(bad))
                raise CdrError(
                    f"the nanoseconds of its stamp are {nanoseconds[row]}; they must be below 1e9", row
                )
            stamps = table[_SEC].astype(np.int64) * 1_000_000_000 + nanoseconds
        values = np.full((len(rows), len(self.lacking)), np.nan)
        for number, lacking in enumerate(self.lacking):
            if lacking is None:
                values[:, number] = table[str(number)]
        return stamps, values


class CdrReader:
    """Reads the same numbers from all messages of one topic.

    Attributes:
        joints: names of all joints seen, in order.
        lacking: for each selector, why all messages so far lack the number; None if some had it.
        count: number of messages read.
        unread: most bytes after the last field of a message.
        senders: sets of joints that messages name, each sent by a publisher of its own; the first 64.
    """

    def __init__(self, kind: MessageType, selectors: Sequence[Selector], stamp: bool) -> None:
        """``stamp`` tells whether to read ``header.stamp``."""
        self._kind, self._selectors, self._stamp = kind, tuple(selectors), stamp
        self._layouts: dict[int, list[Layout]] = {}
        self._kept = 0
        self.joints: dict[str, None] = {}
        self.senders: set[frozenset[str]] = set()
        self.lacking: list[str | None] = ["is missing"] * len(self._selectors)
        self.count = self.unread = 0

    def read(self, messages: Messages) -> tuple[Stamps, Array]:
        """Return stamps [ns] (0 if not wanted), shape (q,), and numbers, NaN where lacking, shape (q, S)."""
        return self.read_named(messages)[:2]

    def read_named(self, messages: Messages) -> tuple[Stamps, Array, NDArray[np.bool_]]:
        """Return stamps and numbers as ``read`` does, and whether a message names each joint, shape (q, S)."""
        stamps = np.zeros(len(messages), np.int64)
        named = np.ones((len(messages), len(self._selectors)), bool)
        values = np.empty((len(messages), len(self._selectors)))
        memory = np.frombuffer(messages.block, np.uint8)
        for begin in range(0, len(messages), _GROUP):
            part = messages.size[begin : begin + _GROUP]
            order = np.argsort(part, kind="stable")
            sizes, begins = np.unique(part[order], return_index=True)
            for size, index in zip(sizes, np.split(order + begin, begins[1:]), strict=True):
                if not size:
                    raise self._error(int(index[0]), CdrError("it is empty"))
                rows = np.lib.stride_tricks.sliding_window_view(memory, int(size))[messages.start[index]]
                self._read_rows(rows, index, stamps, values, named)
        self.count += len(messages)
        return stamps, values, named

    def _read_rows(
        self,
        rows: NDArray[np.uint8],
        index: NDArray[np.intp],
        stamps: Stamps,
        values: Array,
        named: NDArray[np.bool_],
    ) -> None:
        """Read messages of one size: try the known layouts in turn, then learn new ones."""
        known = self._layouts.setdefault(rows.shape[1], [])
        tried = 0
        while len(rows):
            is_new = tried >= len(known)
            layout = self._learn(rows[0], int(index[0]), known) if is_new else known[tried]
            tried += 1
            alone = tried > len(known) + _NEW_LAYOUTS
            fits = np.arange(len(rows)) == 0 if alone else layout.fits(rows)
            if not fits.any():
                continue
            every = bool(fits.all())
            here, at = (rows, index) if every else (rows[fits], index[fits])
            try:
                stamps[at], values[at] = layout.read(here)
                named[at] = layout.named
            except CdrError as error:
                raise self._error(int(at[error.row]), error) from error
            for number, lacking in enumerate(layout.lacking):
                if self.lacking[number] is not None:
                    self.lacking[number] = lacking
            rows, index = (rows[:0], index[:0]) if every else (rows[~fits], index[~fits])

    def _learn(self, row: NDArray[np.uint8], index: int, known: list[Layout]) -> Layout:
        try:
            layout = Layout(row.tobytes(), self._kind, self._selectors, self._stamp)
        except CdrError as error:
            raise self._error(index, error) from error
        self.unread = max(self.unread, layout.unread)
        if len(self.senders) < _KEPT_LAYOUTS:
            self.senders.add(frozenset(layout.joints))
        for joint in layout.joints:
            if len(self.joints) < 1000:
                self.joints[joint] = None
        if self._kept < _KEPT_LAYOUTS:
            self._kept += 1
            known.append(layout)
        return layout

    def _error(self, index: int, error: CdrError) -> InputError:
        kind = printable(self._kind.name)
        return InputError(
            f"{self._kind.where}: message {self.count + index} is not a readable {kind}: {error}"
        )

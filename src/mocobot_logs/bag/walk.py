"""One CDR message, walked field by field to find where its numbers lie.

Encapsulation as in OMG DDSI-RTPS 2.5, section 10; alignment as in plain CDR (XCDR1), which is what ROS 2 writes.
"""

from dataclasses import dataclass

from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc

from mocobot_logs.bag.types import SIZES, MessageType

LARGEST_NESTED = 10_000
"""Most strings and structures in one message; numbers in arrays do not count."""
_REFUSED = {
    **dict.fromkeys((2, 3), "PL_CDR"),
    **dict.fromkeys((6, 7, 16, 17), "CDR2"),
    **dict.fromkeys((8, 9, 20, 21), "delimited CDR2"),
    **dict.fromkeys((10, 11, 18, 19), "PL_CDR2"),
}  # numbers of RTPS and of older XTypes
_TRAILING = 3  # bytes that bring a message to a multiple of four


class CdrError(ValueError):
    """A message is not what its type says; tells what is wrong, not where.

    Attributes:
        row: which of the messages that are read together.
    """

    def __init__(self, what: str, row: int = 0) -> None:
        """What is wrong with which message."""
        super().__init__(what)
        self.row = row


@dataclass(frozen=True)
class Leaf:
    """Numbers at ``offset`` in a message: one, or an array."""

    offset: int
    kind: str
    count: int


class Walk:
    """One message, walked.

    Attributes:
        order: byte order of its numbers, as NumPy's "<" or ">".
        leaves: the numbers and arrays of numbers that are wanted, by dotted path.
        joints: the strings of its field ``name``, if wanted.
        fixed: every byte on which the places of the numbers depend: encapsulation, lengths, and names if wanted.
    """

    def __init__(self, message: bytes, kind: MessageType, wanted: set[str], names: bool) -> None:
        """Walk a message.

        Args:
            message: the message with its encapsulation.
            kind: its type.
            wanted: dotted paths of numbers or of arrays of numbers.
            names: whether the strings of a field ``name`` are wanted.

        Raises:
            CdrError: the message is not what its type says, or is encapsulated in another way.
        """
        if len(message) < 4:
            raise CdrError(f"it is cut off, at {len(message)} bytes")
        scheme = int.from_bytes(message[:2], "big")
        if scheme not in (0, 1):
            known = _REFUSED.get(scheme, "an unknown one")
            raise CdrError(
                f"its encapsulation is {scheme:#06x} ({known}); plain CDR (0x0000, 0x0001) is read"
            )
        self.order = "<" if scheme else ">"
        self._little = "little" if scheme else "big"
        self._message, self._kind, self._wanted, self._names = message, kind, wanted, names
        self._at, self._nested = 4, 0
        self.leaves: dict[str, Leaf] = {}
        self.joints: list[str] = []
        self.fixed: list[int] = [0, 1]
        self._structure(kind.name, "")
        if self._at + _TRAILING < len(message):
            raise CdrError(f"it has {len(message)} bytes, {len(message) - self._at} more than its type says")

    def _structure(self, name: str, path: str) -> None:
        for field, description in self._kind.fields(name):
            self._field(description, f"{path}.{field}" if path else field)

    def _field(self, description: FieldDesc, path: str) -> None:
        kind, detail = description
        if kind == Nodetype.NAME:
            self._count(1)
            self._structure(str(detail), path)
        elif kind == Nodetype.BASE:
            self._base(str(detail[0]), path)
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

    def _base(self, base: str, path: str) -> None:
        if base != "string":
            self._numbers(base, 1, path)
            return
        length = self._length()
        begin = self._at
        self._skip(length)
        if self._names and path.startswith("name["):
            self.fixed += range(begin, self._at)
            self.joints.append(self._message[begin : self._at].rstrip(b"\0").decode(errors="replace"))

    def _numbers(self, base: str, count: int, path: str) -> None:
        size = SIZES[base]
        if count:
            self._align(size)
        if path in self._wanted:
            self.leaves[path] = Leaf(self._at, f"{_letter(base)}{size}", count)
        self._skip(size * count)

    def _length(self) -> int:
        self._align(4)
        begin = self._at
        self._skip(4)
        self.fixed += range(begin, self._at)
        return int.from_bytes(self._message[begin : self._at], self._little)  # type: ignore[arg-type]

    def _align(self, size: int) -> None:
        self._at += (4 - self._at) % size  # counted from behind the encapsulation

    def _skip(self, length: int) -> None:
        self._at += length
        if self._at > len(self._message):
            missing = self._at - len(self._message)
            raise CdrError(f"it has {len(self._message)} bytes, {missing} less than its lengths say")

    def _count(self, more: int) -> None:
        self._nested += more
        if self._nested > LARGEST_NESTED:
            raise CdrError(f"it holds more than {LARGEST_NESTED} strings and structures")


def _letter(base: str) -> str:
    """NumPy's letter for a kind of number."""
    return "f" if base.startswith("float") else "i" if base.startswith("int") else "u"

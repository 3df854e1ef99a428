"""What columns of a Parquet file unpack to: by its footer and by the headers of its pages, either of which may lie.

A reader takes memory for a whole page as its header says, 33 kB for half a gigabyte, and for values as the footer says.
Both are structures of Thrift's compact protocol, by fields with numbers (https://github.com/apache/parquet-format,
``parquet.thrift``). pyarrow tells neither pages nor, without ending the process, columns of a damaged footer.
"""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any, BinaryIO

_TAIL_BYTES, _HEADER_BYTES = 8, 16 << 10
"""Footer's length and magic number; the longest header of a page, which holds two values of the column at most."""
_GROUPS, _COLUMNS, _METADATA = 4, 1, 3
_VALUES, _UNPACKED, _PACKED, _DATA, _DICTIONARY = 5, 6, 7, 9, 11  # of a column in a group
_PAGE_UNPACKED, _PAGE_PACKED = 2, 3


def claimed_bytes(path: Path, columns: Sequence[str], names: Collection[str]) -> int:
    """The most that columns, and lists in them, unpack to by pages, by footer, or by values of eight bytes.

    Args:
        path: the file.
        columns: paths of its columns, in the order of its schema.
        names: of columns and lists that are read.

    Raises:
        Exception: of any type, on damaged bytes.
    """
    wanted = [k for k, c in enumerate(columns) if c in names or any(c.startswith(f"{n}.") for n in names)]
    total = 0
    with path.open("rb") as file:
        end = file.seek(-_TAIL_BYTES, 2)
        file.seek(end - int.from_bytes(file.read(4), "little"))
        footer, _ = _structure(file.read(end - file.tell()), 0)
        for group in footer[_GROUPS]:
            for column in (group[_COLUMNS][k][_METADATA] for k in wanted):
                total += max(column[_UNPACKED], 8 * column[_VALUES], _in_pages(file, column))
    return total


def _in_pages(file: BinaryIO, column: dict[int, Any]) -> int:
    total, at = 0, min(column[_DATA], column.get(_DICTIONARY) or column[_DATA])
    end = at + column[_PACKED] if column[_VALUES] else 0  # without values pages are not read
    while at < end:
        file.seek(at)
        header, length = _structure(file.read(_HEADER_BYTES), 0)
        total += max(header[_PAGE_UNPACKED], 0)
        at += length + max(header[_PAGE_PACKED], 0)
    return total


def _structure(data: bytes, at: int) -> tuple[dict[int, Any], int]:
    """Values of a structure by their field, and where it ends."""
    found, field = {}, 0
    while head := data[at]:
        if not head >> 4:
            raise ValueError("a field whose number does not follow")
        field += head >> 4
        found[field], at = (None, at + 1) if head & 15 in (1, 2) else _value(data, at + 1, head & 15)
    return found, at + 1


def _value(data: bytes, at: int, kind: int) -> tuple[Any, int]:
    value = None
    match kind:
        case 1 | 2 | 3:  # in a list, true or false; a byte
            at += 1
        case 4 | 5 | 6:
            number, at = _unsigned(data, at)
            value = (number >> 1) ^ -(number & 1)
        case 7:
            at += 8
        case 8:  # bytes, after their number
            number, at = _unsigned(data, at)
            at += number
        case 9 | 10:
            number, of = data[at] >> 4, data[at] & 15
            number, at = _unsigned(data, at + 1) if number == 15 else (number, at + 1)
            value = []
            for _ in range(number):
                entry, at = _value(data, at, of)
                value.append(entry)
        case 12:
            value, at = _structure(data, at)
        case _:
            raise ValueError(f"a field of kind {kind}")
    if at > len(data):
        raise EOFError("a field goes beyond the end")
    return value, at


def _unsigned(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        value |= (data[at] & 127) << shift
        at, shift = at + 1, shift + 7
        if data[at - 1] < 128:
            return value, at

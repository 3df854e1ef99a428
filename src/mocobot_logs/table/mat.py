"""MATLAB files of level 5 (-v6, -v7): vectors and matrices of real numbers, read in step; never an object.

A file is a header of 128 bytes and elements, each a tag (type, number of bytes) and its data; a matrix is an element of
elements: flags, sizes, name, numbers ("MAT-File Format", The MathWorks, 2024).
"""

import io
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from estimator.inputs import Unpacked, open_input
from mocobot_logs.faults import shown, told_in_one_sentence
from mocobot_logs.table.npz import MAX_WHOLE_BYTES, read_exactly
from mocobot_logs.table.stamps import from_numbers
from mocobot_logs.table.table import Block, Table, Wanted, rows_at_a_time

HEADER_BYTES, TAG_BYTES = 128, 8
MATRIX, COMPRESSED = 14, 15
"""Types of elements at a file's top level."""
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Types of elements that hold numbers, as numpy names them."""
NUMERIC_CLASSES = range(6, 16)
"""Classes of matrices of numbers, from double to uint64; the others are cells, structs, objects, text, sparse ones."""
COMPLEX_FLAG = 0x0800
MOST_NAME_BYTES, MOST_DIMENSIONS = 1 << 10, 32
PIECE_BYTES = 1 << 16


class _Inflated(io.RawIOBase):
    """What zlib packed, as a file that is read from its beginning."""

    def __init__(self, file: IO[bytes], size: int) -> None:
        """Take a file at the packed bytes, and how many they are."""
        super().__init__()
        self._file, self._left, self._zlib = file, size, zlib.decompressobj()

    def readable(self) -> bool:
        """It is."""
        return True

    def readinto(self, buffer: memoryview) -> int:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Fill a buffer as far as there is something."""
        while not self._zlib.eof:
            packed = self._zlib.unconsumed_tail
            if not packed:
                packed = self._file.read(min(PIECE_BYTES, self._left))
                self._left -= len(packed)
            found = self._zlib.decompress(packed, len(buffer))
            if found:
                buffer[: len(found)] = found
                return len(found)
            if not packed:
                break
        return 0


@dataclass(frozen=True)
class Variable:
    """One matrix of a file.

    Attributes:
        at: where its element begins in the file [B].
        start: where its numbers begin in what the element holds, unpacked [B].
        dtype: of a number in the file.
        rows: samples.
        row_shape: shape of one row.
        packed: whether zlib packed it.
    """

    at: int
    start: int
    dtype: np.dtype
    rows: int
    row_shape: tuple[int, ...]
    packed: bool

    @property
    def size(self) -> int:
        """Bytes of its numbers."""
        return self.dtype.itemsize * self.rows * prod(self.row_shape)


class MatTable(Table):
    """A MATLAB file as a ``Table``: a vector is a column; of a matrix, a row is a sample."""

    def __init__(self, path: Path, name: str) -> None:
        """Read the tags, sizes and names of all variables.

        Raises:
            InputError: the file is damaged, cut off, of another version, or holds no matrix of real numbers.
        """
        self.name, self._path = name, path
        with told_in_one_sentence(name, "MATLAB file"), open_input(path) as file:
            self._order = self._byte_order(file.read(HEADER_BYTES))
            self._variables = dict(self._found(file))
        if not self._variables:
            raise InputError(
                f"{name}: holds no matrix of real numbers; save each column as a vector (structs, cells, tables, "
                "objects and text are not read)"
            )
        self.shapes: Mapping[str, tuple[int, ...]] = {
            key: variable.row_shape for key, variable in self._variables.items()
        }
        self.size = max(variable.rows for variable in self._variables.values())

    def blocks(self, wanted: Wanted, advance: Callable[[int], object]) -> Iterator[Block]:
        """Rows in step, see ``Table.blocks``.

        Raises:
            InputError: the file is damaged, or a variable has another number of rows.
        """
        names = list(dict.fromkeys([*wanted.clocks, *wanted.columns]))
        rows = self._rows(names)
        at_a_time = rows_at_a_time(sum(prod(self._variables[name].row_shape) for name in names))
        with told_in_one_sentence(self.name, "MATLAB file"), ExitStack() as stack:
            readers = {name: self._reader(name, stack) for name in names}
            for row in range(0, rows, at_a_time):
                count = min(at_a_time, rows - row)
                read = {name: reader(row, count) for name, reader in readers.items()}
                yield Block(
                    {name: read[name] for name in wanted.columns},
                    {
                        name: from_numbers(
                            read[name].reshape(count), wanted.unit_ns, f"{self.name}: variable {name!r}", row
                        )
                        for name in wanted.clocks
                    },
                )
                advance(count)

    def _byte_order(self, header: bytes) -> str:
        if header.startswith(b"MATLAB 7.3"):
            raise InputError(f"{self.name}: is a MATLAB 7.3 file, which is not read; save it with -v7")
        order = {b"IM": "<", b"MI": ">"}.get(header[126:])
        if order is None or struct.unpack(f"{order}H", header[124:126]) != (0x0100,):
            raise InputError(
                f"{self.name}: is not a MATLAB file of level 5, or a damaged one; save it with -v7"
            )
        return order

    def _found(self, file: IO[bytes]) -> Iterator[tuple[str, Variable]]:
        size, at, seen = self._path.stat().st_size, HEADER_BYTES, set()
        while at < size:
            file.seek(at)
            kind, count = struct.unpack(f"{self._order}II", read_exactly(file, TAG_BYTES))
            if kind not in (MATRIX, COMPRESSED):
                raise InputError(f"{self.name}: is damaged: byte {at} begins an element of type {kind}")
            if at + TAG_BYTES + count > size:
                raise InputError(
                    f"{self.name}: is cut off: the variable from byte {at} on goes beyond the end of the file"
                )
            found = self._header(at, self._content(file, at), kind == COMPRESSED)
            if found is not None:
                if found[0] in seen:
                    raise InputError(f"{self.name}: variable {found[0]!r:.60} is in the file twice")
                seen.add(found[0])
                yield found
            at += TAG_BYTES + count

    def _content(self, file: IO[bytes], at: int) -> IO[bytes]:
        """A file that is at the content of the matrix whose element begins at a byte."""
        file.seek(at)
        kind, count = struct.unpack(f"{self._order}II", read_exactly(file, TAG_BYTES))
        if kind == MATRIX:
            return file
        inside = io.BufferedReader(_Inflated(file, count), PIECE_BYTES)
        kind, _ = struct.unpack(f"{self._order}II", read_exactly(inside, TAG_BYTES))
        if kind != MATRIX:
            raise InputError(f"{self.name}: is damaged: what is packed at byte {at} is no matrix")
        return inside

    def _header(self, at: int, content: IO[bytes], packed: bool) -> tuple[str, Variable] | None:
        """Name and place of a matrix; None if it is not one of real numbers."""
        _, flags, begun = self._element(content, TAG_BYTES)
        (flag,) = struct.unpack(f"{self._order}I4x", flags)
        if flag & 0xFF not in NUMERIC_CLASSES or flag & COMPLEX_FLAG:
            return None
        _, sizes, length = self._element(content, 4 * MOST_DIMENSIONS)
        begun += length
        shape = struct.unpack(f"{self._order}{len(sizes) // 4}i", sizes)
        _, text, length = self._element(content, MOST_NAME_BYTES)
        begun += length
        name = text.decode("utf-8")
        if not name:  # what MATLAB keeps for itself
            return None
        kind, count, small = self._tag(content)
        if len(shape) < 2 or min(shape) < 0 or kind not in NUMBERS:
            raise InputError(f"{self.name}: variable {shown(name)!r} is damaged")
        if len(shape) == 2 and shape[0] == 1:
            shape = shape[::-1]
        row_shape = () if shape[1:] == (1,) else shape[1:]
        dtype = np.dtype(NUMBERS[kind]).newbyteorder(self._order)
        found = Variable(at, begun + (4 if small else TAG_BYTES), dtype, shape[0], row_shape, packed)
        if found.size != count:
            raise InputError(
                f"{self.name}: variable {shown(name)!r} claims {found.size} bytes of numbers, but has {count}"
            )
        return name, found

    def _tag(self, content: IO[bytes]) -> tuple[int, int, bool]:
        """Type and bytes of the next element, and whether they share four bytes; then the data are at once behind."""
        (first,) = struct.unpack(f"{self._order}I", read_exactly(content, 4))
        if first >> 16:
            return first & 0xFFFF, first >> 16, True
        (count,) = struct.unpack(f"{self._order}I", read_exactly(content, 4))
        return first, count, False

    def _element(self, content: IO[bytes], most: int) -> tuple[int, bytes, int]:
        """Type and data of the next element, and the bytes that it takes with its tag."""
        kind, count, small = self._tag(content)
        if count > (4 if small else most):
            raise InputError(f"{self.name}: is damaged: a header has an element of {count} bytes")
        room = 4 if small else -(-count // 8) * 8
        return kind, read_exactly(content, room)[:count], room + (4 if small else TAG_BYTES)

    def _rows(self, names: list[str]) -> int:
        rows, unpacked = self._variables[names[0]].rows, Unpacked(self.name, self._path.stat().st_size)
        for name in names:
            variable = self._variables[name]
            if variable.rows != rows:
                raise InputError(
                    f"{self.name}: variable {shown(name)!r} has {variable.rows} rows, but {shown(names[0])!r} has "
                    f"{rows}; all must have as many (a matrix has a row for each sample)"
                )
            if variable.packed:
                unpacked.add(variable.size)
            if variable.row_shape and variable.size > MAX_WHOLE_BYTES:
                raise InputError(
                    f"{self.name}: variable {shown(name)!r} is larger than {MAX_WHOLE_BYTES >> 30} GiB; save its "
                    "columns as vectors"
                )
        return rows

    def _reader(self, name: str, stack: ExitStack) -> Callable[[int, int], NDArray]:
        """What reads so many rows of a variable from a row on; of a vector, the next ones."""
        variable = self._variables[name]
        content = self._content(stack.enter_context(open_input(self._path)), variable.at)
        read_exactly(content, variable.start)
        if not variable.row_shape:
            return lambda _, count: np.frombuffer(
                read_exactly(content, count * variable.dtype.itemsize), variable.dtype
            )
        # Numbers come column by column.
        shape = (variable.rows, *variable.row_shape)
        whole = np.frombuffer(read_exactly(content, variable.size), variable.dtype).reshape(shape, order="F")
        return lambda row, count: whole[row : row + count]

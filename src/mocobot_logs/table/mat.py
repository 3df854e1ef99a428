"""MATLAB files of level 5 (-v6, -v7): vectors and matrices of real numbers, read in step; never an object.

A file is a header of 128 bytes and elements, each a tag (type, number of bytes) and its data; a matrix is an element of
elements: flags, sizes, name, numbers ("MAT-File Format", The MathWorks, 2024).
"""

import io
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from estimator.inputs import open_input
from mocobot_logs.faults import shown, told_in_one_sentence
from mocobot_logs.table.arrays import ArrayTable, Stored, read_exactly

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


class MatTable(ArrayTable):
    """A MATLAB file as a ``Table``: a vector is a column; of a matrix, a row is a sample."""

    noun, kind = "variable", "MATLAB file"

    def __init__(self, path: Path, name: str) -> None:
        """Read the tags, sizes and names of all variables.

        Raises:
            InputError: the file is damaged, cut off, of another version, or holds no matrix of real numbers.
        """
        self.name, self._path, self.stored_bytes = name, path, path.stat().st_size
        with told_in_one_sentence(name, self.kind), open_input(path) as file:
            self._order = self._byte_order(file.read(HEADER_BYTES))
            self.arrays = dict(self._found(file))
        if not self.arrays:
            raise InputError(
                f"{name}: holds no matrix of real numbers; save each column as a vector (structs, cells, tables, "
                "objects and text are not read)"
            )
        self.shapes: Mapping[str, tuple[int, ...]] = {
            key: array.row_shape for key, array in self.arrays.items()
        }
        self.size = max(array.shape[0] for array in self.arrays.values())

    def readers(self, names: Sequence[str], stack: ExitStack) -> dict[str, Callable[[int], NDArray]]:
        """See ``ArrayTable.readers``."""
        return {
            name: self.arrays[name].reader(
                self._content(stack.enter_context(open_input(self._path)), self.arrays[name].at)
            )
            for name in names
        }

    def _byte_order(self, header: bytes) -> str:
        if header.startswith(b"MATLAB 7.3"):
            raise InputError(f"{self.name}: is a MATLAB 7.3 file, which is not read; save it with -v7")
        order = {b"IM": "<", b"MI": ">"}.get(header[126:])
        if order is None or struct.unpack(f"{order}H", header[124:126]) != (0x0100,):
            raise InputError(
                f"{self.name}: is not a MATLAB file of level 5, or a damaged one; save it with -v7"
            )
        return order

    def _found(self, file: IO[bytes]) -> Iterator[tuple[str, Stored]]:
        size, at, seen = self.stored_bytes, HEADER_BYTES, set()
        while at < size:
            file.seek(at)
            kind, count = struct.unpack(f"{self._order}II", read_exactly(file, TAG_BYTES))
            if kind not in (MATRIX, COMPRESSED):
                raise InputError(f"{self.name}: is damaged: byte {at} begins an element of type {kind}")
            if at + TAG_BYTES + count > size:
                raise InputError(
                    f"{self.name}: is cut off: the variable from byte {at} on goes beyond the end of the file"
                )
            found = self._header(at, self._content(file, at))
            if found is not None:
                if found[0] in seen:
                    raise InputError(f"{self.name}: variable {found[0]!r:.60} is in the file twice")
                if kind == MATRIX and found[1].start + found[1].size > count:
                    raise InputError(
                        f"{self.name}: variable {shown(found[0])!r} goes beyond its {count} bytes"
                    )
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

    def _header(self, at: int, content: IO[bytes]) -> tuple[str, Stored] | None:
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
        shape = shape[:1] if shape[1:] == (1,) else shape
        dtype = np.dtype(self._order + NUMBERS[kind])
        found = Stored(at, dtype, shape, True, begun + (4 if small else TAG_BYTES))
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

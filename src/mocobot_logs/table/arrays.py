"""Tables of arrays: NPZ archives and MATLAB files.

All headers are checked before memory is allocated; then the arrays are read row by row in step. Pickles and objects
are never loaded.

A MATLAB file of level 5 (-v6, -v7) is a header of 128 bytes followed by elements. Each element is a tag (type, number
of bytes) and its data. A matrix is an element that contains elements: flags, sizes, name, numbers ("MAT-File Format",
The MathWorks, 2024).
"""

import io
import struct
import zipfile
import zlib
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from estimator.files import refuse_other_packing
from estimator.inputs import Unpacked, open_input
from estimator.recording.metadata import RecordingMetadata
from mocobot_logs.formats import shown, told_in_one_sentence
from mocobot_logs.table.table import Block, Table, Wanted, rows_at_a_time
from mocobot_logs.table.text import from_numbers

MAX_WHOLE_BYTES = 1 << 30
"""Largest array in Fortran order [bytes]; it is loaded whole, since its rows are not contiguous."""
METADATA_NAME = "mocobot"  # name of a text array with the JSON metadata of a recording (docs/recording.md)
MAX_HEADER_BYTES = 10_000
MAX_METADATA_BYTES = 1 << 20

Reader = Callable[[int], NDArray]  # function that reads the next rows, given their number


@dataclass(frozen=True)
class Stored:
    """Header of one array in a file."""

    at: Any  # location: an entry of an archive, or the first byte in the file
    # dtype, shape, fortran: as in numpy
    dtype: np.dtype
    shape: tuple[int, ...]
    fortran: bool
    start: int  # offset of the numbers from there, unpacked [bytes]

    @property
    def size(self) -> int:
        """Number of bytes of its data."""
        return self.dtype.itemsize * prod(self.shape)

    @property
    def row_shape(self) -> tuple[int, ...]:
        return self.shape[1:]

    @property
    def columnwise(self) -> bool:
        """Whether its rows are not contiguous."""
        return self.fortran and len(self.shape) > 1

    def reader(self, file: IO[bytes]) -> Reader:
        """Return a function that reads rows; ``file`` is unpacked and positioned at ``at``."""
        _read_exactly(file, self.start)
        if self.columnwise:
            whole = np.frombuffer(_read_exactly(file, self.size), self.dtype).reshape(self.shape, order="F")
            done = 0

            def next_loaded(count: int) -> NDArray:
                nonlocal done
                done += count
                return whole[done - count : done]

            return next_loaded
        row = self.dtype.itemsize * prod(self.row_shape)
        return lambda count: np.frombuffer(_read_exactly(file, count * row), self.dtype).reshape(
            count, *self.row_shape
        )


class ArrayTable(Table):
    """A table whose columns are arrays; the first axis of each counts rows.

    Attributes:
        noun: the format's word for an array.
        kind: name of the format in messages.
        arrays: headers by name.
        stored_bytes: size of the file.
    """

    noun: str
    kind: str
    arrays: Mapping[str, Stored]
    stored_bytes: int

    def blocks(self, wanted: Wanted, advance: Callable[[int], object]) -> Iterator[Block]:
        """Yield rows of all columns in step, see ``Table.blocks``."""
        names = list(dict.fromkeys([*wanted.clocks, *wanted.columns]))
        rows = self._rows(names) if names else 0
        at_a_time = rows_at_a_time(sum(prod(self.arrays[name].row_shape) for name in names))
        with told_in_one_sentence(self.name, self.kind), ExitStack() as stack:
            readers = self.readers(names, stack)
            for row in range(0, rows, at_a_time):
                count = min(at_a_time, rows - row)
                read = {name: reader(count) for name, reader in readers.items()}
                clocks = {
                    name: from_numbers(
                        read[name].reshape(count), wanted.unit_ns, f"{self.name}: {self.noun} {name!r}", row
                    )
                    for name in wanted.clocks
                }
                yield Block({name: read[name] for name in wanted.columns}, clocks)
                advance(count)

    @abstractmethod
    def readers(self, names: Sequence[str], stack: ExitStack) -> dict[str, Reader]:
        """Return a function that reads each array; ``stack`` closes the files."""

    def _take(self, arrays: dict[str, Stored]) -> None:
        self.arrays = arrays
        self.shapes = {key: array.row_shape for key, array in arrays.items() if array.shape}
        self.size = max((array.shape[0] for array in arrays.values() if array.shape), default=0)

    def _rows(self, names: list[str]) -> int:
        rows, unpacked = self.arrays[names[0]].shape[0], Unpacked(self.name, self.stored_bytes)
        for name in names:
            array, where = self.arrays[name], f"{self.name}: {self.noun} {shown(name)!r}"
            if array.dtype.kind not in "iuf":
                raise InputError(f"{where} holds {array.dtype}; it must hold numbers")
            if array.shape[0] != rows:
                raise InputError(
                    f"{where} has {array.shape[0]} rows, but {shown(names[0])!r} has {rows}; all must have as many"
                )
            unpacked.add(array.size)
            if array.columnwise and array.size > MAX_WHOLE_BYTES:
                raise InputError(
                    f"{where} is in Fortran order and larger than {MAX_WHOLE_BYTES >> 30} GiB; save it in C order "
                    "(numpy.ascontiguousarray) or its columns one by one"
                )
        return rows


def _read_exactly(file: IO[bytes], count: int) -> bytes:
    content = file.read(count)
    if len(content) < count:
        raise EOFError(f"{len(content)} of {count} bytes are there")
    return content


class NpzTable(ArrayTable):
    """An NPZ archive as a ``Table``: every array of at least one dimension is a column."""

    noun, kind = "array", "NPZ archive"

    def __init__(self, path: Path, name: str) -> None:
        self.name, self._path, self.stored_bytes = name, path, path.stat().st_size
        with self._opened() as archive:
            self._take(self._headers(archive))
            self.metadata = self._read_metadata(archive)

    def readers(self, names: Sequence[str], stack: ExitStack) -> dict[str, Reader]:
        archive = stack.enter_context(self._opened())
        return {
            name: self.arrays[name].reader(stack.enter_context(archive.open(self.arrays[name].at)))
            for name in names
        }

    def _headers(self, archive: zipfile.ZipFile) -> dict[str, Stored]:
        found: dict[str, Stored] = {}
        for member in archive.infolist():
            if not member.filename.endswith(".npy"):
                continue
            name = member.filename.removesuffix(".npy")
            if name in found:
                raise InputError(f"{self.name}: array {name!r:.60} is in the archive twice")
            with archive.open(member) as file:
                found[name] = _npy_header(member, file, f"{self.name}: array {name!r:.60}")
        return found

    def _read_metadata(self, archive: zipfile.ZipFile) -> RecordingMetadata | None:
        array = self.arrays.get(METADATA_NAME)
        if array is None:
            return None
        if array.shape != () or array.dtype.kind != "U" or array.size > MAX_METADATA_BYTES:
            raise InputError(
                f"{self.name}: array {METADATA_NAME!r} must be one text, the recording's metadata"
            )
        with archive.open(array.at) as file:
            _read_exactly(file, array.start)
            text = str(np.frombuffer(_read_exactly(file, array.size), array.dtype)[0])
        return RecordingMetadata.from_json(text, where=f"{self.name}: metadata")

    @contextmanager
    def _opened(self) -> Iterator[zipfile.ZipFile]:
        with told_in_one_sentence(self.name, self.kind), zipfile.ZipFile(self._path) as archive:
            refuse_other_packing(archive, self.name)
            yield archive


def _npy_header(member: zipfile.ZipInfo, file: IO[bytes], where: str) -> Stored:
    """Read the header of one array and check it against the size of its entry."""
    start = _read_exactly(file, 8)
    if start[:6] != b"\x93NUMPY" or start[6] not in (1, 2):
        raise InputError(f"{where} is not in numpy's format 1.0 or 2.0")
    width = 2 if start[6] == 1 else 4
    length_bytes = _read_exactly(file, width)
    length = int.from_bytes(length_bytes, "little")
    if length > MAX_HEADER_BYTES:
        raise InputError(f"{where} has a header of {length} bytes; it may have {MAX_HEADER_BYTES}")
    text = io.BytesIO(length_bytes + _read_exactly(file, length))
    read = np.lib.format.read_array_header_1_0 if start[6] == 1 else np.lib.format.read_array_header_2_0
    shape, fortran, dtype = read(text, max_header_size=MAX_HEADER_BYTES)
    array = Stored(member, dtype, shape, fortran, 8 + width + length)
    if dtype.hasobject:
        raise InputError(f"{where} holds Python objects, which are never loaded; save it as numbers")
    if any(length < 0 for length in shape) or array.start + array.size != member.file_size:
        raise InputError(
            f"{where} claims the shape {shape!s:.80} of {dtype!s:.40}, {array.size} bytes, but has "
            f"{member.file_size - array.start}"
        )
    return array


_MAT_HEADER, _TAG = 128, 8  # bytes
_MATRIX, _COMPRESSED = 14, 15  # types of elements at the top level of a file
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Types of elements with numbers, and their numpy names."""
_NUMERIC_CLASSES = range(6, 16)
"""Classes of numeric matrices, double to uint64. The others are cells, structs, objects, text and sparse matrices."""
_COMPLEX = 0x0800
_MOST_NAME_BYTES, _MOST_DIMENSIONS = 1 << 10, 32
_PIECE_BYTES = 1 << 16


class _Inflated(io.RawIOBase):
    """A zlib stream as a file that is read from its beginning."""

    def __init__(self, file: IO[bytes], size: int) -> None:
        super().__init__()
        self._file, self._left, self._zlib = file, size, zlib.decompressobj()

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # pyright: ignore[reportIncompatibleMethodOverride]
        while not self._zlib.eof:
            packed = self._zlib.unconsumed_tail
            if not packed:
                packed = self._file.read(min(_PIECE_BYTES, self._left))
                self._left -= len(packed)
            found = self._zlib.decompress(packed, len(buffer))
            if found:
                buffer[: len(found)] = found
                return len(found)
            if not packed:
                break
        return 0


class MatTable(ArrayTable):
    """A MATLAB file as a ``Table``: a vector is a column; a row of a matrix is a sample."""

    noun, kind = "variable", "MATLAB file"

    def __init__(self, path: Path, name: str) -> None:
        self.name, self._path, self.stored_bytes = name, path, path.stat().st_size
        with told_in_one_sentence(name, self.kind), open_input(path) as file:
            header = file.read(_MAT_HEADER)
            if header.startswith(b"MATLAB 7.3"):
                raise InputError(f"{name}: is a MATLAB 7.3 file, which is not read; save it with -v7")
            self._order = {b"IM": "<", b"MI": ">"}.get(header[126:], "")
            if not self._order or struct.unpack(f"{self._order}H", header[124:126]) != (0x0100,):
                raise InputError(
                    f"{name}: is not a MATLAB file of level 5, or a damaged one; save it with -v7"
                )
            self._take(self._variables(file))
        if not self.arrays:
            raise InputError(
                f"{name}: holds no matrix of real numbers; save each column as a vector (structs, cells, tables, "
                "objects and text are not read)"
            )

    def readers(self, names: Sequence[str], stack: ExitStack) -> dict[str, Reader]:
        arrays = {name: self.arrays[name] for name in names}
        return {
            name: array.reader(self._content(stack.enter_context(open_input(self._path)), array.at))
            for name, array in arrays.items()
        }

    def _variables(self, file: IO[bytes]) -> dict[str, Stored]:
        size, at = self.stored_bytes, _MAT_HEADER
        arrays: dict[str, Stored] = {}
        while at < size:
            file.seek(at)
            kind, count = struct.unpack(f"{self._order}II", _read_exactly(file, _TAG))
            if kind not in (_MATRIX, _COMPRESSED):
                raise InputError(f"{self.name}: is damaged: byte {at} begins an element of type {kind}")
            if at + _TAG + count > size:
                raise InputError(
                    f"{self.name}: is cut off: the variable from byte {at} on goes beyond the end of the file"
                )
            if (found := self._variable(at, self._content(file, at))) is not None:
                name, array = found
                if name in arrays:
                    raise InputError(f"{self.name}: variable {name!r:.60} is in the file twice")
                if kind == _MATRIX and array.start + array.size > count:
                    raise InputError(f"{self.name}: variable {shown(name)!r} goes beyond its {count} bytes")
                arrays[name] = array
            at += _TAG + count
        return arrays

    def _content(self, file: IO[bytes], at: int) -> IO[bytes]:
        """Return a file positioned at the content of the matrix whose element begins at byte ``at``."""
        file.seek(at)
        kind, count = struct.unpack(f"{self._order}II", _read_exactly(file, _TAG))
        if kind == _MATRIX:
            return file
        inside = io.BufferedReader(_Inflated(file, count), _PIECE_BYTES)
        kind, _ = struct.unpack(f"{self._order}II", _read_exactly(inside, _TAG))
        if kind != _MATRIX:
            raise InputError(f"{self.name}: is damaged: what is packed at byte {at} is no matrix")
        return inside

    def _variable(self, at: int, content: IO[bytes]) -> tuple[str, Stored] | None:
        """Return name and header of a matrix, or None if it holds no real numbers."""
        flags, begun = self._element(content, _TAG)
        (flag,) = struct.unpack(f"{self._order}I4x", flags)
        if flag & 0xFF not in _NUMERIC_CLASSES or flag & _COMPLEX:
            return None
        sizes, length = self._element(content, 4 * _MOST_DIMENSIONS)
        begun += length
        shape = struct.unpack(f"{self._order}{len(sizes) // 4}i", sizes)
        text, length = self._element(content, _MOST_NAME_BYTES)
        begun += length
        name = text.decode("utf-8")
        if not name:  # reserved by MATLAB
            return None
        kind, count, small = self._tag(content)
        if len(shape) < 2 or min(shape) < 0 or kind not in _NUMBERS:
            raise InputError(f"{self.name}: variable {shown(name)!r} is damaged")
        if len(shape) == 2 and shape[0] == 1:
            shape = shape[::-1]
        shape = shape[:1] if shape[1:] == (1,) else shape
        start = begun + (4 if small else _TAG)
        found = Stored(at, np.dtype(self._order + _NUMBERS[kind]), shape, True, start)
        if found.size != count:
            raise InputError(
                f"{self.name}: variable {shown(name)!r} claims {found.size} bytes of numbers, but has {count}"
            )
        return name, found

    def _tag(self, content: IO[bytes]) -> tuple[int, int, bool]:
        """Read the tag of the next element: type, number of bytes, and whether the data follow inside the tag's eight
        bytes."""
        (first,) = struct.unpack(f"{self._order}I", _read_exactly(content, 4))
        if first >> 16:
            return first & 0xFFFF, first >> 16, True
        (count,) = struct.unpack(f"{self._order}I", _read_exactly(content, 4))
        return first, count, False

    def _element(self, content: IO[bytes], most: int) -> tuple[bytes, int]:
        """Return the data of the next element, and its size with tag and padding [bytes]."""
        _, count, small = self._tag(content)
        if count > (4 if small else most):
            raise InputError(f"{self.name}: is damaged: a header has an element of {count} bytes")
        room = 4 if small else -(-count // 8) * 8
        return _read_exactly(content, room)[:count], room + (4 if small else _TAG)

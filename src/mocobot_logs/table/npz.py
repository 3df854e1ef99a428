"""NPZ archives of numpy arrays: headers checked before anything is allocated, then read in step; never a pickle."""

import io
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from estimator.archive import refuse_other_packing
from estimator.errors import InputError
from estimator.inputs import Unpacked
from estimator.recording.metadata import RecordingMetadata
from mocobot_logs.faults import told_in_one_sentence
from mocobot_logs.table.stamps import from_numbers
from mocobot_logs.table.table import Block, Table, Wanted, rows_at_a_time

METADATA_NAME = "mocobot"
"""Array of one text: the JSON metadata of a recording (docs/recording.md)."""
MAX_HEADER_BYTES = 10_000
MAX_METADATA_BYTES = 1 << 20
MAX_WHOLE_BYTES = 1 << 30
"""Arrays in Fortran order do not come row by row; up to this size they are loaded whole."""


@dataclass(frozen=True)
class Array:
    """Header of one array in an archive.

    Attributes:
        member: its entry.
        dtype, shape, fortran: as numpy has them.
        start: where its data begin in the entry [B].
    """

    member: zipfile.ZipInfo
    dtype: np.dtype
    shape: tuple[int, ...]
    fortran: bool
    start: int

    @property
    def size(self) -> int:
        """Bytes of its data."""
        return self.dtype.itemsize * prod(self.shape)

    @property
    def row_shape(self) -> tuple[int, ...]:
        """Shape of one row."""
        return self.shape[1:]


class NpzTable(Table):
    """An NPZ archive as a ``Table``: every array of at least one dimension is a column, its first axis counts rows."""

    def __init__(self, path: Path, name: str) -> None:
        """Read the directory of the archive and the header of every array.

        Raises:
            InputError: the archive is damaged, or a header claims what is not there.
        """
        self.name, self._path = name, path
        with self._opened() as archive:
            self._arrays = {key: array for key, array in self._headers(archive)}
            self.metadata = self._read_metadata(archive)
        self.shapes: Mapping[str, tuple[int, ...]] = {
            key: array.row_shape for key, array in self._arrays.items() if array.shape
        }
        self.size = max((array.shape[0] for array in self._arrays.values() if array.shape), default=0)

    def blocks(self, wanted: Wanted, advance: Callable[[int], object]) -> Iterator[Block]:
        """Rows in step, see ``Table.blocks``.

        Raises:
            InputError: the archive is damaged, or an array does not hold numbers or has another number of rows.
        """
        names = list(dict.fromkeys([*wanted.clocks, *wanted.columns]))
        rows = self._rows(names)
        at_a_time = rows_at_a_time(sum(prod(self._arrays[name].row_shape) for name in names))
        with self._opened() as archive, ExitStack() as stack:
            readers = {name: self._reader(archive, name, stack) for name in names}
            for row in range(0, rows, at_a_time):
                count = min(at_a_time, rows - row)
                read = {name: reader(count) for name, reader in readers.items()}
                yield Block(
                    {name: read[name] for name in wanted.columns},
                    {
                        name: from_numbers(
                            read[name].reshape(count), wanted.unit_ns, f"{self.name}: array {name!r}", row
                        )
                        for name in wanted.clocks
                    },
                )
                advance(count)

    def _rows(self, names: list[str]) -> int:
        rows, unpacked = self._arrays[names[0]].shape[0], Unpacked(self.name, self._path.stat().st_size)
        for name in names:
            array = self._arrays[name]
            if array.dtype.kind not in "iuf":
                raise InputError(f"{self.name}: array {name!r} holds {array.dtype}; it must hold numbers")
            if array.shape[0] != rows:
                raise InputError(
                    f"{self.name}: array {name!r} has {array.shape[0]} rows, but {names[0]!r} has {rows}; "
                    "all must have as many"
                )
            unpacked.add(array.size)
            if _is_columnwise(array) and array.size > MAX_WHOLE_BYTES:
                raise InputError(
                    f"{self.name}: array {name!r} is in Fortran order and larger than {MAX_WHOLE_BYTES >> 30} GiB; "
                    "save it in C order (numpy.ascontiguousarray)"
                )
        return rows

    def _reader(self, archive: zipfile.ZipFile, name: str, stack: ExitStack) -> Callable[[int], NDArray]:
        """What reads the next rows of one array."""
        array = self._arrays[name]
        file = stack.enter_context(archive.open(array.member))
        read_exactly(file, array.start)
        if _is_columnwise(array):
            whole = np.frombuffer(read_exactly(file, array.size), array.dtype).reshape(array.shape, order="F")
            done = 0

            def next_loaded(count: int) -> NDArray:
                nonlocal done
                done += count
                return whole[done - count : done]

            return next_loaded

        def next_read(count: int) -> NDArray:
            raw = read_exactly(file, count * array.dtype.itemsize * prod(array.row_shape))
            return np.frombuffer(raw, array.dtype).reshape(count, *array.row_shape)

        return next_read

    def _headers(self, archive: zipfile.ZipFile) -> Iterator[tuple[str, Array]]:
        seen: set[str] = set()
        for member in archive.infolist():
            if not member.filename.endswith(".npy"):
                continue
            name = member.filename.removesuffix(".npy")
            if name in seen:
                raise InputError(f"{self.name}: array {name!r:.60} is in the archive twice")
            seen.add(name)
            with archive.open(member) as file:
                yield name, _header(member, file, f"{self.name}: array {name!r:.60}")

    def _read_metadata(self, archive: zipfile.ZipFile) -> RecordingMetadata | None:
        array = self._arrays.get(METADATA_NAME)
        if array is None:
            return None
        if array.shape != () or array.dtype.kind != "U" or array.size > MAX_METADATA_BYTES:
            raise InputError(
                f"{self.name}: array {METADATA_NAME!r} must be one text, the recording's metadata"
            )
        with archive.open(array.member) as file:
            read_exactly(file, array.start)
            text = str(np.frombuffer(read_exactly(file, array.size), array.dtype)[0])
        return RecordingMetadata.from_json(text, where=f"{self.name}: metadata")

    @contextmanager
    def _opened(self) -> Iterator[zipfile.ZipFile]:
        with told_in_one_sentence(self.name, "NPZ archive"), zipfile.ZipFile(self._path) as archive:
            refuse_other_packing(archive, self.name)
            yield archive


def _header(member: zipfile.ZipInfo, file: IO[bytes], where: str) -> Array:
    """Header of one array, checked against the size of its entry."""
    start = read_exactly(file, 8)
    if start[:6] != b"\x93NUMPY" or start[6] not in (1, 2):
        raise InputError(f"{where} is not in numpy's format 1.0 or 2.0")
    width = 2 if start[6] == 1 else 4
    length_bytes = read_exactly(file, width)
    length = int.from_bytes(length_bytes, "little")
    if length > MAX_HEADER_BYTES:
        raise InputError(f"{where} has a header of {length} bytes; it may have {MAX_HEADER_BYTES}")
    text = io.BytesIO(length_bytes + read_exactly(file, length))
    read = np.lib.format.read_array_header_1_0 if start[6] == 1 else np.lib.format.read_array_header_2_0
    shape, fortran, dtype = read(text, max_header_size=MAX_HEADER_BYTES)
    array = Array(member, dtype, shape, fortran, 8 + width + length)
    if dtype.hasobject:
        raise InputError(f"{where} holds Python objects, which are never loaded; save it as numbers")
    if any(length < 0 for length in shape) or array.start + array.size != member.file_size:
        raise InputError(
            f"{where} claims the shape {shape!s:.80} of {dtype!s:.40}, {array.size} bytes, but has "
            f"{member.file_size - array.start}"
        )
    return array


def _is_columnwise(array: Array) -> bool:
    return array.fortran and len(array.shape) > 1


def read_exactly(file: IO[bytes], count: int) -> bytes:
    """So many bytes, or an EOFError."""
    content = file.read(count)
    if len(content) < count:
        raise EOFError(f"{len(content)} of {count} bytes are there")
    return content

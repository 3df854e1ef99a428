"""NPZ archives of numpy arrays: headers checked before anything is allocated, then read in step; never a pickle."""

import io
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from estimator.files import refuse_other_packing
from estimator.recording.metadata import RecordingMetadata
from mocobot_logs.faults import told_in_one_sentence
from mocobot_logs.table.arrays import ArrayTable, Stored, read_exactly

METADATA_NAME = "mocobot"
"""Array of one text: the JSON metadata of a recording (docs/recording.md)."""
MAX_HEADER_BYTES = 10_000
MAX_METADATA_BYTES = 1 << 20


class NpzTable(ArrayTable):
    """An NPZ archive as a ``Table``: every array of at least one dimension is a column."""

    noun, kind = "array", "NPZ archive"

    def __init__(self, path: Path, name: str) -> None:
        """Read the directory of the archive and the header of every array.

        Raises:
            InputError: the archive is damaged, or a header claims what is not there.
        """
        self.name, self._path, self.stored_bytes = name, path, path.stat().st_size
        with self._opened() as archive:
            self.arrays = {key: array for key, array in self._headers(archive)}
            self.metadata = self._read_metadata(archive)
        self.shapes: Mapping[str, tuple[int, ...]] = {
            key: array.row_shape for key, array in self.arrays.items() if array.shape
        }
        self.size = max((array.shape[0] for array in self.arrays.values() if array.shape), default=0)

    def readers(self, names: Sequence[str], stack: ExitStack) -> dict[str, Callable[[int], NDArray]]:
        """See ``ArrayTable.readers``."""
        archive = stack.enter_context(self._opened())
        return {
            name: self.arrays[name].reader(stack.enter_context(archive.open(self.arrays[name].at)))
            for name in names
        }

    def _headers(self, archive: zipfile.ZipFile) -> Iterator[tuple[str, Stored]]:
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
        array = self.arrays.get(METADATA_NAME)
        if array is None:
            return None
        if array.shape != () or array.dtype.kind != "U" or array.size > MAX_METADATA_BYTES:
            raise InputError(
                f"{self.name}: array {METADATA_NAME!r} must be one text, the recording's metadata"
            )
        with archive.open(array.at) as file:
            read_exactly(file, array.start)
            text = str(np.frombuffer(read_exactly(file, array.size), array.dtype)[0])
        return RecordingMetadata.from_json(text, where=f"{self.name}: metadata")

    @contextmanager
    def _opened(self) -> Iterator[zipfile.ZipFile]:
        with told_in_one_sentence(self.name, self.kind), zipfile.ZipFile(self._path) as archive:
            refuse_other_packing(archive, self.name)
            yield archive


def _header(member: zipfile.ZipInfo, file: IO[bytes], where: str) -> Stored:
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
    array = Stored(member, dtype, shape, fortran, 8 + width + length)
    if dtype.hasobject:
        raise InputError(f"{where} holds Python objects, which are never loaded; save it as numbers")
    if any(length < 0 for length in shape) or array.start + array.size != member.file_size:
        raise InputError(
            f"{where} claims the shape {shape!s:.80} of {dtype!s:.40}, {array.size} bytes, but has "
            f"{member.file_size - array.start}"
        )
    return array

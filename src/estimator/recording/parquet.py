"""Read and write the Parquet file of a recording (docs/recording.md)."""

import contextlib
import difflib
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from estimator.arm.delta import joints_of, wrist_fault
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.files import whole_file
from estimator.inputs import Unpacked
from estimator.recording.checks import check_finite, check_recording
from estimator.recording.metadata import RecordingMetadata
from estimator.recording.model import CHANNELS, OPTIONAL, Recording

METADATA_KEY = b"mocobot"


def write_recording(recording: Recording, path: Path | str) -> None:
    """Write a recording as Parquet; an existing file is replaced only when the new one is complete.

    Raises:
        InputError: the target cannot be written, the metadata are invalid, or the level is "wrist" and some driven
            angles have no wrist position.
    """
    path = Path(path)
    metadata = {METADATA_KEY: recording.metadata.to_json().encode()}
    table = pa.table(
        {name: np.ascontiguousarray(values) for name, values in recording.file_columns().items()}
    )
    with whole_file(path) as temporary:
        # Measured samples rarely repeat, so dictionaries waste space; checksums detect damaged pages.
        pq.write_table(
            table.replace_schema_metadata(metadata), temporary, use_dictionary=False, write_page_checksum=True
        )


def read_recording(path: Path | str) -> Recording:
    """Read and check a recording (see ``check_recording`` for the checks of the samples).

    Raises:
        InputError: the file cannot be read, is not a recording, or its content is not plausible.
    """
    path = Path(path)
    with _opened(path) as file:
        schema = file.schema_arrow
        text = (schema.metadata or {}).get(METADATA_KEY)
        if text is None:
            raise InputError(
                f"{path}: not a recording, the schema metadata has no key {METADATA_KEY.decode()!r}"
            )
        metadata = RecordingMetadata.from_json(text, where=f"{path}: metadata")
        _check_column_names(schema.names, metadata, path)
        if file.metadata.num_rows == 0:
            raise InputError(f"{path}: the file has no rows")
        for field in schema:
            _check_type(field, path)
        claimed = claimed_bytes(path, schema.names, schema.names)
        Unpacked(str(path), path.stat().st_size).add(
            max(claimed, 8 * file.metadata.num_rows * len(schema.names))
        )
        time, arrays = _read_columns(file, metadata)
    if metadata.level == "wrist":
        named = {
            f"omnid{robot + 1}.{name}": arrays[field][:, robot, k]
            for field, names in CHANNELS["wrist"].items()
            for k, name in enumerate(names)
            for robot in range(metadata.robots if field in arrays else 0)
        }
        check_finite(str(path), {"time": time} | named)
        arrays["phi"], arrays["tau"] = _joints(arrays.pop("h"), arrays.pop("force"), metadata, path)
    ref = arrays.pop("ref", None)
    recording = Recording(time=time, ref=ref, metadata=metadata, name=str(path), **arrays)
    check_recording(recording)
    return recording


def _read_columns(file: pq.ParquetFile, metadata: RecordingMetadata) -> tuple[Array, dict[str, Array]]:
    """Read time (Q,) and the fields, each (Q, N, 3), one column at a time to save memory."""
    rows, names = file.metadata.num_rows, set(file.schema_arrow.names)

    def column(name: str) -> Array:
        read = file.read(columns=[name], use_threads=False).column(name)
        # Empty cells become NaN, which the checks report with their row.
        return read.cast(pa.float64(), safe=False).to_numpy()

    arrays: dict[str, Array] = {}
    for field, suffixes in CHANNELS[metadata.level].items():
        if f"omnid1.{suffixes[0]}" in names:
            arrays[field] = np.empty((rows, metadata.robots, 3))
            for robot in range(metadata.robots):
                for k, suffix in enumerate(suffixes):
                    arrays[field][:, robot, k] = column(f"omnid{robot + 1}.{suffix}")
    return column("time").copy(), arrays


def _joints(h: Array, force: Array, metadata: RecordingMetadata, path: Path) -> tuple[Array, Array]:
    """Replace wrist positions and forces by driven angles and torques, robot by robot to save memory."""
    for robot in range(metadata.robots):
        fault = wrist_fault(h[:, robot], metadata.design)
        if fault is not None:
            (row,), sentence = fault
            in_mm = np.abs(h).max() > 2.0 and wrist_fault(1e-3 * h[:, robot], metadata.design) is None
            hint = (
                "the values look like millimetres"
                if in_mm
                else "are zero, signs and order of its axes right?"
            )
            raise InputError(f"{path}: omnid{robot + 1}.h_x, .h_y, .h_z in row {row}: {sentence} - {hint}")
        h[:, robot], force[:, robot] = joints_of(h[:, robot], force[:, robot], metadata.design)
    return h, force


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[pq.ParquetFile]:
    """Open the file; convert errors inside the block to one sentence."""
    try:
        exists, is_file = path.exists(), path.is_file()
    except (OSError, ValueError) as error:  # a name too long for the system, or with a NUL in it
        raise InputError(f"{str(path)!r:.80}: not a usable file name ({error})") from error
    if not exists:
        raise InputError(f"{path}: there is no such file")
    if not is_file:
        what = "a directory" if path.is_dir() else "not a regular file"
        raise InputError(f"{path}: is {what}; it must be a recording file")
    try:
        # read_table would turn folder names such as a=1 into extra columns. Pre-buffering would keep whole row groups.
        with pq.ParquetFile(path, page_checksum_verification=True, pre_buffer=False) as file:
            yield file
    except InputError:
        raise
    except PermissionError as error:
        raise InputError(f"{path}: cannot be read (permission denied)") from error
    except Exception as error:  # pyarrow raises many types for damaged bytes, not only its own
        detail = (str(error).splitlines() or [type(error).__name__])[0]
        raise InputError(f"{path}: not a readable Parquet file, or a damaged one ({detail})") from error


def _check_column_names(names: list[str], metadata: RecordingMetadata, path: Path) -> None:
    robots, channels = metadata.robots, CHANNELS[metadata.level]

    def of_robots(*fields: str) -> list[str]:
        # Each robot has several columns, so len(names) limits an absurd number of robots.
        spelled = range(1, min(robots, len(names)) + 1)
        return [f"omnid{i}.{s}" for i in spelled for field in fields for s in channels[field]]

    required = ["time", *of_robots(*(field for field in channels if field not in OPTIONAL))]
    valid = {*required, *of_robots(*OPTIONAL)}
    for optional in (of_robots(field) for field in OPTIONAL):
        if any(name in optional for name in names):
            required += optional
    suffixes = ", ".join(s for group in channels.values() for s in group)
    of_level = f" at {metadata.level} level" if metadata.level != "joint" else ""
    rule = f"the columns{of_level} are time and, for i = 1..{robots}, omnid{{i}}. followed by {suffixes}"
    for name in names:
        if name not in valid:
            close = difflib.get_close_matches(name, sorted(valid), n=1)
            hint = f" (did you mean {close[0]!r}?)" if close else ""
            raise InputError(f"{path}: unknown column {name!r}{hint}; {rule}")
        if names.count(name) > 1:
            raise InputError(f"{path}: column {name!r} appears {names.count(name)} times; {rule}")
    for name in required:
        if name not in names:
            raise InputError(
                f"{path}: missing column {name!r}; {rule} (ref_* and base_* for all robots or for none)"
            )


def _check_type(field: pa.Field, path: Path) -> None:
    kind = field.type
    if not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind)):
        raise InputError(f"{path}: column {field.name!r} holds {kind}; it must hold numbers (float64)")


_TAIL_BYTES, _HEADER_BYTES = 8, 16 << 10
"""Length of the footer's size and magic number; longest page header, which holds at most two values of the column."""
_GROUPS, _COLUMNS, _METADATA = 4, 1, 3
_VALUES, _UNPACKED, _PACKED, _DATA, _DICTIONARY = 5, 6, 7, 9, 11  # of a column in a group
_PAGE_UNPACKED, _PAGE_PACKED = 2, 3


def claimed_bytes(path: Path, columns: Sequence[str], names: Collection[str]) -> int:
    """Return the largest unpacked size of columns, including lists in them, by page headers, footer, or value count.

    A reader allocates a whole page as its header says (33 kB may claim half a gigabyte) and values as the footer says.
    Either may be wrong. Both are structures of Thrift's compact protocol with numbered fields
    (https://github.com/apache/parquet-format, ``parquet.thrift``). pyarrow does not report page sizes, and it may end
    the process when it reads columns of a damaged footer.

    Args:
        path: the file.
        columns: paths of its columns, in the order of its schema.
        names: columns and lists to read.

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
    end = at + column[_PACKED] if column[_VALUES] else 0  # readers skip pages of an empty column
    while at < end:
        file.seek(at)
        header, length = _structure(file.read(_HEADER_BYTES), 0)
        total += max(header[_PAGE_UNPACKED], 0)
        at += length + max(header[_PAGE_PACKED], 0)
    return total


def _structure(data: bytes, at: int) -> tuple[dict[int, Any], int]:
    """Return the values of a structure by field number, and its end."""
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
        case 1 | 2 | 3:  # a boolean in a list, or a byte
            at += 1
        case 4 | 5 | 6:
            number, at = _unsigned(data, at)
            value = (number >> 1) ^ -(number & 1)
        case 7:
            at += 8
        case 8:  # bytes after their length
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

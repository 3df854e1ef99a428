"""Parquet tables, mocobot's own recordings among them: read as they are, so that broken ones can be looked at."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from estimator.errors import InputError
from estimator.inputs import Unpacked
from estimator.recording.metadata import RecordingMetadata
from estimator.recording.parquet import METADATA_KEY, claimed_bytes
from mocobot_logs.faults import told_in_one_sentence
from mocobot_logs.log import Stamps
from mocobot_logs.table.stamps import from_numbers
from mocobot_logs.table.table import Block, Table, Wanted, rows_at_a_time

KIND = "Parquet file"
Clock = tuple[Stamps, NDArray[np.bool_]]


class ParquetTable(Table):
    """A Parquet file as a ``Table``.

    Columns may hold numbers or lists of always as many numbers; time may also be a timestamp, whose unit is its own.
    """

    def __init__(self, path: Path, name: str) -> None:
        """Look at the file's footer.

        Raises:
            InputError: the file cannot be read.
        """
        self._path = path
        with opened(path, name) as file:
            rows, schema = file.metadata.num_rows, file.schema_arrow
            check_names(schema, name)
        self._set_up(name, schema, rows, rows, path.stat().st_size)

    def _set_up(self, name: str, schema: pa.Schema, size: int, rows: int, stored_bytes: int) -> None:
        """Take the columns.

        Args:
            name: what to call the table in messages.
            schema: its columns.
            size: number of its rows.
            rows: number of rows to go through for them.
            stored_bytes: what these take.
        """
        self.name, self.size = name, size
        self._schema, self._rows, self._stored_bytes = schema, rows, stored_bytes
        text = (schema.metadata or {}).get(METADATA_KEY)
        where = f"{name}: metadata"
        told = None if text is None else RecordingMetadata.from_json(text, where=where)
        self.metadata: RecordingMetadata | None = told
        # Rows without any value are part of a broken recording, which is to be seen as it is.
        self.sparse = self.metadata is None
        self.shapes: Mapping[str, tuple[int, ...]] = self._row_shapes()

    def blocks(self, wanted: Wanted, advance: Callable[[int], object]) -> Iterator[Block]:
        """Rows in the order of the file, see ``Table.blocks``.

        Raises:
            InputError: the file is damaged, or holds what is not a number.
        """
        names = list(dict.fromkeys([*wanted.columns, *wanted.clocks]))
        for name in names:
            self._check_type(name, time=name in wanted.clocks)
        cells = sum(int(np.prod(self.shapes[name], dtype=np.int64)) for name in names)
        self._check(names, 8 * cells * self._rows)
        row = 0
        for batch in self._batches(names, rows_at_a_time(cells)):
            yield self._block(batch, wanted, row)
            row += batch.num_rows
            advance(batch.num_rows)
        pa.default_memory_pool().release_unused()

    def _check(self, names: list[str], claimed: int) -> None:
        """Refuse columns that unpack to too much by another claim, or by what the files say."""
        with told_in_one_sentence(self.name, KIND):
            told = sum(claimed_bytes(path, _columns(schema), names) for path, schema in self._files())
            Unpacked(self.name, self._stored_bytes).add(max(claimed, told))

    def _files(self) -> Iterator[tuple[Path, pq.ParquetSchema]]:
        with opened(self._path, self.name) as file:
            yield self._path, file.schema

    def _batches(self, names: list[str], rows: int) -> Iterator[pa.RecordBatch]:
        with opened(self._path, self.name) as file:
            yield from file.iter_batches(rows, columns=names, use_threads=False)

    def _block(self, batch: pa.RecordBatch, wanted: Wanted, row: int) -> Block:
        def where(name: str) -> str:
            return f"{self.name}: column {name!r}"

        return Block(
            {name: numbers(batch.column(name), self.shapes[name], where(name)) for name in wanted.columns},
            {
                name: _clock(batch.column(name), self.shapes[name], wanted.unit_ns, where(name), row)
                for name in wanted.clocks
            },
        )

    def _check_type(self, name: str, *, time: bool) -> None:
        kind = _innermost(self._schema.field(name).type)
        if not (_is_number(kind) or (time and pa.types.is_timestamp(kind))):
            raise InputError(f"{self.name}: column {name!r} holds {kind}; it must hold numbers")

    def _row_shapes(self) -> dict[str, tuple[int, ...]]:
        """Lists whose length the schema does not fix are measured in the first row."""
        shapes = {field.name: _fixed_shape(field.type) for field in self._schema}
        open_names = [
            n for n, s in shapes.items() if s is None and _is_number(_innermost(self._schema.field(n).type))
        ]
        if open_names:
            self._check(open_names, 0)
        if open_names and (first := next(self._batches(open_names, 1), None)) is not None and len(first):
            shapes |= {name: np.shape(first.column(name)[0].as_py()) for name in open_names}
        return {name: shape or () for name, shape in shapes.items()}


@contextmanager
def opened(path: Path, name: str) -> Iterator[pq.ParquetFile]:
    """A Parquet file, whose every failure inside the block becomes one sentence.

    Raises:
        InputError: the file is not Parquet, or damaged, or cannot be read.
    """
    # Not pre-buffered: that would hold a whole row group, which may be a whole log.
    with (
        told_in_one_sentence(name, KIND),
        pq.ParquetFile(path, page_checksum_verification=True, pre_buffer=False, buffer_size=1 << 20) as file,
    ):
        yield file


def check_names(schema: pa.Schema, name: str) -> None:
    """Every column has a name of its own; they become text here, inside a block that tells damage in one sentence.

    Raises:
        InputError: a name is there twice.
        UnicodeDecodeError: one is no text.
    """
    names = schema.names
    repeated = next((n for n in names if names.count(n) > 1), None)
    if repeated is not None:
        raise InputError(f"{name}: column {repeated!r:.80} appears more than once")


def is_recording(path: Path) -> bool:
    """Whether a Parquet file says that it is a recording.

    Raises:
        InputError: it cannot be read.
    """
    with opened(path, str(path)) as file:
        return METADATA_KEY in (file.schema_arrow.metadata or {})


def numbers(column: pa.Array, shape: tuple[int, ...], where: str) -> NDArray:
    """A column as an array (q, *shape) of whole numbers or floats, NaN where a row is empty.

    Raises:
        InputError: a row does not have that shape.
    """
    rows = len(column)
    given = column.is_valid().to_numpy(zero_copy_only=False)
    flat = column if given.all() else column.drop_null()
    for length in shape:
        if not pa.types.is_fixed_size_list(flat.type) and np.any(
            flat.value_lengths().to_numpy(zero_copy_only=False) != length
        ):
            raise InputError(f"{where} has rows of different lengths; all must have the shape {shape}")
        flat = flat.flatten()
    if pa.types.is_decimal(flat.type) or flat.null_count:
        flat = flat.cast(pa.float64(), safe=False)
    filled = flat.to_numpy(zero_copy_only=False)
    if len(filled) != given.sum() * int(np.prod(shape, dtype=np.int64)):
        raise InputError(f"{where} has rows of different lengths; all must have the shape {shape}")
    filled = filled.reshape(-1, *shape)
    if given.all():
        return filled
    whole = np.full((rows, *shape), np.nan)
    whole[given] = filled
    return whole


def _clock(column: pa.Array, shape: tuple[int, ...], unit_ns: int | None, where: str, row: int) -> Clock:
    if pa.types.is_timestamp(column.type):
        given = column.is_valid().to_numpy(zero_copy_only=False)
        ns = column.cast(pa.timestamp("ns", column.type.tz)).cast(pa.int64()).fill_null(0)
        return ns.to_numpy(zero_copy_only=False), given
    return from_numbers(numbers(column, shape, where).reshape(len(column)), unit_ns, where, row)


def _columns(schema: pq.ParquetSchema) -> list[str]:
    return [schema.column(k).path for k in range(len(schema))]


def _is_number(kind: pa.DataType) -> bool:
    return pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind)


def _innermost(kind: pa.DataType) -> pa.DataType:
    while _is_list(kind):
        kind = kind.value_type
    return kind


def _is_list(kind: pa.DataType) -> bool:
    return pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)


def _fixed_shape(kind: pa.DataType) -> tuple[int, ...] | None:
    shape: list[int] = []
    while _is_list(kind):
        if not pa.types.is_fixed_size_list(kind):
            return None
        shape.append(kind.list_size)
        kind = kind.value_type
    return tuple(shape)

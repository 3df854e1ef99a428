"""Parquet tables, including mocobot's recordings, and LeRobot datasets of version 3.

Recordings are read without checks, so that broken ones can be inspected. A LeRobot dataset is a folder with
``meta/info.json`` and Parquet files under ``data``; one episode is a table. Features are columns of lists whose
elements ``meta/info.json`` names. Several episodes may share a file. Time is ``timestamp``, 32-bit seconds from the
episode's start, defined as ``frame_index / fps`` (``lerobot/datasets/dataset_writer.py``). Every error is an
``InputError`` that names the file and the column.
"""

import json
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds
import pyarrow.parquet as pq
from numpy.typing import NDArray

from estimator.errors import InputError
from estimator.inputs import Unpacked, plain
from estimator.recording.metadata import RecordingMetadata
from estimator.recording.parquet import METADATA_KEY, claimed_bytes
from mocobot_logs.formats import DATASET_INFO, dataset_root, detail_of, read_small, told_in_one_sentence
from mocobot_logs.log import Stamps
from mocobot_logs.table.table import Block, Table, Wanted, rows_at_a_time
from mocobot_logs.table.text import LARGEST_NS, from_numbers

KIND = "Parquet file"
Clock = tuple[Stamps, NDArray[np.bool_]]


class ParquetTable(Table):
    """A Parquet file as a ``Table``.

    Columns hold numbers or lists of fixed length. Time may also be a timestamp, which has its own unit.
    """

    def __init__(self, path: Path, name: str) -> None:
        self._path = path
        with opened(path, name) as file:
            rows, schema = file.metadata.num_rows, file.schema_arrow
            check_names(schema, name)
        self._set_up(name, schema, rows, rows, path.stat().st_size)

    def _set_up(self, name: str, schema: pa.Schema, size: int, rows: int, stored_bytes: int) -> None:
        """Set up the columns; ``size`` rows are wanted among ``rows`` rows that must be read."""
        self.name, self.size = name, size
        self._schema, self._rows, self._stored_bytes = schema, rows, stored_bytes
        text = (schema.metadata or {}).get(METADATA_KEY)
        where = f"{name}: metadata"
        told = None if text is None else RecordingMetadata.from_json(text, where=where)
        self.metadata: RecordingMetadata | None = told
        # Rows without any value belong to a broken recording, which is inspected as it is.
        self.sparse = self.metadata is None
        self.shapes: Mapping[str, tuple[int, ...]] = self._row_shapes()

    def blocks(self, wanted: Wanted, advance: Callable[[int], object]) -> Iterator[Block]:
        names = list(dict.fromkeys([*wanted.columns, *wanted.clocks]))
        for name in names:
            self._check_type(name, time=name in wanted.clocks)
        cells = sum(int(np.prod(self.shapes[name], dtype=np.int64)) for name in names)
        self._check(names, 8 * cells * self._rows)
        row = 0
        for batch in self._batches(names, rows_at_a_time(cells)):
            clocks = {name: self._clock(batch, name, wanted.unit_ns, row) for name in wanted.clocks}
            yield Block({name: self._numbers(batch, name) for name in wanted.columns}, clocks)
            row += batch.num_rows
            advance(batch.num_rows)
        pa.default_memory_pool().release_unused()

    def _check(self, names: list[str], claimed: int) -> None:
        """Refuse columns that unpack to too many bytes, by ``claimed`` or by the files' own metadata."""
        with told_in_one_sentence(self.name, KIND):
            told = 0
            for path, schema in self._files():
                told += claimed_bytes(path, [schema.column(k).path for k in range(len(schema))], names)
            Unpacked(self.name, self._stored_bytes).add(max(claimed, told))

    def _files(self) -> Iterator[tuple[Path, pq.ParquetSchema]]:
        with opened(self._path, self.name) as file:
            yield self._path, file.schema

    def _batches(self, names: list[str], rows: int) -> Iterator[pa.RecordBatch]:
        with opened(self._path, self.name) as file:
            yield from file.iter_batches(rows, columns=names, use_threads=False)

    def _numbers(self, batch: pa.RecordBatch, name: str) -> NDArray:
        return numbers(batch.column(name), self.shapes[name], f"{self.name}: column {name!r}")

    def _clock(self, batch: pa.RecordBatch, name: str, unit_ns: int | None, row: int) -> Clock:
        column = batch.column(name)
        if pa.types.is_timestamp(column.type):
            given = column.is_valid().to_numpy(zero_copy_only=False)
            ns = column.cast(pa.timestamp("ns", column.type.tz)).cast(pa.int64()).fill_null(0)
            return ns.to_numpy(zero_copy_only=False), given
        values = self._numbers(batch, name).reshape(len(column))
        return from_numbers(values, unit_ns, f"{self.name}: column {name!r}", row)

    def _check_type(self, name: str, *, time: bool) -> None:
        kind = _innermost(self._schema.field(name).type)
        if not (_is_number(kind) or (time and pa.types.is_timestamp(kind))):
            raise InputError(f"{self.name}: column {name!r} holds {kind}; it must hold numbers")

    def _row_shapes(self) -> dict[str, tuple[int, ...]]:
        """Return the shape of one row of each column; lists of undeclared length are measured in the first row."""
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
    """Open a Parquet file; every failure inside the block becomes one sentence."""
    # Pre-buffering would hold a whole row group, which may be the whole log.
    with (
        told_in_one_sentence(name, KIND),
        pq.ParquetFile(path, page_checksum_verification=True, pre_buffer=False, buffer_size=1 << 20) as file,
    ):
        yield file


def check_names(schema: pa.Schema, name: str) -> None:
    """Refuse repeated column names; call it inside a block that reports damage, since names are decoded here."""
    names = schema.names
    repeated = next((n for n in names if names.count(n) > 1), None)
    if repeated is not None:
        raise InputError(f"{name}: column {repeated!r:.80} appears more than once")


def numbers(column: pa.Array, shape: tuple[int, ...], where: str) -> NDArray:
    """Return a column as an array (q, *shape) of integers or floats, NaN where a row is empty."""
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


def _is_number(kind: pa.DataType) -> bool:
    return pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind)


def _innermost(kind: pa.DataType) -> pa.DataType:
    while _is_list(kind):
        kind = kind.value_type
    return kind


def _is_list(kind: pa.DataType) -> bool:
    return pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)


def _fixed_shape(kind: pa.DataType) -> tuple[int, ...] | None:
    """Return the shape of a row, None if lists may have any length."""
    shape: list[int] = []
    while _is_list(kind):
        if not pa.types.is_fixed_size_list(kind):
            return None
        shape.append(kind.list_size)
        kind = kind.value_type
    return tuple(shape)


MAX_INFO_BYTES = 16 << 20
EPISODE, FRAME, TIMESTAMP = "episode_index", "frame_index", "timestamp"
NAME_COLUMNS = (EPISODE, "data/chunk_index", "data/file_index")
CLOSE_FRAMES = 0.01
"""Largest difference, in frames, at which a timestamp counts as the rounded value of ``frame_index / fps``."""
_DATA_PATH = re.compile(r"(?!/)([^{}]|\{(chunk_index|file_index)(:0[36]d)?\})+")
_SCAN = ds.ParquetFragmentScanOptions(
    use_buffered_stream=True, pre_buffer=False, page_checksum_verification=True
)

Files = Mapping[Path, set[int] | None]
"""Data files with their episodes, or None where the dataset does not list them."""


class LeRobotTable(ParquetTable):
    """One episode as a ``Table``.

    A number in a feature is named by index, ``observation.state[3]``, or by name, ``observation.state.NAME``. The
    name alone suffices if no other feature has it.
    """

    time_column = TIMESTAMP

    def __init__(self, path: Path, name: str, episode: int | None) -> None:
        """Find an episode in a dataset's folder or one of its files; ``episode`` may be None if there is only one."""
        root = dataset_root(path)
        if root is None:
            raise InputError(f"{name}: is not a LeRobot dataset, it has no {DATASET_INFO}")
        info = _read_info(root, name)
        files: Files = _data_files(root, info, name) if path.is_dir() else {path: None}
        self._fps = info["fps"]
        episode, chosen = _choose(files, episode, name)
        self._data = _dataset(chosen, name)
        for column in (EPISODE, FRAME, TIMESTAMP):
            if column not in self._data.schema.names:
                raise InputError(f"{name}: its Parquet files have no column {column!r}")
        self._filter = pc.field(EPISODE) == episode
        with told_in_one_sentence(name, KIND):
            size = self._data.count_rows(filter=self._filter)
        self._set_up(name, self._data.schema.remove_metadata(), size, *_extent(self._data))
        self.aliases: Mapping[str, tuple[str, tuple[int, ...]]] = _aliases(info["features"], self.shapes)

    def blocks(self, wanted: Wanted, advance: Callable[[int], object]) -> Iterator[Block]:
        """Yield rows of the episode, see ``Table.blocks``; rounded timestamps are replaced by ``frame_index / fps``."""
        for block in super().blocks(replace(wanted, columns=(*wanted.columns, FRAME)), advance):
            if TIMESTAMP in wanted.clocks:
                stamp, given = block.clocks[TIMESTAMP]
                exact = self._exact(stamp, block.columns[FRAME].reshape(-1))
                block = Block(block.columns, {**block.clocks, TIMESTAMP: (exact, given)})
            yield block

    def _files(self) -> Iterator[tuple[Path, pq.ParquetSchema]]:
        return ((Path(part.path), part.metadata.schema) for part in self._data.get_fragments())

    def _batches(self, names: list[str], rows: int) -> Iterator[pa.RecordBatch]:
        return _read(self._data, self.name, columns=names, filter=self._filter, batch_size=rows)

    def _exact(self, stamp: np.ndarray, frame: np.ndarray) -> np.ndarray:
        exact_ns = frame.astype(np.float64) * (1e9 / self._fps)
        if not np.all(np.abs(exact_ns) < LARGEST_NS):
            return stamp
        close = np.abs(stamp - exact_ns) < CLOSE_FRAMES * 1e9 / self._fps
        return np.rint(exact_ns).astype(np.int64) if close.all() else stamp


def _read_info(root: Path, name: str) -> dict[str, Any]:
    where = f"{name}: {DATASET_INFO}"
    content = read_small(root / DATASET_INFO, MAX_INFO_BYTES, where, "dataset's description")
    try:
        info = plain(json.loads(content))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where} cannot be read ({detail_of(error)})") from error
    if not isinstance(info, dict):
        raise InputError(f"{where} must be a JSON object, not {info!r:.60}")
    version = info.get("codebase_version")
    if not isinstance(version, str) or not version.startswith("v3."):
        raise InputError(
            f"{where}: codebase_version is {version!r:.40}; version 3 is read (LeRobot itself converts older datasets)"
        )
    fps = info.get("fps")
    if isinstance(fps, bool) or not isinstance(fps, int | float) or not 0 < fps <= 1e6:
        raise InputError(f"{where}: fps is {fps!r:.40}; it must be a number of frames per second, up to 1e6")
    features = info.get("features")
    if not isinstance(features, dict) or not all(isinstance(entry, dict) for entry in features.values()):
        raise InputError(f"{where}: features must be an object of objects")
    return info


def _data_files(root: Path, info: dict[str, Any], name: str) -> Files:
    """Return the data files with the episodes in each by ``meta/episodes``; without it, all files under ``data``."""
    files: dict[Path, set[int]] = {}
    listings = sorted((root / "meta" / "episodes").glob("*/*.parquet"))
    template = _template(info.get("data_path"), name) if listings else ""
    if listings:
        where = f"{name}: {listings[0].parents[1].relative_to(root)}"
        data = _dataset(listings, where)
        for column in NAME_COLUMNS:
            if column not in data.schema.names or not pa.types.is_integer(data.schema.field(column).type):
                raise InputError(f"{where} has no column {column!r} of whole numbers")
        for batch in _read(data, where, columns=list(NAME_COLUMNS)):
            for place in zip(*batch.to_pydict().values(), strict=True):
                if not all(type(value) is int and 0 <= value < 10**9 for value in place):
                    raise InputError(f"{where} holds {', '.join(f'{value!r:.40}' for value in place)}")
                episode, chunk, number = place
                path = root / template.format(chunk_index=chunk, file_index=number)
                files.setdefault(path, set()).add(episode)
    return files or dict.fromkeys(sorted((root / "data").glob("*/*.parquet")))


def _template(data_path: Any, name: str) -> str:
    """Return the dataset's pattern of file names; refuse one that could lead outside the dataset."""
    if not isinstance(data_path, str) or not _DATA_PATH.fullmatch(data_path) or ".." in Path(data_path).parts:
        raise InputError(
            f"{name}: {DATASET_INFO}: data_path is {data_path!r:.80}; it must be like "
            "'data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet'"
        )
    return data_path


def episodes_of(path: Path) -> list[int]:
    """Return the episodes of a LeRobot dataset, or of one of its files; at least one."""
    root, name = dataset_root(path), str(path)
    if root is None or not path.is_dir():
        return _every({path: None}, name)
    return _every(_data_files(root, _read_info(root, name), name), name)


def _every(files: Files, name: str) -> list[int]:
    if not files:
        raise InputError(f"{name}: has no Parquet files under data")
    told = [known for known in files.values() if known is not None]
    every = sorted(set[int]().union(*told) if told else _episodes_in(list(files), name))
    if not every:
        raise InputError(f"{name}: has no episodes")
    return every


def _choose(files: Files, episode: int | None, name: str) -> tuple[int, list[Path]]:
    every = _every(files, name)
    listed = f"{every[0]}" if len(every) == 1 else f"{every[0]} to {every[-1]}"
    if episode is None:
        if len(every) > 1:
            raise InputError(f"{name}: holds {len(every)} episodes, {listed}; say which one with --episode")
        episode = every[0]
    if episode not in every:
        raise InputError(f"{name}: there is no episode {episode}; it holds {len(every)}, {listed}")
    return episode, [path for path, known in files.items() if known is None or episode in known]


def _episodes_in(paths: list[Path], name: str) -> set[int]:
    data = _dataset(paths, name)
    if EPISODE not in data.schema.names or not pa.types.is_integer(data.schema.field(EPISODE).type):
        raise InputError(f"{name}: its Parquet files have no column {EPISODE!r} of whole numbers")
    batches = _read(data, name, columns=[EPISODE])
    return {n for batch in batches for n in batch.column(0).unique().to_pylist() if n is not None}


def _dataset(paths: list[Path], name: str) -> ds.Dataset:
    """Open files with the same columns as one dataset."""
    with told_in_one_sentence(name, KIND):
        data = ds.dataset(
            [str(path) for path in paths], format=ds.ParquetFileFormat(default_fragment_scan_options=_SCAN)
        )
        check_names(data.schema, name)
        if any(not part.physical_schema.equals(data.schema) for part in data.get_fragments()):
            raise InputError(f"{name}: its Parquet files have different columns")
        rows, stored_bytes = _extent(data)
    Unpacked(name, stored_bytes).add(8 * len(NAME_COLUMNS) * rows)
    return data


def _extent(data: ds.Dataset) -> tuple[int, int]:
    """Return the total number of rows and bytes of all files."""
    return data.count_rows(), sum(Path(file).stat().st_size for file in data.files)


def _read(data: ds.Dataset, name: str, **what: Any) -> Iterator[pa.RecordBatch]:
    """Yield batches in the order of the files with little memory; row groups of other episodes are skipped."""
    with told_in_one_sentence(name, KIND):
        yield from data.to_batches(**what, use_threads=False, batch_readahead=0, fragment_readahead=0)


def _aliases(
    features: Mapping[str, Mapping[str, Any]], shapes: Mapping[str, tuple[int, ...]]
) -> dict[str, tuple[str, tuple[int, ...]]]:
    aliases: dict[str, tuple[str, tuple[int, ...]]] = {}
    bare: dict[str, list[tuple[str, tuple[int, ...]]]] = {}
    for feature, entry in features.items():
        shape = shapes.get(feature)
        names = entry.get("names")
        if isinstance(names, dict) and len(names) == 1:  # {"motors": [...]}
            names = next(iter(names.values()))
        if shape is None or len(shape) > 1 or not isinstance(names, list) or len(names) != (shape or (1,))[0]:
            continue
        for k, name in enumerate(names):
            if isinstance(name, str) and names.count(name) == 1:
                place = feature, (k,) if shape else ()
                aliases[f"{feature}.{name}"] = place
                bare.setdefault(name, []).append(place)
    return {name: places[0] for name, places in bare.items() if len(places) == 1} | aliases

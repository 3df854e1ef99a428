"""LeRobot datasets, version 3: one episode of a folder with ``meta/info.json`` and Parquet files under ``data``.

Features are columns of lists; ``meta/info.json`` names their numbers. Several episodes share a file, and time is
``timestamp``, 32-bit seconds from the episode's start, by definition ``frame_index / fps``. (LeRobot's own writer,
``lerobot/datasets/dataset_writer.py``, is where that is laid down.)
"""

import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from estimator.errors import InputError
from estimator.inputs import Unpacked, plain
from mocobot_logs.faults import detail_of, read_small, told_in_one_sentence
from mocobot_logs.formats import DATASET_INFO, dataset_root
from mocobot_logs.table.parquet import KIND, ParquetTable, check_names
from mocobot_logs.table.stamps import LARGEST_NS
from mocobot_logs.table.table import Block, Wanted

MAX_INFO_BYTES = 16 << 20
EPISODE, FRAME, TIMESTAMP = "episode_index", "frame_index", "timestamp"
NAME_COLUMNS = (EPISODE, "data/chunk_index", "data/file_index")
CLOSE_FRAMES = 0.01
"""Of a frame: so far a timestamp may be from ``frame_index / fps`` and still be its rounded value."""
_DATA_PATH = re.compile(r"(?!/)([^{}]|\{(chunk_index|file_index)(:0[36]d)?\})+")
_SCAN = ds.ParquetFragmentScanOptions(
    use_buffered_stream=True, pre_buffer=False, page_checksum_verification=True
)

Files = Mapping[Path, set[int] | None]
"""Data files, each with its episodes where the dataset says."""


class LeRobotTable(ParquetTable):
    """One episode as a ``Table``.

    Numbers in a feature go by index, ``observation.state[3]``, or by name, ``observation.state.NAME``, or by the name
    alone where no other feature has it.
    """

    time_column = TIMESTAMP

    def __init__(self, path: Path, name: str, episode: int | None) -> None:
        """Look at the dataset's description and find the episode.

        Args:
            path: the dataset's folder, or one of its Parquet files.
            name: what to call it in messages.
            episode: which one; may be None if there is only one.

        Raises:
            InputError: it is no LeRobot dataset of version 3, or there is no such episode, or there are several.
        """
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
        """Rows of the episode, see ``Table.blocks``; rounded timestamps are replaced by ``frame_index / fps``.

        Raises:
            InputError: a file is damaged, or holds what is not a number.
        """
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
    """Data files and, where ``meta/episodes`` says so, the episodes in each; all under ``data`` otherwise."""
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
    """The dataset's own pattern of file names, unless it could lead anywhere else."""
    if not isinstance(data_path, str) or not _DATA_PATH.fullmatch(data_path) or ".." in Path(data_path).parts:
        raise InputError(
            f"{name}: {DATASET_INFO}: data_path is {data_path!r:.80}; it must be like "
            "'data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet'"
        )
    return data_path


def _choose(files: Files, episode: int | None, name: str) -> tuple[int, list[Path]]:
    if not files:
        raise InputError(f"{name}: has no Parquet files under data")
    told = [known for known in files.values() if known is not None]
    every = sorted(set[int]().union(*told) if told else _episodes_in(list(files), name))
    if not every:
        raise InputError(f"{name}: has no episodes")
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
    """Files of the same columns as one.

    Raises:
        InputError: a file cannot be read, their columns differ, or they claim more than measured samples can take.
    """
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
    """Number of rows and bytes of all files."""
    return data.count_rows(), sum(Path(file).stat().st_size for file in data.files)


def _read(data: ds.Dataset, name: str, **what: Any) -> Iterator[pa.RecordBatch]:
    """Batches in the order of the files, as few as possible in memory; row groups of other episodes are left out."""
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

"""LeRobot datasets, version 3: one episode of a folder with ``meta/info.json`` and Parquet files under ``data``.

Features are columns of lists; ``meta/info.json`` names their numbers. Several episodes share a file, and time is
``timestamp``, 32-bit seconds from the episode's start, by definition ``frame_index / fps``. (LeRobot's own writer,
``lerobot/datasets/dataset_writer.py``, is where that is laid down.)
"""

from __future__ import annotations

import json
import string
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from estimator.errors import InputError
from estimator.recording.metadata import RecordingMetadata
from mocobot_logs.faults import detail_of
from mocobot_logs.table.parquet import ParquetTable, opened
from mocobot_logs.table.stamps import LARGEST_NS
from mocobot_logs.table.table import Block

INFO = Path("meta") / "info.json"
MAX_INFO_BYTES = 16 << 20
EPISODE, FRAME, TIMESTAMP = "episode_index", "frame_index", "timestamp"
NAME_COLUMNS = (EPISODE, "data/chunk_index", "data/file_index")
CLOSE_FRAMES = 0.01
"""Of a frame: so far a timestamp may be from ``frame_index / fps`` and still be its rounded value."""

Files = Mapping[Path, set[int] | None]
"""Data files, each with its episodes where the dataset says."""


def dataset_root(path: Path) -> Path | None:
    """The dataset that a path is, or whose data file it is; None if it is neither."""
    for folder in (path, *(path.parents[2:3] if path.is_file() else ())):
        if (folder / INFO).is_file():
            return folder
    return None


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
            raise InputError(f"{name}: is not a LeRobot dataset, it has no {INFO}")
        info = _read_info(root, name)
        files: Files = _data_files(root, info, name) if path.is_dir() else {path: None}
        self._fps = info["fps"]
        self._episode, chosen = _choose(files, episode, name)
        super().__init__(chosen, name)
        self.metadata: RecordingMetadata | None = None
        self.sparse = True
        for column in (EPISODE, FRAME, TIMESTAMP):
            if column not in self.shapes:
                raise InputError(f"{name}: its Parquet files have no column {column!r}")
        self.aliases: Mapping[str, tuple[str, tuple[int, ...]]] = _aliases(info["features"], self.shapes)

    def blocks(
        self,
        columns: tuple[str, ...],
        clocks: tuple[str, ...],
        unit_ns: int,
        advance: Callable[[int], object],
    ) -> Iterator[Block]:
        """Rows of the episode, see ``Table.blocks``; rounded timestamps are replaced by ``frame_index / fps``.

        Raises:
            InputError: a file is damaged, or holds what is not a number.
        """
        extra = (EPISODE, FRAME) if TIMESTAMP in clocks else (EPISODE,)
        for block in super().blocks((*columns, *extra), clocks, unit_ns, advance):
            keep = block.columns[EPISODE].reshape(-1) == self._episode
            if not keep.any():
                continue
            stamps = {name: (stamp[keep], given[keep]) for name, (stamp, given) in block.clocks.items()}
            if TIMESTAMP in stamps:
                stamp, given = stamps[TIMESTAMP]
                stamps[TIMESTAMP] = self._exact(stamp, block.columns[FRAME].reshape(-1)[keep]), given
            yield Block({name: block.columns[name][keep] for name in columns}, stamps)

    def _exact(self, stamp: np.ndarray, frame: np.ndarray) -> np.ndarray:
        exact_ns = frame.astype(np.float64) * (1e9 / self._fps)
        if not np.all(np.abs(exact_ns) < LARGEST_NS):
            return stamp
        close = np.abs(stamp - exact_ns) < CLOSE_FRAMES * 1e9 / self._fps
        return np.rint(exact_ns).astype(np.int64) if close.all() else stamp


def _read_info(root: Path, name: str) -> dict[str, Any]:
    where = f"{name}: {INFO}"
    try:
        with (root / INFO).open("rb") as file:
            content = file.read(MAX_INFO_BYTES + 1)
        if len(content) > MAX_INFO_BYTES:
            raise InputError(f"{where} is larger than {MAX_INFO_BYTES >> 20} MiB")
        info = json.loads(content)
    except InputError:
        raise
    except (OSError, ValueError, RecursionError) as error:
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
    files: dict[Path, set[int] | None] = {}
    listings = sorted((root / "meta" / "episodes").glob("*/*.parquet"))
    template = _template(info.get("data_path"), name) if listings else ""
    for listing in listings:
        with opened(listing, f"{name}: {listing.relative_to(root)}") as file:
            missing = [column for column in NAME_COLUMNS if column not in file.schema_arrow.names]
            if missing:
                raise InputError(f"{name}: {listing.relative_to(root)} has no column {missing[0]!r}")
            rows = file.read(columns=list(NAME_COLUMNS)).to_pydict()
        for episode, chunk, number in zip(*(rows[column] for column in NAME_COLUMNS), strict=True):
            if not all(type(value) is int and 0 <= value < 10**9 for value in (episode, chunk, number)):
                raise InputError(
                    f"{name}: {listing.relative_to(root)} holds {episode!r}, {chunk!r}, {number!r:.40}"
                )
            path = root / template.format(chunk_index=chunk, file_index=number)
            found = files.setdefault(path, set())
            if found is not None:
                found.add(episode)
    return files or dict.fromkeys(sorted((root / "data").glob("*/*.parquet")))


def _template(data_path: Any, name: str) -> str:
    """The dataset's own pattern of file names, unless it could lead anywhere else."""
    valid = (
        isinstance(data_path, str) and not Path(data_path).is_absolute() and ".." not in Path(data_path).parts
    )
    if valid:
        try:
            fields = [
                (field, spec)
                for _, field, spec, _ in string.Formatter().parse(data_path)
                if field is not None
            ]
        except ValueError:
            fields = [("", "")]
        valid = all(f in ("chunk_index", "file_index") and (s or "") in ("", "03d", "06d") for f, s in fields)
    if not valid:
        raise InputError(
            f"{name}: {INFO}: data_path is {data_path!r:.80}; it must be like "
            "'data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet'"
        )
    return data_path


def _choose(files: Files, episode: int | None, name: str) -> tuple[int, list[Path]]:
    if not files:
        raise InputError(f"{name}: has no Parquet files under data")
    inside = {path: known if known is not None else _episodes_in(path, name) for path, known in files.items()}
    every = sorted({number for numbers in inside.values() for number in numbers})
    if not every:
        raise InputError(f"{name}: has no episodes")
    listed = f"{every[0]}" if len(every) == 1 else f"{every[0]} to {every[-1]}"
    if episode is None:
        if len(every) > 1:
            raise InputError(f"{name}: holds {len(every)} episodes, {listed}; say which one with --episode")
        episode = every[0]
    if episode not in every:
        raise InputError(f"{name}: there is no episode {episode}; it holds {len(every)}, {listed}")
    return episode, [path for path, numbers in inside.items() if episode in numbers]


def _episodes_in(path: Path, name: str) -> set[int]:
    with opened(path, name) as file:
        if EPISODE not in file.schema_arrow.names or not pa.types.is_integer(
            file.schema_arrow.field(EPISODE).type
        ):
            raise InputError(f"{name}: its Parquet files have no column {EPISODE!r} of whole numbers")
        found: set[int] = set()
        for batch in file.iter_batches(columns=[EPISODE], use_threads=False):
            found.update(number for number in batch.column(0).unique().to_pylist() if number is not None)
    return found


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

"""Any log by its path: what it is shows in its first bytes, or in what its folder holds."""

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Literal

from estimator.errors import InputError
from estimator.recording.metadata import RecordingMetadata
from estimator.recording.parquet import METADATA_KEY
from mocobot_logs.faults import detail_of
from mocobot_logs.log import LogSource
from mocobot_logs.map.files import CsvMap, LogMap, builtin_map
from mocobot_logs.map.parse import MAX_ROBOTS
from mocobot_logs.table.csv import CsvTable
from mocobot_logs.table.lerobot import LeRobotTable, dataset_root
from mocobot_logs.table.npz import NpzTable
from mocobot_logs.table.parquet import ParquetTable, opened
from mocobot_logs.table.table import Table, TableSource

Kind = Literal["bag", "csv", "npz", "parquet", "lerobot"]
TEXT_SUFFIXES = (".csv", ".tsv", ".txt")
FORMATS = (
    "a rosbag2 folder, .mcap or .db3, a CSV file (.csv, .tsv, .txt), an .npz archive, a .parquet file or a LeRobot "
    "dataset"
)


def open_log(path: Path | str, log_map: LogMap | None = None, episode: int | None = None) -> LogSource:
    """Open a log of any format.

    Args:
        path: a file or a folder.
        log_map: where its channels are; None for what mocobot itself writes, and for an Omnid's bags.
        episode: which episode of a LeRobot dataset; may be None if it holds only one.

    Raises:
        InputError: there is no such log, its format is not known, or the map does not suit it.
    """
    path = Path(path)
    kind = log_kind(path)
    if episode is not None and kind != "lerobot":
        raise InputError(f"{path}: is not a LeRobot dataset, so it has no episode {episode}")
    if kind == "bag":
        from mocobot_logs.bag.read import open_bag

        if log_map is not None:
            return open_bag(path, log_map)
        with draft_suggested(path):
            return open_bag(path)
    table = open_table(path, kind, (log_map or builtin_map("mocobot")).csv, episode)
    if log_map is not None or table.metadata is not None:
        return TableSource(table, log_map or _default_map(table))
    with draft_suggested(path):
        return TableSource(table, _default_map(table))


@contextmanager
def draft_suggested(path: Path) -> Iterator[None]:
    """A block in which a log is read without a map, and what is said if it cannot be.

    Raises:
        InputError: it cannot be.
    """
    try:
        yield
    except InputError as error:
        said = f"No map was given (--map): `mocobot map {shlex.quote(str(path))}` drafts one"
        raise InputError(f"{error}. {said}") from error


def log_kind(path: Path) -> Kind:
    """What a log is, by its first bytes or by what its folder holds.

    Raises:
        InputError: there is no such log, or its format is not known.
    """
    try:
        if not path.exists():
            raise InputError(f"{path}: there is no such file")
        if path.is_dir():
            if dataset_root(path) is not None:
                return "lerobot"
            if _is_bag(path):
                return "bag"
            raise InputError(f"{path}: is a directory, and neither a rosbag2 bag nor a LeRobot dataset")
        if not path.is_file():
            raise InputError(f"{path}: is not a regular file; a log is {FORMATS}")
        with path.open("rb") as file:
            head = file.read(4)
    except PermissionError as error:
        raise InputError(f"{path}: cannot be read (permission denied)") from error
    except (OSError, ValueError) as error:  # a name too long for the system, or with a NUL in it
        if isinstance(error, InputError):
            raise
        raise InputError(f"{str(path)!r:.80}: not a usable file name ({detail_of(error)})") from error
    if head == b"PAR1":
        return "lerobot" if _is_of_a_dataset(path) else "parquet"
    if head == b"PK\x03\x04" or head == b"PK\x05\x06":
        return "npz"
    suffix = path.suffix.lower()
    if suffix in TEXT_SUFFIXES:
        return "csv"
    if _is_bag(path):
        return "bag"
    if suffix in (".npz", ".parquet", ".mcap", ".db3"):
        raise InputError(
            f"{path}: is named {suffix}, but does not begin like one; it is damaged or something else"
        )
    raise InputError(f"{path}: is of no known format; a log is {FORMATS}")


def _is_bag(path: Path) -> bool:
    from mocobot_logs.bag.read import is_bag

    return is_bag(path)


def _is_of_a_dataset(path: Path) -> bool:
    """A data file in a dataset, unless it is a recording that merely lies there."""
    return dataset_root(path) is not None and not is_recording(path)


def is_recording(path: Path) -> bool:
    """Whether a Parquet file says that it is a recording.

    Raises:
        InputError: it cannot be read.
    """
    with opened(path, str(path)) as file:
        return METADATA_KEY in (file.schema_arrow.metadata or {})


def open_table(path: Path, kind: Kind, options: CsvMap, episode: int | None = None) -> Table:
    """Open a table of any format.

    Args:
        path: a file, or the folder of a dataset.
        kind: what it is, see ``log_kind``; no bag.
        options: how a text table is written.
        episode: as in ``open_log``.

    Raises:
        InputError: it is damaged, or the episode must be named.
    """
    name = str(path)
    if kind == "csv":
        return CsvTable(path, options, name)
    if kind == "npz":
        return NpzTable(path, name)
    if kind == "lerobot":
        return LeRobotTable(path, name, episode)
    return ParquetTable(path, name)


def _default_map(table: Table) -> LogMap:
    """The built-in map of what mocobot writes, by level and by whether channels are columns or arrays."""
    if table.metadata is not None:
        return _own_map(table, table.metadata)
    names = table.shapes.keys() | table.aliases.keys()
    arrays, wrist_arrays = {"phi", "theta", "tau"} <= names, {"h", "theta", "force"} <= names
    if isinstance(table, NpzTable) and (arrays or wrist_arrays):
        return builtin_map("mocobot-arrays" if arrays else "mocobot-arrays-wrist")
    wrist = "omnid1.h_x" in names and "omnid1.phi1" not in names
    return builtin_map("mocobot-wrist" if wrist else "mocobot")


def _own_map(table: Table, metadata: RecordingMetadata) -> LogMap:
    if metadata.robots > MAX_ROBOTS:
        raise InputError(
            f"{table.name}: metadata: robots is {metadata.robots}; at most {MAX_ROBOTS} are read"
        )
    name = "mocobot-arrays" if isinstance(table, NpzTable) else "mocobot"
    suffix = "-wrist" if metadata.level == "wrist" else ""
    return replace(builtin_map(name + suffix), robots=metadata.robots)

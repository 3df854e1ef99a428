"""Open any log by its path."""

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from estimator.errors import InputError
from estimator.recording.metadata import RecordingMetadata
from mocobot_logs.formats import Kind, log_kind
from mocobot_logs.log import LogSource, Readings
from mocobot_logs.maps import MAX_ROBOTS, CsvMap, LogMap, builtin_map
from mocobot_logs.table.arrays import MatTable, NpzTable
from mocobot_logs.table.parquet import LeRobotTable, ParquetTable
from mocobot_logs.table.table import Table, TableSource
from mocobot_logs.table.text import CsvTable


def open_log(path: Path | str, log_map: LogMap | None = None, episode: int | None = None) -> LogSource:
    """Open a log of any format; rows that repeat the previous reading are left out and counted.

    A map may be left out for files that mocobot writes and for an Omnid's bags, the episode for a dataset of one.
    """
    return Readings(_open(Path(path), log_map, episode))


def _open(path: Path, log_map: LogMap | None, episode: int | None) -> LogSource:
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
    """Add the advice to draft a map to errors inside the block, in which a log is read without a map."""
    try:
        yield
    except InputError as error:
        said = f"No map was given (--map): `mocobot map {shlex.quote(str(path))}` drafts one"
        raise InputError(f"{error}. {said}") from error


def open_table(path: Path, kind: Kind, options: CsvMap, episode: int | None = None) -> Table:
    """Open a table of any format but "bag" (see ``log_kind``): a file, or the folder of a dataset."""
    name = str(path)
    if kind == "csv":
        return CsvTable(path, options, name)
    if kind == "lerobot":
        return LeRobotTable(path, name, episode)
    return {"npz": NpzTable, "mat": MatTable}.get(kind, ParquetTable)(path, name)


def _default_map(table: Table) -> LogMap:
    """Return the built-in map of files that mocobot writes, by level and by columns or arrays."""
    if table.metadata is not None:
        return _own_map(table, table.metadata)
    names = table.shapes.keys() | table.aliases.keys()
    arrays, wrist_arrays = {"phi", "theta", "tau"} <= names, {"h", "theta", "force"} <= names
    if isinstance(table, NpzTable | MatTable) and (arrays or wrist_arrays):
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

"""The draft of a map for a log of any format."""

from pathlib import Path

from estimator.errors import InputError
from mocobot_logs.draft.candidates import Candidate, of_table
from mocobot_logs.draft.channels import find_channels
from mocobot_logs.draft.draft import Draft, put_together
from mocobot_logs.draft.time import time_lines
from mocobot_logs.formats import Kind, log_kind
from mocobot_logs.map.log_map import CsvMap
from mocobot_logs.open_log import open_table
from mocobot_logs.table.table import Table


def draft_of(path: Path, episode: int | None = None) -> Draft:
    """Draft a map.

    Args:
        path: a log of any format, whatever its names.
        episode: which episode of a LeRobot dataset; may be None if it holds only one.

    Raises:
        InputError: there is no such log, or it is damaged.
    """
    kind = log_kind(path)
    if kind == "bag":
        from mocobot_logs.draft.bag_candidates import of_bag

        candidates, unstamped = of_bag(path)
        found = find_channels(candidates)
        silent = any(c.place(c.name)["topic"] in unstamped for each in found.channels.values() for c in each)
        time = ["[time]", 'clock = "log"  # messages have no stamps of their own', ""] if silent else []
        return put_together(str(path), found, time)
    table, candidates, csv = opened(path, kind, episode)
    found = find_channels(candidates)
    return put_together(str(path), found, [*time_lines(table, candidates, found.robots), *csv])


def opened(path: Path, kind: Kind, episode: int | None) -> tuple[Table, list[Candidate], list[str]]:
    """A table, what its columns may be, and lines of a map that say how its text is written, if unlike most.

    Args:
        path: the log.
        kind: its format, as ``log_kind`` has it.
        episode: of a LeRobot dataset.

    Raises:
        InputError: there is no such log, or it is damaged.
    """
    table = open_table(path, kind, CsvMap(), episode)
    candidates = of_table(table)
    if kind == "csv" and not _has_values(candidates):
        try:
            other = open_table(path, kind, CsvMap(decimal=","))
            again = of_table(other)
        except InputError:  # its rows do not fit its header so
            return table, candidates, []
        if _has_values(again):
            return other, again, ["[csv]", 'decimal = ","', ""]
    return table, candidates, []


def _has_values(candidates: list[Candidate]) -> bool:
    return any(c.values is not None and len(c.values) for c in candidates if c.reading.group != "time")

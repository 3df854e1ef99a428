"""What a log has that may be a channel: names with the first values."""

from dataclasses import dataclass, replace

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_logs.draft.reading import JOINED, Reading, read_name
from mocobot_logs.table.csv import BrokenRowsError
from mocobot_logs.table.table import Table, Wanted

ROWS = 200_000
"""So many rows are looked at."""
_LONGEST_ARRAY = 64

Place = tuple[str, tuple[int, ...]]
"""A column, and the index in it."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A number that a log has in every row or message.

    Attributes:
        name: of a column; or topic, joint and field, or topic and field, with ``JOINED`` between them.
        keys: which keys of a map these are.
        reading: what the name says.
        values: the first ones, without NaN, or None where they could not be read.
    """

    name: str
    keys: tuple[str, ...]
    reading: Reading
    values: Array | None

    def place(self, name: str) -> dict[str, str]:
        """Keys and values of a map for the name, or for the name with a placeholder in it."""
        return dict(zip(self.keys, name.split(JOINED), strict=True))


def of_table(table: Table) -> list[Candidate]:
    """Candidates of a table.

    Raises:
        InputError: it is damaged.
    """
    places: dict[Place, str] = {}
    for column, shape in table.shapes.items():
        if np.prod(shape, dtype=object) == 1:
            places[column, (0,) * len(shape)] = column
    for alias, place in sorted(table.aliases.items(), key=lambda entry: len(entry[0])):
        places.setdefault(place, alias)
    for column, shape in table.shapes.items():
        if len(shape) == 1 and 1 < shape[0] <= _LONGEST_ARRAY:
            for k in range(shape[0]):
                places.setdefault((column, (k,)), f"{column}[{k}]")
    readings = {place: _reading(name, place) for place, name in places.items()}
    for column, shape in table.shapes.items():
        if len(shape) == 2 and shape[1] == 3 and shape[0] <= _LONGEST_ARRAY:
            for robot in range(shape[0]):
                for k in range(3):
                    places[column, (robot, k)] = f"{column}[{robot}, {k}]"
                    readings[column, (robot, k)] = _of_robots(column, robot, k)
    found = {place: reading for place, reading in readings.items() if reading is not None}
    if not found and places:
        _values(
            table, [next(iter(places))]
        )  # names of nothing: is the header none, with other rows below it?
    values = _values(table, [place for place, reading in found.items() if reading.group != "time"])
    for place, reading in found.items():
        if reading.group == "time":
            values |= _values(table, [place])
    return [
        Candidate(places[place], ("column",), reading, values.get(place)) for place, reading in found.items()
    ]


def _reading(name: str, place: Place) -> Reading | None:
    return read_name(name, element=bool(place[1]) and name.endswith("]"))


def _of_robots(column: str, robot: int, k: int) -> Reading | None:
    """Element of an array (N, 3): the first index counts robots."""
    reading, start = read_name(f"{column}[{k}]", element=True), len(column) + 1
    if reading is None:
        return None
    return replace(
        reading, rest=((start, start + len(str(robot))), *(r for r in reading.rest if r[1] < start))
    )


def _values(table: Table, places: list[Place]) -> dict[Place, Array]:
    """First values of some places; nothing of columns that hold no numbers.

    Raises:
        BrokenRowsError: no column can be read.
    """
    try:
        return _read(table, places)
    except BrokenRowsError:
        raise
    except InputError:
        found: dict[Place, Array] = {}
        for place in places:  # one of them: which?
            try:
                found |= _read(table, [place])
            except InputError:
                continue
        return found


def _read(table: Table, places: list[Place]) -> dict[Place, Array]:
    columns = tuple(dict.fromkeys(column for column, _ in places))
    parts: dict[Place, list[Array]] = {place: [] for place in places}
    rows = 0
    for block in table.blocks(Wanted(columns, (), 1), lambda _: None):
        for column, index in places:
            values = np.asarray(block.columns[column][(slice(None), *index)], float)
            parts[column, index].append(values[np.isfinite(values)])
            rows += len(values)
        if rows > ROWS * max(1, len(places)):
            break
    return {place: np.concatenate(each) if each else np.empty(0) for place, each in parts.items()}

"""Tables as logs: a map assigns the columns of any table to the robots' channels."""

import difflib
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from estimator.recording.metadata import RecordingMetadata
from mocobot_logs.formats import shown
from mocobot_logs.log import REF, Level, Samples, Stamps
from mocobot_logs.maps import ChannelMap, LogMap

SHOWN_COLUMNS = 12  # largest number of columns that a message lists
CELLS = 1 << 20  # approximate number of cells in memory at a time


@dataclass(frozen=True, eq=False)
class Block:
    """Consecutive rows of a table."""

    columns: Mapping[str, NDArray]  # values by column name, each of shape (q, ...)
    # by column name, stamps [ns] and whether each is present, shape (q,) each
    clocks: Mapping[str, tuple[Stamps, NDArray[np.bool_]]]


@dataclass(frozen=True)
class Wanted:
    columns: tuple[str, ...]  # names of columns read as numbers
    clocks: tuple[str, ...]  # names of columns read as time
    unit_ns: int | None  # nanoseconds per unit of time, None for dates


class Table(ABC):
    """A table that can be read in blocks of rows, any number of times.

    Attributes:
        name: path as the user gave it.
        size: total amount to read, in units of ``advance``.
        shapes: shape of one row of every column that may be mapped: () for a number.
        metadata: metadata of a file that mocobot wrote, else None.
        aliases: other names of single numbers in a row: the column and the index there.
        time_column: default name of the time column.
        sparse: whether rows in which a robot has no value are not samples of that robot.
    """

    name: str
    size: int
    shapes: Mapping[str, tuple[int, ...]]
    metadata: RecordingMetadata | None = None
    aliases: Mapping[str, tuple[str, tuple[int, ...]]] = {}
    time_column = "time"
    sparse = True

    @abstractmethod
    def blocks(self, wanted: Wanted, advance: Callable[[int], object]) -> Iterator[Block]:
        """Yield rows in the order of the file; ``advance`` is called with the progress since the last call."""


@dataclass(frozen=True)
class Place:
    """One number in every row of a table: a column, and the index in it if it is an array."""

    column: str
    index: tuple[int, ...] = ()


class TableSource:
    """A table as a ``LogSource``."""

    notes: Sequence[str] = ()

    def __init__(self, table: Table, log_map: LogMap) -> None:
        log_map.require("column", "tables")
        self._table, self._map = table, log_map
        self.name, self.size, self.metadata = table.name, table.size, table.metadata
        self.level: Level = log_map.level
        self.robots = log_map.count_robots(self.name, self._has_robot, "column")
        has_commands = log_map.has_commands(self.robots, lambda channel: self._find(channel) is not None)
        self.channels: tuple[str, ...] = log_map.required + (REF if has_commands else ())
        self._places = [self._places_of(robot) for robot in range(1, self.robots + 1)]
        self._clocks = [
            self._clock_of(log_map.time_column(robot) or table.time_column)
            for robot in range(1, self.robots + 1)
        ]
        below = [log_map.nanosec_column(robot) for robot in range(1, self.robots + 1)]
        self._below = [None if name is None else self._clock_of(name) for name in below]
        self._check_shared()

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        maps = [self._map.channels(robot) for robot in range(1, self.robots + 1)]
        below = [name for name in self._below if name is not None]
        columns = tuple(
            dict.fromkeys([*(place.column for places in self._places for place in places), *below])
        )
        clocks = tuple(dict.fromkeys(self._clocks))
        row = 0
        for block in self._table.blocks(Wanted(columns, clocks, self._map.time.unit_ns), advance):
            for robot, (places, channels) in enumerate(zip(self._places, maps, strict=True)):
                stamps, given = self._stamps(block, robot, row)
                values = np.empty((len(stamps), len(self.channels)))
                # Values beyond floats and signalling NaN of damaged files are checked later.
                with np.errstate(invalid="ignore", over="ignore"):
                    for k, (name, place) in enumerate(zip(self.channels, places, strict=True)):
                        raw = np.asarray(block.columns[place.column][(slice(None), *place.index)], float)
                        values[:, k] = channels[name].apply(raw)
                if self._table.sparse and (blank := np.isnan(values).all(axis=1)).any():
                    stamps, given, values = stamps[~blank], given[~blank], values[~blank]
                if not given.all():
                    raise InputError(
                        f"{self.name}: column {self._clocks[robot]!r} has no time for {np.sum(~given)} samples of "
                        f"robot {robot + 1} from row {row} on; every sample needs one"
                    )
                yield robot, Samples(stamps, values)
            row += len(next(iter(block.clocks.values()))[0])

    def _stamps(self, block: Block, robot: int, row: int) -> tuple[Stamps, NDArray[np.bool_]]:
        """Return the stamps [ns] of a block's rows, and which are present; ``row`` is the first row."""
        stamps, given = block.clocks[self._clocks[robot]]
        if (name := self._below[robot]) is None:
            return stamps, given
        below = np.asarray(block.columns[name], float).reshape(-1)
        given = given & ~np.isnan(below)
        below = np.where(given, below, 0.0)
        if (bad := (below < 0) | (below >= 1e9)).any():
            k = int(np.argmax(bad))
            raise InputError(
                f"{self.name}: column {name!r} is {below[k]:.12g} in row {row + k}; the nanoseconds of a stamp are 0 "
                "to 999999999"
            )
        return stamps + np.rint(below).astype(np.int64), given

    def _has_robot(self, robot: int) -> bool:
        channels = self._map.channels(robot)
        return any(self._find(channels[name]) is not None for name in self._map.required)

    def _places_of(self, robot: int) -> list[Place]:
        channels, places = self._map.channels(robot), []
        for name in self.channels:
            place = self._find(channels[name])
            if place is None:
                raise InputError(self._missing(channels[name].column or "", self._map.meaning(name, robot)))
            places.append(place)
        return places

    def _clock_of(self, name: str) -> str:
        shape = self._table.shapes.get(name)
        if shape is None:
            raise InputError(self._missing(name, "time"))
        if shape not in ((), (1,)):
            raise InputError(f"{self.name}: column {name!r} has {shape} numbers in a row; time must be one")
        return name

    def _find(self, channel: ChannelMap) -> Place | None:
        address, shapes = channel.column or "", self._table.shapes
        if (shape := shapes.get(address)) is not None:
            if np.prod(shape, dtype=object) != 1:
                first = ", ".join("0" for _ in shape)
                raise InputError(
                    f"{self.name}: column {address!r} has {shape} numbers in a row; "
                    f"name one of them in the map, such as '{address}[{first}]'"
                )
            return Place(address, (0,) * len(shape))
        if address in self._table.aliases:
            return Place(*self._table.aliases[address])
        found = re.fullmatch(r"(.+?)\[\s*(?::\s*,\s*)?(\d{1,9}(?:\s*,\s*\d{1,9})*)\s*\]", address)
        if found is None or (shape := shapes.get(found[1])) is None:
            return None
        index = tuple(int(part) for part in found[2].split(","))
        if len(index) != len(shape):
            raise InputError(
                f"{self.name}: {address!r} has {len(index)} indices, but a row of {found[1]!r} has the shape {shape}"
            )
        inside = all(i < length for i, length in zip(index, shape, strict=True))
        return Place(found[1], index) if inside else None

    def _missing(self, address: str, what: str) -> str:
        mapped = {c.column for robot in range(1, self.robots + 1) for c in self._map.channels(robot).values()}
        names = sorted({*self._table.shapes, *self._table.aliases} - mapped)
        close = difflib.get_close_matches(address, names[:1000], n=1, cutoff=0.75)
        hint = f" (did you mean {close[0]!r:.60}?)" if close else ""
        listed = ", ".join(shown(name) for name in list(self._table.shapes)[:SHOWN_COLUMNS])
        more = f", ... ({len(self._table.shapes)} in all)" if len(self._table.shapes) > SHOWN_COLUMNS else ""
        return (
            f"{self.name}: missing column {address!r:.80} for {what} by map {self._map.name}{hint}; "
            f"the columns are {listed or 'none'}{more}"
        )

    def _check_shared(self) -> None:
        """Refuse a map that reads two channels from one number of the table."""
        seen: dict[Place, str] = {}
        for robot, places in enumerate(self._places, 1):
            for name, place in zip(self.channels, places, strict=True):
                what = self._map.meaning(name, robot)
                if place in seen:
                    raise InputError(
                        f"{self.name}: by map {self._map.name}, {seen[place]} and {what} are the same column "
                        f"{place.column!r:.80}; every channel needs its own"
                    )
                seen[place] = what


def rows_at_a_time(cells: int) -> int:
    """Return the number of rows per block for ``cells`` numbers in a row."""
    return max(CELLS // max(cells, 1), 64)

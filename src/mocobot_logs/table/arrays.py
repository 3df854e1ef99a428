"""Tables of arrays, one for each column: checked by what their headers say, then read in step."""

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from math import prod
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from estimator.inputs import Unpacked
from mocobot_logs.faults import shown, told_in_one_sentence
from mocobot_logs.table.stamps import from_numbers
from mocobot_logs.table.table import Block, Table, Wanted, rows_at_a_time

MAX_WHOLE_BYTES = 1 << 30
"""Arrays in Fortran order do not come row by row; up to this size they are loaded whole."""


@dataclass(frozen=True)
class Stored:
    """Header of one array in a file.

    Attributes:
        at: where it is: an entry of an archive, or its first byte in the file.
        dtype, shape, fortran: as numpy has them.
        start: where its numbers begin there, unpacked [B].
    """

    at: Any
    dtype: np.dtype
    shape: tuple[int, ...]
    fortran: bool
    start: int

    @property
    def size(self) -> int:
        """Bytes of its data."""
        return self.dtype.itemsize * prod(self.shape)

    @property
    def row_shape(self) -> tuple[int, ...]:
        """Shape of one row."""
        return self.shape[1:]

    @property
    def columnwise(self) -> bool:
        """Whether its numbers do not come row by row."""
        return self.fortran and len(self.shape) > 1

    def reader(self, file: IO[bytes]) -> Callable[[int], NDArray]:
        """What reads the next so many rows.

        Args:
            file: at what is stored, unpacked.
        """
        read_exactly(file, self.start)
        if self.columnwise:
            whole = np.frombuffer(read_exactly(file, self.size), self.dtype).reshape(self.shape, order="F")
            done = 0

            def next_loaded(count: int) -> NDArray:
                nonlocal done
                done += count
                return whole[done - count : done]

            return next_loaded
        row = self.dtype.itemsize * prod(self.row_shape)
        return lambda count: np.frombuffer(read_exactly(file, count * row), self.dtype).reshape(
            count, *self.row_shape
        )


class ArrayTable(Table):
    """A table whose columns are arrays: of each, the first axis counts rows.

    Attributes:
        noun: what the format calls an array.
        kind: the format, for messages.
        arrays: by name.
        stored_bytes: size of the file.
    """

    noun: str
    kind: str
    arrays: Mapping[str, Stored]
    stored_bytes: int

    def blocks(self, wanted: Wanted, advance: Callable[[int], object]) -> Iterator[Block]:
        """Rows in step, see ``Table.blocks``.

        Raises:
            InputError: the file is damaged, or an array does not hold numbers or has another number of rows.
        """
        names = list(dict.fromkeys([*wanted.clocks, *wanted.columns]))
        rows = self._rows(names) if names else 0
        at_a_time = rows_at_a_time(sum(prod(self.arrays[name].row_shape) for name in names))
        with told_in_one_sentence(self.name, self.kind), ExitStack() as stack:
            readers = self.readers(names, stack)
            for row in range(0, rows, at_a_time):
                count = min(at_a_time, rows - row)
                read = {name: reader(count) for name, reader in readers.items()}
                yield Block(
                    {name: read[name] for name in wanted.columns},
                    {
                        name: from_numbers(
                            read[name].reshape(count),
                            wanted.unit_ns,
                            f"{self.name}: {self.noun} {name!r}",
                            row,
                        )
                        for name in wanted.clocks
                    },
                )
                advance(count)

    @abstractmethod
    def readers(self, names: Sequence[str], stack: ExitStack) -> dict[str, Callable[[int], NDArray]]:
        """What reads the next so many rows of each array, with files that a stack closes."""

    def _rows(self, names: list[str]) -> int:
        rows, unpacked = self.arrays[names[0]].shape[0], Unpacked(self.name, self.stored_bytes)
        for name in names:
            array, where = self.arrays[name], f"{self.name}: {self.noun} {shown(name)!r}"
            if array.dtype.kind not in "iuf":
                raise InputError(f"{where} holds {array.dtype}; it must hold numbers")
            if array.shape[0] != rows:
                raise InputError(
                    f"{where} has {array.shape[0]} rows, but {shown(names[0])!r} has {rows}; all must have as many"
                )
            unpacked.add(array.size)
            if array.columnwise and array.size > MAX_WHOLE_BYTES:
                raise InputError(
                    f"{where} is in Fortran order and larger than {MAX_WHOLE_BYTES >> 30} GiB; save it in C order "
                    "(numpy.ascontiguousarray) or its columns one by one"
                )
        return rows


def read_exactly(file: IO[bytes], count: int) -> bytes:
    """So many bytes, or an EOFError."""
    content = file.read(count)
    if len(content) < count:
        raise EOFError(f"{len(content)} of {count} bytes are there")
    return content

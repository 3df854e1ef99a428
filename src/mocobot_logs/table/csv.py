"""Text tables: one header line, then one row per sample, cells of numbers."""

from __future__ import annotations

import contextlib
import csv
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pcsv

from estimator.errors import InputError
from estimator.recording.metadata import RecordingMetadata
from mocobot_logs.map.log_map import CsvMap
from mocobot_logs.table.stamps import from_text
from mocobot_logs.table.table import Block

BLOCK_BYTES = 4 << 20
MAX_LINE_BYTES = 1 << 20
DELIMITERS = (",", ";", "\t", "|", " ")
EMPTY = ["", " ", "NA", "N/A", "n/a", "NULL", "null", "None", "-"]
"""Cells that stand for no value."""


class CsvTable:
    """A CSV file as a ``Table``: UTF-8, a header line, any of ``DELIMITERS``; blank lines are skipped.

    A leading ``#`` before the header, as numpy writes it, is dropped.
    """

    metadata: RecordingMetadata | None = None
    aliases: Mapping[str, tuple[str, tuple[int, ...]]] = {}
    time_column = "time"
    sparse = True

    def __init__(self, path: Path, options: CsvMap, name: str) -> None:
        """Read the header.

        Raises:
            InputError: the file cannot be read, is not text, or has no header.
        """
        self.name, self._path, self._decimal = name, path, options.decimal
        header, first_row, self._lines_before = _first_lines(path, name)
        self._delimiter = options.delimiter or _find_delimiter(header, first_row, options.decimal)
        self._names = _cut(header, self._delimiter)
        if not self._names:
            raise InputError(f"{name}: its header {header!r:.60} has an unmatched quotation mark")
        if all(_is_number(cell, options.decimal) for cell in self._names):
            raise InputError(
                f"{name}: the first line holds numbers ({header.strip()!r:.60}); it must name the columns"
            )
        self._empty = not first_row
        self.size = path.stat().st_size
        self.shapes: Mapping[str, tuple[int, ...]] = dict.fromkeys(self._names, ())

    def blocks(
        self,
        columns: tuple[str, ...],
        clocks: tuple[str, ...],
        unit_ns: int,
        advance: Callable[[int], object],
    ) -> Iterator[Block]:
        """Rows in the order of the file, see ``Table.blocks``.

        Raises:
            InputError: a row has too few or too many cells, or a cell is not a number.
        """
        index = {name: self._index(name) for name in (*columns, *clocks)}
        types = {f"{index[name]}": pa.float64() for name in columns}
        types |= {f"{index[name]}": pa.string() for name in clocks}
        clash = set(columns) & set(clocks)
        if clash:
            raise InputError(f"{self.name}: column {clash.pop()!r} is both time and a channel")
        if self._empty:
            return
        row = before = 0
        with self._readable() as source:
            reader = self._reader(source, types)
            while (batch := self._next(reader)) is not None:
                yield Block(
                    {
                        # A cell without a value is NaN.
                        name: pc.fill_null(batch.column(f"{index[name]}"), float("nan")).to_numpy(
                            zero_copy_only=False
                        )
                        for name in columns
                    },
                    {
                        name: from_text(
                            self._point(batch.column(f"{index[name]}")),
                            unit_ns,
                            f"{self.name}: column {name!r}",
                            row,
                        )
                        for name in clocks
                    },
                )
                row += batch.num_rows
                advance(source.tell() - before)
                before = source.tell()

    def _readable(self) -> pa.NativeFile:
        try:
            return pa.OSFile(str(self._path), "rb")
        except OSError as error:
            raise InputError(f"{self.name}: cannot be read ({error.strerror or error})") from error

    def _reader(self, source: pa.NativeFile, types: dict[str, pa.DataType]) -> pcsv.CSVStreamingReader:
        try:
            return pcsv.open_csv(
                source,
                read_options=pcsv.ReadOptions(
                    use_threads=False,
                    block_size=BLOCK_BYTES,
                    skip_rows=self._lines_before,
                    column_names=[f"{k}" for k in range(len(self._names))],
                ),
                parse_options=pcsv.ParseOptions(delimiter=self._delimiter),
                convert_options=pcsv.ConvertOptions(
                    column_types=types,
                    include_columns=list(types),
                    null_values=EMPTY,
                    strings_can_be_null=True,
                    quoted_strings_can_be_null=True,
                    decimal_point=self._decimal,
                ),
            )
        except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
            raise self._complaint(error) from error

    def _next(self, reader: pcsv.CSVStreamingReader) -> pa.RecordBatch | None:
        try:
            return reader.read_next_batch()
        except StopIteration:
            return None
        except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
            raise self._complaint(error) from error

    def _complaint(self, error: Exception) -> InputError:
        text = str(error)
        row = re.search(r"Row #(\d+)", text)
        line = f" in line {self._line_of(int(row[1]))}" if row else ""
        if found := re.search(r"In CSV column #(\d+).*invalid value '(.*)", text, re.DOTALL):
            column, cell = self._names[int(found[1])], found[2].removesuffix("'")
            return InputError(
                f"{self.name}: column {column!r:.80} holds {cell!r:.60}{line}; it must hold numbers"
            )
        if found := re.search(r"Expected (\d+) columns, got (\d+)", text):
            return InputError(
                f"{self.name}: {found[2]} cells{line}; every row must have {found[1]}, like the header"
            )
        if "straddling" in text:
            return InputError(
                f"{self.name}: a row is longer than {BLOCK_BYTES >> 20} MiB; this is no table of samples"
            )
        return InputError(f"{self.name}: cannot be read as CSV ({' '.join(text.split())!r:.200})")

    def _line_of(self, row: int) -> int:
        """Line of the file, given the row as pyarrow counts it: without the blank lines after the header."""
        with contextlib.suppress(OSError), self._path.open("rb") as file:
            for number, line in enumerate(file, 1):
                row += number > self._lines_before and not line.strip(b"\r\n")
                if number >= row:
                    break
        return row

    def _index(self, name: str) -> int:
        if (count := self._names.count(name)) > 1:
            raise InputError(f"{self.name}: column {name!r:.80} appears {count} times")
        return self._names.index(name)

    def _point(self, text: pa.Array) -> pa.Array:
        """Decimal points in the place of commas."""
        if self._decimal == ".":
            return text
        return pc.call_function("replace_substring", [text], pc.ReplaceSubstringOptions(self._decimal, "."))


def _first_lines(path: Path, name: str) -> tuple[str, str, int]:
    """The header line, the first row (empty if there is none), and the number of lines up to and with the header."""
    header, before = "", 0
    try:
        with path.open("rb") as file:
            for count, line in enumerate(iter(lambda: file.readline(MAX_LINE_BYTES + 1), b""), 1):
                if len(line) > MAX_LINE_BYTES:
                    raise InputError(
                        f"{name}: line {count} is longer than {MAX_LINE_BYTES >> 20} MiB; this is no table of samples"
                    )
                if b"\0" in line:
                    raise InputError(f"{name}: holds binary data; a CSV file is text in UTF-8")
                text = line.decode("utf-8-sig" if count == 1 else "utf-8").strip("\r\n")
                if not text.strip():
                    continue
                if header:
                    return header, text, before
                header, before = text.removeprefix("#").lstrip(), count
    except UnicodeDecodeError as error:
        raise InputError(f"{name}: is not text in UTF-8 ({error.reason})") from error
    except OSError as error:
        raise InputError(f"{name}: cannot be read ({error.strerror or error})") from error
    if not header:
        raise InputError(f"{name}: has no header; the first line must name the columns")
    return header, "", before


def _find_delimiter(header: str, row: str, decimal: str) -> str:
    """The delimiter that cuts most numbers out of the first row.

    Where none does, because a row is no row of numbers, the one that cuts the header at all, for what is said then.
    """
    best, most = "", 1
    for delimiter in DELIMITERS:
        cells = _cut(row, delimiter) if delimiter != decimal else []
        if len(cells) > most and all(cell in EMPTY or _is_number(cell, decimal) for cell in cells):
            best, most = delimiter, len(cells)
    return best or next((d for d in DELIMITERS if d != decimal and len(_cut(header, d)) > 1), ",")


def _cut(line: str, delimiter: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, strict=True), [])]
    except csv.Error:  # such as an unmatched quotation mark
        return []


def _is_number(cell: str, decimal: str) -> bool:
    try:
        float(cell.replace(decimal, "."))
    except ValueError:
        return False
    return True

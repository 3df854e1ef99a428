"""Text tables: one header line, then one row per sample, cells of numbers; time may be dates."""

import contextlib
import csv
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pcsv

from estimator.errors import InputError
from mocobot_logs.faults import detail_of, readable
from mocobot_logs.map.log_map import CsvMap
from mocobot_logs.table.dates import TextClock, is_date
from mocobot_logs.table.table import Block, Table, Wanted

_COMMENT = re.compile(rb"^[ \t]*#.*\n?", re.MULTILINE)


def line_blocks(file: BinaryIO, size: int) -> Iterator[bytes]:
    """Blocks of whole lines, none of them empty, without those whose first character but blanks is ``#``.

    Args:
        file: read from where it is, where a line begins.
        size: about how long blocks are [bytes]; a line of more than twice this is cut where it is so long.
    """
    rest = b""
    while block := file.read(size):
        lines = rest + block
        end = lines.rfind(b"\n") + 1
        if not end and len(lines) > 2 * size:
            end = len(lines)
        if ready := _without_comments(lines[:end]):
            yield ready
        rest = lines[end:]
    if ready := _without_comments(rest):
        yield ready


def _without_comments(lines: bytes) -> bytes:
    return _COMMENT.sub(b"", lines) if b"#" in lines else lines


BLOCK_BYTES = 4 << 20
MAX_LINE_BYTES = 1 << 20
DELIMITERS = (",", ";", "\t", "|", " ")
EMPTY = ["", " ", "NA", "N/A", "n/a", "NULL", "null", "None", "-"]
"""Cells that stand for no value."""
_NUMBER = re.compile(
    r"[+-]?((\d+\.?\d*|\.\d+)(e[+-]?\d+)?|inf(inity)?|nan(\(\w*\))?)", re.ASCII | re.IGNORECASE
)
"""As pyarrow reads them."""


class BrokenRowsError(InputError):
    """Rows that do not fit the header: nothing can be read, whatever the column."""


class CsvTable(Table):
    """A CSV file as a ``Table``: UTF-8, a header line, any of ``DELIMITERS``.

    Blank lines, and lines that begin with ``#``, are skipped. The header is the first line that is left, or, where
    that is a row of samples, the last one with ``#`` before it, as numpy writes it.
    """

    def __init__(self, path: Path, options: CsvMap, name: str) -> None:
        """Read the header.

        Raises:
            InputError: the file cannot be read, is not text, or has no header.
        """
        self.name, self._path, self._decimal = name, path, options.decimal
        header, first_row, self._lines_before, self._start = _first_lines(path, name, options.decimal)
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

    def blocks(self, wanted: Wanted, advance: Callable[[int], object]) -> Iterator[Block]:
        """Rows in the order of the file, see ``Table.blocks``.

        Raises:
            InputError: a row has too few or too many cells, or a cell is not a number.
        """
        columns, clocks = wanted.columns, wanted.clocks
        index = {name: self._index(name) for name in (*columns, *clocks)}
        types = {f"{index[name]}": pa.float64() for name in columns}
        types |= {f"{index[name]}": pa.string() for name in clocks}
        clash = set(columns) & set(clocks)
        if clash:
            raise InputError(f"{self.name}: column {clash.pop()!r} is both time and a channel")
        if self._empty:
            return
        read = {name: TextClock(wanted.unit_ns, f"{self.name}: column {name!r}") for name in clocks}
        row = before = 0
        for batch, end in self._batches(types):
            yield Block(
                {
                    # A cell without a value is NaN.
                    name: pc.fill_null(batch.column(f"{index[name]}"), float("nan")).to_numpy(
                        zero_copy_only=False
                    )
                    for name in columns
                },
                {name: read[name].read(self._point(batch.column(f"{index[name]}")), row) for name in clocks},
            )
            row += batch.num_rows
            advance(end - before)
            before = end

    def _batches(self, types: Mapping[str, pa.DataType]) -> Iterator[tuple[pa.RecordBatch, int]]:
        """Rows of some columns, and how far in the file they end."""
        rows = 0
        try:
            with self._path.open("rb") as source:
                source.seek(self._start)
                for lines in line_blocks(source, BLOCK_BYTES):
                    if (batch := self._parsed(lines, types)).num_rows:
                        yield batch, source.tell()
                        rows += batch.num_rows
        except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
            numbers = [int(column) for column, kind in types.items() if kind == pa.float64()]
            self._refuse_first_fault(numbers, rows)
            raise InputError(f"{self.name}: {_plain(error)}") from error

    def _parsed(self, lines: bytes, types: Mapping[str, pa.DataType]) -> pa.RecordBatch:
        """Some columns of whole lines.

        Every block is a file to pyarrow. Its streaming reader reads ahead in a thread: left at a fault, or at the rows
        that are enough, it hangs or aborts the process when this ends (pyarrow 26).

        Raises:
            pa.ArrowException: a row does not fit the header, or a cell is no number.
        """
        table = pcsv.read_csv(
            pa.BufferReader(lines),
            read_options=pcsv.ReadOptions(
                use_threads=False,
                block_size=len(lines) + 1,
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
        columns = [column.combine_chunks() for column in table.columns]
        return pa.RecordBatch.from_arrays(columns, names=table.column_names)

    def _refuse_first_fault(self, numbers: list[int], good: int) -> None:
        """Refuse the first row that does not fit the header or lacks a number, after so many good rows."""
        with contextlib.suppress(OSError), self._path.open("rb") as file:
            for line, content in enumerate(iter(lambda: file.readline(BLOCK_BYTES + 1), b""), 1):
                if len(content) > BLOCK_BYTES:
                    longest = f"{BLOCK_BYTES >> 20} MiB"
                    raise BrokenRowsError(
                        f"{self.name}: a row is longer than {longest}; this is no table of samples"
                    )
                text = content.decode(errors="replace").strip("\r\n")
                if line <= self._lines_before or not text or text.lstrip().startswith("#"):
                    continue
                good -= 1
                cells = _cut(text, self._delimiter, strict=False) if good < 0 else self._names
                if len(cells) != (count := len(self._names)):
                    raise BrokenRowsError(
                        f"{self.name}: {len(cells)} cell{'s' * (len(cells) != 1)} in line {line}; every row must "
                        f"have {count}, like the header"
                    )
                for k in numbers if good < 0 else ():
                    if cells[k] not in EMPTY and not _is_number(cells[k], self._decimal):
                        comma = self._decimal == "." and _is_number(cells[k], ",")
                        hint = ' (for a decimal comma, decimal = "," in the map\'s [csv])' if comma else ""
                        raise InputError(
                            f"{self.name}: column {self._names[k]!r:.80} holds {cells[k]!r:.60} in line {line}; "
                            f"it must hold numbers{hint}"
                        )

    def _index(self, name: str) -> int:
        if (count := self._names.count(name)) > 1:
            raise InputError(f"{self.name}: column {name!r:.80} appears {count} times")
        return self._names.index(name)

    def _point(self, text: pa.Array) -> pa.Array:
        """Decimal points in the place of commas."""
        if self._decimal == ".":
            return text
        return pc.call_function("replace_substring", [text], pc.ReplaceSubstringOptions(self._decimal, "."))


def _first_lines(path: Path, name: str, decimal: str) -> tuple[str, str, int, int]:
    """The header line, the first row (empty if there is none), and the lines and bytes up to and with the header."""
    header, lines, size = None, 0, 0
    comment, at = None, 0
    try:
        with readable(name), path.open("rb") as file:
            for count, line in enumerate(iter(lambda: file.readline(MAX_LINE_BYTES + 1), b""), 1):
                if len(line) > MAX_LINE_BYTES:
                    raise InputError(
                        f"{name}: line {count} is longer than {MAX_LINE_BYTES >> 20} MiB; this is no table of samples"
                    )
                if b"\0" in line:
                    raise InputError(f"{name}: holds binary data; a CSV file is text in UTF-8")
                at += len(line)
                text = line.decode("utf-8-sig" if count == 1 else "utf-8").strip("\r\n")
                if text.lstrip().startswith("#"):
                    if header is None:
                        comment = text.lstrip().removeprefix("#").lstrip(), count, at
                elif not text.strip():
                    continue
                elif header is not None:
                    return header, text, lines, size
                elif comment is not None and _is_row(text, decimal):
                    header, lines, size = comment
                    return header, text, lines, size
                else:
                    header, lines, size = text, count, at
    except UnicodeDecodeError as error:
        raise InputError(f"{name}: is not text in UTF-8 ({error.reason})") from error
    if header is None and comment is not None:
        header, lines, size = comment
    if header is None or not header:
        raise InputError(f"{name}: has no header; the first line must name the columns")
    return header, "", lines, size


def _is_row(text: str, decimal: str) -> bool:
    """Whether a line holds samples, and no names."""
    for delimiter in DELIMITERS:
        cells = _cut(text, delimiter) if delimiter != decimal else []
        if cells and all(_is_cell(cell, decimal) for cell in cells):
            return True
    return False


def _find_delimiter(header: str, row: str, decimal: str) -> str:
    """The delimiter that cuts most numbers out of the first row.

    Where none does, because a row is no row of numbers, the one that cuts the header at all, for what is said then.
    """
    best, most = "", 1
    for delimiter in DELIMITERS:
        cells = _cut(row, delimiter) if delimiter != decimal else []
        if len(cells) > most and all(_is_cell(cell, decimal) for cell in cells):
            best, most = delimiter, len(cells)
    return best or next((d for d in DELIMITERS if d != decimal and len(_cut(header, d)) > 1), ",")


def _cut(line: str, delimiter: str, *, strict: bool = True) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, strict=strict), [])]
    except csv.Error:  # such as an unmatched quotation mark
        return []


def _is_cell(cell: str, decimal: str) -> bool:
    return cell in EMPTY or _is_number(cell, decimal) or is_date(cell)


def _is_number(cell: str, decimal: str) -> bool:
    return _NUMBER.fullmatch(cell.replace(decimal, "\0").replace(".", "?").replace("\0", ".")) is not None


def _plain(error: Exception) -> str:
    return f"cannot be read as CSV ({detail_of(error)!r})"

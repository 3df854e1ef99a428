"""Text tables: a header line, then one row of numbers per sample; time may be ISO 8601 dates.

Time becomes integer nanoseconds: exact for integers and dates, rounded for floats and decimal text. Every error is an
``InputError`` that names the file, the column and the row or line.
"""

import contextlib
import csv
import re
import shlex
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO, NoReturn

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pcsv
from numpy.typing import NDArray

from estimator.errors import InputError
from mocobot_logs.formats import detail_of, readable
from mocobot_logs.log import Stamps
from mocobot_logs.maps import CsvMap
from mocobot_logs.table.table import Block, Table, Wanted

LARGEST_NS = (1 << 63) - 1
_DIGITS = {10**exponent: exponent for exponent in range(10)}
_BELOW_NS = 6
"""Decimals below the nanosecond that take part in rounding: programs write 32439.999999999996 ms for 32.44 s."""

Given = NDArray[np.bool_]


def from_numbers(values: NDArray, unit_ns: int | None, where: str, row: int = 0) -> tuple[Stamps, Given]:
    """Convert integers or floats to stamps [ns], 0 where missing (NaN), and which are present; each of shape (q,).

    ``unit_ns`` is nanoseconds per unit, None if the map's unit is "iso"; ``where`` and ``row`` locate the first value
    in messages. Times beyond 292 years are refused.
    """
    unit_ns = _unit(unit_ns, where)
    if values.dtype.kind in "iu":
        limit = LARGEST_NS // unit_ns
        beyond = (values > limit) | (values < -limit)
        _refuse(values, beyond, where, row)
        return values.astype(np.int64) * unit_ns, np.ones(len(values), bool)
    given = ~np.isnan(values)
    with np.errstate(over="ignore"):
        scaled = np.where(given, values, 0.0).astype(np.float64) * unit_ns
    # This is one below 2**63; the largest smaller float is an integer and fits.
    _refuse(values, np.abs(scaled) >= float(LARGEST_NS), where, row)
    return np.rint(scaled).astype(np.int64), given


def from_text(values: pa.Array, unit_ns: int | None, where: str, row: int = 0) -> tuple[Stamps, Given]:
    """Convert decimal text to stamps as ``from_numbers`` does; null means no stamp.

    Stamps are exact to the nanosecond, where floats would resolve only 0.24 us.
    """
    digits = _DIGITS[_unit(unit_ns, where)]
    exact = pa.decimal128(38, digits)
    cut, bad = _cast(values, exact)
    if cut is None:
        or_date = "" if row + bad else " or a date of ISO 8601, such as 2026-03-01T12:00:00.5Z"
        raise InputError(
            f"{where} is {values[bad].as_py()!r:.60} in row {row + bad}; a time must be a number{or_date}"
        )
    _in_ns(cut, values, where, row)
    finer = pc.cast(values, pa.decimal256(76, digits + _BELOW_NS), safe=False)
    rounded = pc.cast(pc.call_function("round", [finer], pc.RoundOptions(digits)), exact)
    ns = _in_ns(rounded, values, where, row)
    given = ns.is_valid().to_numpy(zero_copy_only=False)
    return pc.fill_null(ns, 0).cast(pa.int64()).to_numpy(zero_copy_only=False), given


def _in_ns(decimals: pa.Array, values: pa.Array, where: str, row: int) -> pa.Array:
    """Return decimals whose last digit is a nanosecond as integers; refuse times beyond 292 years."""
    ns = decimals.view(pa.decimal128(38, 0))  # without the decimal point, the digits count nanoseconds
    size = pc.call_function("abs", [ns])
    beyond = pc.fill_null(pc.call_function("greater", [size, pa.scalar(LARGEST_NS)]), False)
    _refuse(values, beyond.to_numpy(zero_copy_only=False), where, row)
    return ns


def _unit(unit_ns: int | None, where: str) -> int:
    if unit_ns is None:
        raise InputError(f"{where} holds numbers, but the map's unit of time is 'iso', which is for dates")
    return unit_ns


def _cast(text: pa.Array, kind: pa.DataType) -> tuple[pa.Array | None, int]:
    """Return text as another type; None, and the row of the first text that is none, if one is not."""
    try:
        return pc.cast(text, kind, safe=False), 0
    except pa.ArrowInvalid:
        # The shortest prefix that does not cast ends with the faulty text.
        return None, bisect_left(range(1, len(text)), True, key=lambda count: not _casts(text[:count], kind))


def _casts(text: pa.Array, kind: pa.DataType) -> bool:
    try:
        pc.cast(text, kind, safe=False)
    except pa.ArrowInvalid:
        return False
    return True


def _refuse(values: NDArray | pa.Array, beyond: Given, where: str, row: int) -> None:
    if beyond.any():
        first = int(np.flatnonzero(beyond)[0])
        raise InputError(
            f"{where} is {values[first]!s:.40} in row {row + first}; a time must be finite and within 292 years (is "
            "its unit right?)"
        )


_DATE_AND_TIME = (
    r"([0-9]{4}-[0-9]{2}-[0-9]{2}|[0-9]{8})[Tt ][0-9]{2}(:[0-9]{2}(:[0-9]{2})?|[0-9]{2}([0-9]{2})?)"
    r"([.,][0-9]{1,18})?"
)
_ZONE = r" ?([Zz]|UTC|[+-][0-9]{2}(:?[0-9]{2})?)"
_ISO = re.compile(f"{_DATE_AND_TIME}(?P<zone>{_ZONE})?")
_PLAIN = (
    (r"^(....)(..)(..)([Tt ])", r"\1-\2-\3\4"),
    (r"^(.{10})[Tt ](..)([0-9]{2})", r"\1 \2:\3"),
    (r"^(.{16})([0-9]{2})", r"\1:\2"),
    (r"^(.{16})([.,])", r"\1:00\2"),
    (r"[.,]([0-9]{1,9})[0-9]*", r".\1"),
    (r"^(.{10})[Tt]", r"\1 "),
    (r" ?(z|Z|UTC)$", "Z"),
    (r" ([+-][0-9:]+)$", r"\1"),
)
"""Patterns, and what replaces them in turn, from any way to write a date to the one that pyarrow reads."""
EXAMPLE = "2026-03-01T12:00:00.000000001Z"
_MUST = f"a time must be a date like {EXAMPLE}"


def is_date(text: str) -> bool:
    """Return whether a cell holds a date and a time."""
    return _ISO.fullmatch(text.strip()) is not None


class TextClock:
    """Reads a text column of time in blocks: either numbers or dates.

    All dates of a column must have a zone, or none may, since their offset would be unknown. Dates without a zone
    count as UTC; digits beyond nanoseconds are cut off.
    """

    def __init__(self, unit_ns: int | None, where: str) -> None:
        """``unit_ns`` is the unit of numbers [ns], None if only dates are allowed; ``where`` names the column in
        messages."""
        self._unit_ns, self._where = unit_ns, where
        self._form: str | None = None

    def read(self, values: pa.Array, row: int) -> tuple[Stamps, Given]:
        """Convert text to stamps as ``from_numbers`` does; null means no stamp. ``row`` is the row of the first
        value."""
        values = pc.call_function("utf8_trim_whitespace", [values])
        if self._form is None and values.null_count < len(values):
            first = values.drop_null()[0].as_py()
            self._form = _form(first)
            if self._unit_ns is None and self._form == "number" and not _is_float(first):
                self._refuse(values, values.is_valid().to_numpy(zero_copy_only=False), row, _MUST)
        if self._form in (None, "number"):
            return from_text(values, self._unit_ns, self._where, row)
        return self._dates(values, row)

    def _dates(self, values: pa.Array, row: int) -> tuple[Stamps, Given]:
        given = values.is_valid().to_numpy(zero_copy_only=False)
        zone = "with" if self._form == "zone" else "without"
        for pattern, why in (
            (_DATE_AND_TIME + f"({_ZONE})?", f"{_MUST}, as the first one is"),
            (
                _DATE_AND_TIME + f"({_ZONE})" * (zone == "with"),
                f"all times must be {zone} a time zone, as the first one is",
            ),
        ):
            options = pc.MatchSubstringOptions(f"^(?:{pattern})$")
            fits = pc.fill_null(pc.call_function("match_substring_regex", [values], options), True)
            if not (fitting := fits.to_numpy(zero_copy_only=False)).all():
                self._refuse(values, ~fitting, row, why)
        plain = values
        for pattern, by in _PLAIN:
            plain = pc.call_function(
                "replace_substring_regex", [plain], pc.ReplaceSubstringOptions(pattern, by)
            )
        read, bad = _cast(plain, pa.timestamp("ns", "UTC" if zone == "with" else None))
        if read is None:
            why = "there is no such date or time of day within 292 years of 1970"
            self._refuse(values, np.arange(len(values)) == bad, row, why)
        return pc.fill_null(read.cast(pa.int64()), 0).to_numpy(zero_copy_only=False), given

    def _refuse(self, values: pa.Array, bad: Given, row: int, why: str) -> NoReturn:
        first = int(np.flatnonzero(bad)[0])
        raise InputError(f"{self._where} is {values[first].as_py()!r:.60} in row {row + first}; {why}")


def _form(text: str) -> str:
    """Return whether a time is a number, or a date with or without a zone."""
    found = _ISO.fullmatch(text.strip())
    return "number" if found is None else "zone" if found["zone"] else "local"


def _is_float(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


_COMMENT = re.compile(rb"^[ \t]*#.*\n?", re.MULTILINE)


def line_blocks(file: BinaryIO, size: int) -> Iterator[bytes]:
    """Yield blocks of whole lines, about ``size`` bytes each, without lines that begin with ``#`` after blanks.

    The file must be at the beginning of a line. A line longer than twice the size is split.
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
EMPTY = ["", " ", "NA", "N/A", "n/a", "NULL", "null", "None", "-"]  # cells that count as missing values
_NUMBER = re.compile(
    r"[+-]?((\d+\.?\d*|\.\d+)(e[+-]?\d+)?|inf(inity)?|nan(\(\w*\))?)", re.ASCII | re.IGNORECASE
)
"""Numbers that pyarrow accepts."""


class BrokenRowsError(InputError):
    """Rows do not fit the header, so no column can be read."""


class CsvTable(Table):
    """A CSV file as a ``Table``: UTF-8, a header line, any of ``DELIMITERS``.

    Blank lines and lines that begin with ``#`` are skipped. The header is the first remaining line. If that is a row of
    samples, the header is the last ``#`` line before it, as numpy writes it.
    """

    def __init__(self, path: Path, options: CsvMap, name: str) -> None:
        self.name, self._path, self._decimal = name, path, options.decimal
        header, first_row, self._lines_before, self._start = _first_lines(path, name, options.decimal)
        self._delimiter = options.delimiter or _find_delimiter(header, first_row, options.decimal)
        self._names = _cut(header, self._delimiter)
        if not self._names:
            raise InputError(f"{name}: its header {header!r:.60} has an unmatched quotation mark")
        if _is_values(self._names, _cut(first_row, self._delimiter), options.decimal):
            raise InputError(
                f"{name}: the first line holds values, not names ({header.strip()!r:.60}); write a line before it that "
                f"names the {len(self._names)} columns{_names_of_echo(path, self._names)}"
            )
        self._empty = not first_row
        self.size = path.stat().st_size
        self.shapes: Mapping[str, tuple[int, ...]] = dict.fromkeys(self._names, ())

    def blocks(self, wanted: Wanted, advance: Callable[[int], object]) -> Iterator[Block]:
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
                    # A missing value becomes NaN.
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
        """Yield rows of some columns, and the file position after them."""
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
            raise InputError(f"{self.name}: cannot be read as CSV ({detail_of(error)!r})") from error

    def _parsed(self, lines: bytes, types: Mapping[str, pa.DataType]) -> pa.RecordBatch:
        """Parse some columns of whole lines.

        Each block is parsed as a separate file. The streaming reader of pyarrow 26 reads ahead in a thread; it hangs
        or aborts the process if the caller stops early.
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
        """Refuse the first row after ``good`` rows that does not fit the header or holds no number."""
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
        """Replace the decimal mark by a point."""
        if self._decimal == ".":
            return text
        return pc.call_function("replace_substring", [text], pc.ReplaceSubstringOptions(self._decimal, "."))


def _first_lines(path: Path, name: str, decimal: str) -> tuple[str, str, int, int]:
    """Return the header line, the first row (or an empty text), and the lines and bytes through the header."""
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


def _is_values(cells: list[str], below: list[str], decimal: str) -> bool:
    """Return whether the first line holds values: numbers, and words that the line ``below`` repeats."""
    numbers = [_is_number(cell, decimal) for cell in cells]
    if all(numbers):
        return True
    again = [cell in ("", *below[k : k + 1]) for k, cell in enumerate(cells)]
    return any(numbers) and all(a or b for a, b in zip(numbers, again, strict=True))


def _names_of_echo(path: Path, cells: list[str]) -> str:
    """Return the command that names the columns of joint states by `ros2 topic echo --csv`, "" for other rows.

    Such a row has sec, nanosec, frame_id, the joints' names, then positions, velocities and efforts; an empty array
    leaves no cell. With two arrays left, one cannot tell which they are.
    """
    joints = [cell for cell in cells[3:] if re.fullmatch(r"[A-Za-z_][\w/.-]*", cell)]
    rest = len(cells) - 3 - len(joints)
    arrays = {3: ("position", "velocity", "effort"), 1: ("position",)}.get(rest // max(len(joints), 1), ())
    if not arrays or cells[3 : 3 + len(joints)] != joints or rest != len(arrays) * len(joints):
        return ""
    names = ["header.stamp.sec", "header.stamp.nanosec", "header.frame_id"]
    names += [f"name_{k}" for k in range(1, len(joints) + 1)]
    names += [f"{array}.{joint}" for array in arrays for joint in joints]
    return f"; for joint states of `ros2 topic echo --csv`: sed -i '1i {','.join(names)}' {shlex.quote(str(path))}"


def _is_row(text: str, decimal: str) -> bool:
    """Return whether a line holds samples rather than names."""
    for delimiter in DELIMITERS:
        cells = _cut(text, delimiter) if delimiter != decimal else []
        if cells and all(_is_cell(cell, decimal) for cell in cells):
            return True
    return False


def _find_delimiter(header: str, row: str, decimal: str) -> str:
    """Return the delimiter that splits the first row into the most numbers.

    If no delimiter does, return one that splits the header, so that later errors make sense.
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

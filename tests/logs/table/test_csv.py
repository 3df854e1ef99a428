"""Text tables: dialects, dates, remarks, hints, and what is wrong named by line."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.errors import InputError
from log_files import assert_same, channels_of, read_log, refused, write_text
from mocobot_logs.maps import CsvMap, LogMap, TimeMap, builtin_map, builtin_map_text, parse_map
from mocobot_logs.table import table as tables
from mocobot_logs.table import text as table_csv
from mocobot_logs.table.text import TextClock, is_date
from recordings import small_recording

RECORDING = small_recording(rows=60)
JOINT = builtin_map("mocobot")


def with_csv(**options: str) -> LogMap:
    return replace(JOINT, csv=CsvMap(**options))  # type: ignore[arg-type]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "log.csv"


@pytest.fixture
def lines(path: Path) -> list[str]:
    """Lines of a good file, to be spoiled."""
    return write_text(path, RECORDING.columns()).read_text().splitlines()


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|", " "])
def test_delimiters_are_found(path: Path, delimiter: str) -> None:
    write_text(path, RECORDING.columns(), delimiter)
    assert_same(read_log(path), RECORDING)
    assert_same(read_log(path, with_csv(delimiter=delimiter)), RECORDING)


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_decimal_commas(path: Path, delimiter: str) -> None:
    write_text(path, RECORDING.columns(), delimiter, decimal=",")
    assert_same(read_log(path, with_csv(decimal=",")), RECORDING)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: "\ufeff" + text,  # Excel
        lambda text: "# " + text,  # numpy.savetxt
        lambda text: "\n\n" + text.replace("\n", "\n\n"),
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.rstrip("\n"),
        lambda text: text.replace("time", '"time"').replace("omnid1.phi1", '"omnid1.phi1"'),
        lambda text: text.replace(",", ", "),
    ],
    ids=[
        "byte order mark",
        "hash",
        "blank lines",
        "CRLF",
        "no last newline",
        "quotes",
        "blanks after commas",
    ],
)
def test_dialects(path: Path, change) -> None:
    write_text(path, RECORDING.columns())
    path.write_bytes(change(path.read_text()).encode())
    assert_same(read_log(path), RECORDING)


def test_blocks_join_seamlessly(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_csv, "BLOCK_BYTES", 5000)
    write_text(path, RECORDING.columns())
    source = tables_source(path)
    parts = list(source.chunks(lambda _: None))
    assert len(parts) > 5 * source.robots
    assert_same(read_log(path), RECORDING)


def tables_source(path: Path) -> tables.TableSource:
    return tables.TableSource(table_csv.CsvTable(path, CsvMap(), str(path)), JOINT)


# Time


@pytest.mark.parametrize(
    ("unit", "text", "ns"),
    [
        ("s", "1700000000.123456789", 1_700_000_000_123_456_789),
        ("s", "-0.5", -500_000_000),
        ("s", "1e-3", 1_000_000),
        ("ms", "1700000000123.456789", 1_700_000_000_123_456_789),
        ("us", "1700000000123456.789", 1_700_000_000_123_456_789),
        ("ns", "1700000000123456789", 1_700_000_000_123_456_789),
        ("ns", "-9223372036854775807", -9_223_372_036_854_775_807),
        ("s", "9223372036.854775807", 9_223_372_036_854_775_807),
    ],
)
def test_time_is_exact_to_the_nanosecond(path: Path, lines: list[str], unit: str, text: str, ns: int) -> None:
    lines[1] = text + lines[1][lines[1].index(",") :]
    path.write_text("\n".join(lines[:2]))
    log = read_log(path, replace(JOINT, time=TimeMap("time", unit)))
    assert [stream.stamp_ns.tolist() for stream in log.streams] == [[ns]] * 3


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("2024-05-01 12:00", ["column 'time' is '2024-05-01 12:00' in row 7", "must be a number"]),
        ("inf", ["column 'time' is 'inf' in row 7"]),
        ("", ["column 'time' has no time"]),
        ("9223372036.854775808", ["column 'time' is 9223372036.854775808 in row 7", "292 years"]),
        ("9223372036.8547758079", ["in row 7", "292 years"]),
        ("-1e28", ["in row 7", "292 years"]),
        ("1e40", ["in row 7"]),
    ],
)
def test_times_that_are_none(path: Path, lines: list[str], text: str, words: list[str]) -> None:
    lines[8] = text + lines[8][lines[8].index(",") :]
    path.write_text("\n".join(lines))
    message = refused(path)
    for word in words:
        assert word in message


# Cells


def test_empty_cells_are_nan_and_rows_without_a_robot_are_no_samples_of_it(
    path: Path, lines: list[str]
) -> None:
    """As when tables of several robots are merged by time: robot 2 takes every second row."""
    table = [line.split(",") for line in lines]
    of_two = [k for k, name in enumerate(table[0]) if name.startswith("omnid2.")]
    for number, row in enumerate(table[1:]):
        for k in of_two if number % 2 else ():
            row[k] = ("", "nan", "NULL", " ")[k % 4]
    table[5][1] = ""
    path.write_text("\n".join(",".join(row) for row in table))
    log = read_log(path)
    assert [len(stream.stamp_ns) for stream in log.streams] == [60, 30, 60]
    assert np.array_equal(log.streams[1].values, channels_of(RECORDING, 1)[::2])
    expected = channels_of(RECORDING, 0)
    expected[4, 0] = np.nan
    assert np.array_equal(log.streams[0].values, expected, equal_nan=True)


@pytest.mark.parametrize("cell", ["left", "0x10", "1_000", "true", '"a,b"', "1;2", "\x07"])
def test_cells_that_are_no_numbers(path: Path, lines: list[str], cell: str) -> None:
    row = lines[7].split(",")
    row[3] = cell
    lines[7] = ",".join(row)
    path.write_text("\n".join(lines))
    message = refused(path)
    assert "column 'omnid1.phi3' holds" in message
    assert "line 8; it must hold numbers" in message


def test_ragged_rows(path: Path, lines: list[str]) -> None:
    for spoiled, count in ((lines[30] + ",1", 38), (lines[30].rpartition(",")[0], 36), ("1", 1)):
        path.write_text("\n".join([*lines[:30], spoiled, *lines[31:]]))
        cells = "1 cell" if count == 1 else f"{count} cells"
        assert f"{cells} in line 31; every row must have 37, like the header" in refused(path)


# Columns


def test_missing_columns_are_named_with_what_there_is(path: Path) -> None:
    columns = RECORDING.columns()
    columns["omnid2.tua3"] = columns.pop("omnid2.tau3")
    message = refused(write_text(path, columns))
    assert (
        "missing column 'omnid2.tau3' for tau3 of robot 2 by map mocobot (did you mean 'omnid2.tua3'?)"
        in message
    )
    assert "the columns are time, omnid1.phi1" in message
    assert "(37 in all)" in message
    columns["omnid2.tau3"] = columns.pop("omnid2.tua3")
    del columns["time"]
    assert "missing column 'time' for time" in refused(write_text(path, columns))


def test_a_map_for_bags_says_so(path: Path, lines: list[str]) -> None:
    message = refused_map(path, builtin_map("omnid-ros2"))
    assert "map omnid-ros2: channels.h_x: missing key 'column', by which tables are read" in message


def refused_map(path: Path, log_map: LogMap) -> str:
    with pytest.raises(ValueError, match="map") as caught:
        read_log(path, log_map)
    return str(caught.value)


# Files


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "has no header"),
        (b"\n \n", "has no header"),
        (b"1,2,3\n4,5,6\n", "the first line holds values, not names"),
        (b"\x00\x01\x02\x03" * 100, "holds binary data"),
        (b"a,\xff\xfe,b\n1,2,3\n", "is not text in UTF-8"),
        ("time,a\n".encode("utf-16"), "holds binary data"),
        (b"x" * (2 << 20), "longer than 1 MiB"),
        (b'time,"a\n1,2\n', "unmatched quotation mark"),
        (b"hello\n", "missing column 'omnid1.phi1'"),
    ],
    ids=range(9),
)
def test_files_that_are_no_tables(path: Path, content: bytes, words: str) -> None:
    path.write_bytes(content)
    assert words in refused(path)


def test_one_endless_row(path: Path, lines: list[str]) -> None:
    path.write_bytes(f"{lines[0]}\n{lines[1]}\n".encode() + b"9" * (9 << 20))
    assert "a row is longer than 4 MiB" in refused(path)


def test_truncated_anywhere_is_read_up_to_there_or_refused(path: Path, lines: list[str]) -> None:
    content = "\n".join(lines).encode()
    for cut in np.random.default_rng(3).integers(0, len(content), 60):
        path.write_bytes(content[:cut])
        complete = content[:cut].count(b"\n")
        try:
            log = read_log(path)
        except ValueError as error:
            assert str(error).startswith(f"{path}: ")  # noqa: PT017 - either way is fine
        else:
            assert len(log.streams[0].stamp_ns) in (complete - 1, complete)


DATES_RECORDING = small_recording(rows=60, ref=False)
START_NS = 1_772_366_400_000_000_000
"""2026-03-01T12:00:00Z."""


def stamps(*texts: str | None, unit_ns: int | None = 10**9) -> list[int]:
    read, is_there = TextClock(unit_ns, "f: column 't'").read(pa.array(texts, pa.string()), 0)
    assert is_there.tolist() == [text is not None for text in texts]
    return read.tolist()


@pytest.mark.parametrize(
    ("text", "after_ns"),
    [
        ("2026-03-01T12:00:00.123456789Z", 123_456_789),
        ("2026-03-01 12:00:00.000000001+00:00", 1),
        ("2026-03-01t13:00:00+01:00", 0),
        ("2026-03-01T06:30:01,5-0530", 1_500_000_000),
        ("20260301T120002Z", 2_000_000_000),
        ("2026-03-01T12:01Z", 60_000_000_000),
        ("2026-03-01T12:00:00 UTC", 0),
        ("  2026-03-01T12:00:00Z ", 0),
        ("2026-03-01T12:00:00.1234567899Z", 123_456_789),
        ("2026-02-28T23:59:59Z", -43_201_000_000_000),
    ],
)
def test_every_way_to_write_a_date(text: str, after_ns: int) -> None:
    """Alone, and mixed with another one."""
    assert is_date(text)
    assert stamps(text) == [START_NS + after_ns]
    assert stamps("2026-03-01T12:00:00.000Z", None, text, unit_ns=None) == [START_NS, 0, START_NS + after_ns]


@settings(max_examples=60, deadline=None)
@given(
    st.datetimes(datetime(1700, 1, 1), datetime(2250, 1, 1)),
    st.integers(0, 999),
    st.integers(-14 * 60, 14 * 60),
)
def test_any_date_is_pythons(moment: datetime, below_ns: int, zone_min: int) -> None:
    text = f"{moment.isoformat(timespec='microseconds')}{below_ns:03d}"
    zone = timezone(timedelta(minutes=zone_min))
    since = moment.replace(tzinfo=zone) - datetime(1970, 1, 1, tzinfo=UTC)
    exact = (since // timedelta(microseconds=1)) * 1000 + below_ns
    sign, size = "-" if zone_min < 0 else "+", abs(zone_min)
    assert stamps(f"{text}{sign}{size // 60:02d}:{size % 60:02d}") == [exact]


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (("2026-03-01T12:00:00Z", "12.5"), "is '12.5' in row 1; a time must be a date like"),
        (("12.5", "2026-03-01T12:00:00Z"), "is '2026-03-01T12:00:00Z' in row 1; a time must be a number"),
        (("2026-03-01T12:00:00Z", None, "2026-03-01T12:00:00"), "row 2; all times must be with a time zone"),
        (("2026-03-01T12:00:00", "2026-03-01T12:00:00Z"), "row 1; all times must be without a time zone"),
        (("2026-02-29T12:00:00",), "there is no such date"),
        (("2026-13-01T12:00:00",), "there is no such date"),
        (("2026-00-10T12:00:00",), "there is no such date"),
        (("2026-03-01T24:00:00",), "there is no such date"),
        (("2026-03-01T12:60:00",), "there is no such date"),
        (("2026-03-01T12:00:60",), "there is no such date"),
        (("1600-03-01T12:00:00",), "within 292 years of 1970"),
        (("March 1st",), "a time must be a number"),
    ],
)
def test_what_is_no_date(texts: tuple[str | None, ...], words: str) -> None:
    with pytest.raises(InputError) as caught:
        stamps(*texts)
    assert str(caught.value).startswith("f: column 't' is ")
    assert words in str(caught.value)


# Files


def lines_of_dates(time: list[str] | None = None, delimiter: str = ",") -> list[str]:
    columns = DATES_RECORDING.columns()
    first = time or [repr(float(t)) for t in DATES_RECORDING.time]
    names = [name for name in columns if name != "time"]
    body = [delimiter.join([first[k], *(repr(float(columns[n][k])) for n in names)]) for k in range(60)]
    return [delimiter.join(["time", *names]), *body]


def write(path: Path, content: list[str], end: str = "\n") -> Path:
    path.write_bytes(end.join([*content, ""]).encode())
    return path


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_a_log_with_dates(tmp_path: Path, delimiter: str) -> None:
    time = [
        (datetime(2026, 3, 1, 12) + timedelta(milliseconds=10 * k)).isoformat(" ", "milliseconds")
        for k in range(60)
    ]
    log = read_log(write(tmp_path / "log.csv", lines_of_dates(time, delimiter)))
    assert log.streams[2].stamp_ns.tolist() == [START_NS + k * 10**7 for k in range(60)]
    np.testing.assert_array_equal(log.streams[1].values[:, :3], DATES_RECORDING.phi[:, 1])


def test_a_map_may_ask_for_dates(tmp_path: Path) -> None:
    import tomllib

    text = builtin_map_text("mocobot").replace('unit = "s"', 'column = "time"\nunit = "iso"', 1)
    log_map = parse_map(tomllib.loads(text), "iso.toml")
    assert "'iso', which is for dates" in refused(write(tmp_path / "log.csv", lines_of_dates()), log_map)
    time = [f"2026-03-01T12:00:{k:02d}Z" for k in range(60)]
    assert (
        read_log(write(tmp_path / "log.csv", lines_of_dates(time)), log_map).streams[0].stamp_ns[59]
        == START_NS + 59 * 10**9
    )


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize(
    "places",
    [
        {0: ["# made by a robot, in 2026, with commas", "", "# 1,2,3"]},
        {1: ["#", "   # indented"]},
        {1: ["# before"], 31: ["# in the middle", "#more"], 61: ["# at the end"]},
        {61: ["# the last line, cut o"]},
    ],
)
def test_remarks_are_skipped(tmp_path: Path, places: dict[int, list[str]], end: str) -> None:
    content = [line for k in range(62) for line in [*places.get(k, []), *lines_of_dates()[k : k + 1]]]
    assert_same(read_log(write(tmp_path / "log.csv", content, end)), DATES_RECORDING)
    assert_same(
        read_log(write(tmp_path / "log.csv", [*content[:-1], content[-1].rstrip()], end)), DATES_RECORDING
    )


@pytest.mark.parametrize("remarks", [[], ["# a remark"], ["# numpy writes it so", "", "# and so"]])
def test_a_header_may_be_a_remark(tmp_path: Path, remarks: list[str]) -> None:
    """As numpy writes it: then the last remark before the rows."""
    header, *rows = lines_of_dates()
    assert_same(read_log(write(tmp_path / "log.csv", [*remarks, f"# {header}", *rows])), DATES_RECORDING)
    dates = lines_of_dates([f"2026-03-01T12:00:{k:02d}" for k in range(60)])[1:]
    assert (
        read_log(write(tmp_path / "log.csv", [*remarks, f"#{header}", *dates])).streams[0].stamp_ns[0]
        == START_NS
    )


def test_faults_are_counted_by_the_lines_of_the_file(tmp_path: Path) -> None:
    content = lines_of_dates()
    content[10] = content[10].replace(",", ",x", 1)
    content[5:5] = ["# one", "# two"]
    message = refused(write(tmp_path / "log.csv", ["# zero", *content]))
    assert "in line 14; it must hold numbers" in message
    content[12] = "1,2"
    assert "2 cells in line 14; every row must have 28" in refused(
        write(tmp_path / "log.csv", ["# zero", *content])
    )


HINTS_RECORDING = small_recording(rows=60)


def lines_of_hints(path: Path, **how: str) -> list[str]:
    return write_text(path, HINTS_RECORDING.columns(), **how).read_text().splitlines()


def test_columns_of_fixed_width(tmp_path: Path) -> None:
    """Numbers with blanks before and behind them, time among them."""
    first, *rows = lines_of_hints(tmp_path / "log.csv")
    padded = [",".join(f"  {cell} " for cell in row.split(",")) for row in rows]
    (tmp_path / "log.csv").write_text("\n".join([first, *padded]))
    assert_same(read_log(tmp_path / "log.csv"), HINTS_RECORDING)

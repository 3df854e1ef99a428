"""Dates of ISO 8601 as stamps, against Python's own, and lines that are remarks."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.errors import InputError
from log_files import assert_same, read_log, refused
from mocobot_logs.maps import builtin_map_text, parse_map
from mocobot_logs.table import csv as table_csv
from mocobot_logs.table.text import TextClock, is_date
from recordings import small_recording

RECORDING = small_recording(rows=60, ref=False)
START_NS = 1_772_366_400_000_000_000
"""2026-03-01T12:00:00Z."""


def stamps(*texts: str | None, unit_ns: int | None = 10**9) -> list[int]:
    read, is_there = TextClock(unit_ns, "f: column 't'").read(pa.array(texts, pa.string()), 0)
    assert is_there.tolist() == [text is not None for text in texts]
    return read.tolist()


def test_the_start_is_pythons() -> None:
    assert datetime(2026, 3, 1, 12, tzinfo=UTC).timestamp() * 10**9 == START_NS


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


def test_dates_without_a_zone_count_as_utc() -> None:
    assert stamps("2026-03-01T12:00:00.5", "2026-03-01 12:00:01") == [START_NS + 5 * 10**8, START_NS + 10**9]


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


def test_one_form_from_block_to_block() -> None:
    clock = TextClock(10**9, "t")
    clock.read(pa.array([None], pa.string()), 0)
    clock.read(pa.array(["2026-03-01T12:00:00Z"]), 1)
    with pytest.raises(InputError, match="in row 2; all times must be with a time zone"):
        clock.read(pa.array(["2026-03-01T12:00:00"]), 2)


def test_numbers_where_the_map_says_dates() -> None:
    with pytest.raises(InputError, match="the map's unit of time is 'iso', which is for dates"):
        stamps("12.5", unit_ns=None)


# Files


def lines(time: list[str] | None = None, delimiter: str = ",") -> list[str]:
    columns = RECORDING.columns()
    first = time or [repr(float(t)) for t in RECORDING.time]
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
    log = read_log(write(tmp_path / "log.csv", lines(time, delimiter)))
    assert log.streams[2].stamp_ns.tolist() == [START_NS + k * 10**7 for k in range(60)]
    np.testing.assert_array_equal(log.streams[1].values[:, :3], RECORDING.phi[:, 1])


def test_a_map_may_ask_for_dates(tmp_path: Path) -> None:
    import tomllib

    text = builtin_map_text("mocobot").replace('unit = "s"', 'column = "time"\nunit = "iso"', 1)
    log_map = parse_map(tomllib.loads(text), "iso.toml")
    assert "'iso', which is for dates" in refused(write(tmp_path / "log.csv", lines()), log_map)
    time = [f"2026-03-01T12:00:{k:02d}Z" for k in range(60)]
    assert (
        read_log(write(tmp_path / "log.csv", lines(time)), log_map).streams[0].stamp_ns[59]
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
    content = [line for k in range(62) for line in [*places.get(k, []), *lines()[k : k + 1]]]
    assert_same(read_log(write(tmp_path / "log.csv", content, end)), RECORDING)
    assert_same(read_log(write(tmp_path / "log.csv", [*content[:-1], content[-1].rstrip()], end)), RECORDING)


@pytest.mark.parametrize("remarks", [[], ["# a remark"], ["# numpy writes it so", "", "# and so"]])
def test_a_header_may_be_a_remark(tmp_path: Path, remarks: list[str]) -> None:
    """As numpy writes it: then the last remark before the rows."""
    header, *rows = lines()
    assert_same(read_log(write(tmp_path / "log.csv", [*remarks, f"# {header}", *rows])), RECORDING)
    dates = lines([f"2026-03-01T12:00:{k:02d}" for k in range(60)])[1:]
    assert (
        read_log(write(tmp_path / "log.csv", [*remarks, f"#{header}", *dates])).streams[0].stamp_ns[0]
        == START_NS
    )


def test_faults_are_counted_by_the_lines_of_the_file(tmp_path: Path) -> None:
    content = lines()
    content[10] = content[10].replace(",", ",x", 1)
    content[5:5] = ["# one", "# two"]
    message = refused(write(tmp_path / "log.csv", ["# zero", *content]))
    assert "in line 14; it must hold numbers" in message
    content[12] = "1,2"
    assert "2 cells in line 14; every row must have 28" in refused(
        write(tmp_path / "log.csv", ["# zero", *content])
    )


def test_remarks_across_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks of any size cut remarks and rows anywhere."""
    content = [line for k, row in enumerate(lines()) for line in ([row, f"# {k}, a remark"])]
    path = write(tmp_path / "log.csv", content)
    for size in (2000, 3000, 5000):
        monkeypatch.setattr(table_csv, "BLOCK_BYTES", size)
        assert_same(read_log(path), RECORDING)


def test_nothing_but_remarks(tmp_path: Path) -> None:
    assert "missing column" in refused(write(tmp_path / "log.csv", ["# one", "# two"]))

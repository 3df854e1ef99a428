"""Readers and maps on input that nobody designed: a result or one sentence, never anything else."""

from __future__ import annotations

import io
import re
import struct
import zipfile
from collections.abc import Callable
from decimal import ROUND_HALF_EVEN, Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.errors import InputError
from fuzzing import FORMATS, KINDS, check_original, try_damaged, write_original
from mocobot_logs.log import CHANNELS, REF, collect
from mocobot_logs.maps import TIME_UNITS, parse_map
from mocobot_logs.open_log import open_log
from mocobot_logs.table.text import from_numbers, from_text

BOUNDED = settings(max_examples=150, deadline=None, derandomize=True, database=None)


@pytest.mark.parametrize("kind", FORMATS)
def test_damaged_files(tmp_path: Path, kind: str) -> None:
    """A short run of benchmarks/fuzz_readers.py."""
    log, file = write_original(kind, tmp_path)
    content = file.read_bytes()
    check_original(kind, log)
    outcomes = [try_damaged(kind, log, file, content, seed) for seed in range(1000, 1025)]
    assert not [outcome for outcome in outcomes if outcome.is_fault]
    assert sum(outcome.result == "refused" for outcome in outcomes) > 5
    check_original(kind, log)


@pytest.mark.parametrize("kind", ["URDF", "words of a map", "locks", "joint states", "joint columns"])
def test_damaged_models_maps_and_joint_logs(tmp_path: Path, kind: str) -> None:
    """The same for what commands of a single robot read."""
    file = tmp_path / KINDS[kind].name
    KINDS[kind].write(file)
    content = file.read_bytes()
    check_original(kind, file)
    count = 100 if kind in ("URDF", "locks") else 20
    outcomes = [try_damaged(kind, file, file, content, seed) for seed in range(1000, 1000 + count)]
    assert not [outcome for outcome in outcomes if outcome.is_fault]
    assert sum(outcome.result == "refused" for outcome in outcomes) > 5


def refusal(call: Callable[[], object]) -> str | None:
    """What an InputError says, None if there is none; anything else goes through."""
    try:
        call()
    except InputError as error:
        return str(error)
    return None


def read_or_refused(path: Path) -> None:
    message = refusal(lambda: collect(open_log(path)))
    assert message is None or (message.startswith(f"{path}: ") and message.isprintable())


CELLS = st.one_of(
    st.floats().map(repr),
    st.integers().map(str),
    st.sampled_from(["", "nan", "NA", '"', '"1"', ",", "1;2", "\0", "\n", "\r\n", "1e5", " 7 ", "−1", "٣"]),
    st.text(max_size=8),
)


@BOUNDED
@given(rows=st.lists(st.lists(CELLS, max_size=30), max_size=6), tail=st.binary(max_size=20))
def test_any_cells_in_a_text_table(
    tmp_path_factory: pytest.TempPathFactory, rows: list[list[str]], tail: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "any.csv"
    header = ",".join(["time", *(f"omnid1.{name}" for name in CHANNELS["joint"])])
    lines = [header, *(",".join((row * 10)[:10]) if len(row) > 3 else ",".join(row) for row in rows)]
    path.write_bytes("\n".join(lines).encode("utf-8", "surrogatepass") + tail)
    read_or_refused(path)


@BOUNDED
@given(
    content=st.binary(max_size=300),
    suffix=st.sampled_from([".csv", ".npz", ".parquet", ".mcap", ".db3", ".log"]),
)
def test_any_bytes_under_any_name(
    tmp_path_factory: pytest.TempPathFactory, content: bytes, suffix: str
) -> None:
    path = tmp_path_factory.getbasetemp() / f"any{suffix}"
    path.write_bytes(content)
    read_or_refused(path)


@BOUNDED
@given(
    descr=st.sampled_from(
        ["'<f8'", "'|O'", "'<i4'", "'|S0'", "[('a', '<f8')]", "'<U5'", "'>f2'", "None", "'<m8'"]
    ),
    fortran=st.sampled_from(["True", "False", "0", "None"]),
    shape=st.sampled_from(
        [
            "(3,)",
            "(3, 1, 3)",
            "(1, 3)",
            "(0,)",
            "()",
            "(-3,)",
            "3",
            "(2.5,)",
            "(True,)",
            "(10**9,)",
            "(1000000000,)",
        ]
    ),
    version=st.integers(0, 4),
    data=st.binary(max_size=80),
)
def test_any_array_in_an_archive(
    tmp_path_factory: pytest.TempPathFactory, descr: str, fortran: str, shape: str, version: int, data: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "any.npz"
    raw = f"{{'descr': {descr}, 'fortran_order': {fortran}, 'shape': {shape}, }}".encode().ljust(117) + b"\n"
    head = b"\x93NUMPY" + bytes([version, 0]) + struct.pack("<H" if version < 2 else "<I", len(raw)) + raw
    good = io.BytesIO()
    np.save(good, np.zeros((3, 1, 3)))
    with zipfile.ZipFile(path, "w") as archive:
        for name in ("time", "phi", "theta", "tau"):
            archive.writestr(f"{name}.npy", head + data if name in ("time", "phi") else good.getvalue())
    read_or_refused(path)


# Time


@BOUNDED
@given(
    value=st.decimals(
        allow_nan=False, allow_infinity=False, places=12, min_value=-(10**10), max_value=10**10
    ),
    unit=st.sampled_from(list(TIME_UNITS)),
)
def test_decimal_time_is_rounded_to_the_nanosecond(value: Decimal, unit: str) -> None:
    expected = int((value * TIME_UNITS[unit]).to_integral_value(ROUND_HALF_EVEN))
    text = pa.array([f"{value:f}", None])
    if abs(expected) >= 1 << 63:
        with pytest.raises(InputError, match="292 years"):
            from_text(text, TIME_UNITS[unit], "t")
    else:
        stamps, given_ = from_text(text, TIME_UNITS[unit], "t")
        assert int(stamps[0]) == expected
        assert given_.tolist() == [True, False]


@BOUNDED
@given(value=st.integers(-(2**63), 2**63 - 1), unit=st.sampled_from(list(TIME_UNITS)))
def test_whole_times_are_exact(value: int, unit: str) -> None:
    expected = value * TIME_UNITS[unit]
    if abs(expected) >= 1 << 63:
        with pytest.raises(InputError, match="292 years"):
            from_numbers(np.array([value]), TIME_UNITS[unit], "t")
    else:
        assert int(from_numbers(np.array([value]), TIME_UNITS[unit], "t")[0][0]) == expected


@BOUNDED
@given(value=st.floats(), unit=st.sampled_from(list(TIME_UNITS)))
def test_times_of_floats_are_rounded(value: float, unit: str) -> None:
    try:
        stamps, given_ = from_numbers(np.array([value]), TIME_UNITS[unit], "t")
    except InputError:
        assert not abs(value) * TIME_UNITS[unit] < 2**63 - 2**10
    else:
        assert bool(given_[0]) == (value == value)
        if given_[0]:
            assert abs(Decimal(int(stamps[0])) - Decimal(value) * TIME_UNITS[unit]) <= max(
                0.5, 2.0**-52 * abs(value) * TIME_UNITS[unit]
            )


# Maps

WORDS = """version level robots trial time csv defaults channels robot column unit clock delimiter decimal topic
joint field sign offset counts_per_turn optional 1 2 x"""
KEYS = st.sampled_from([*re.findall(r"\w+", WORDS), *CHANNELS["joint"], *CHANNELS["wrist"], *REF])
SCALARS = st.one_of(
    st.integers(-2, 3),
    st.integers(),
    st.floats(),
    st.booleans(),
    st.sampled_from(
        ["joint", "wrist", "rad", "m", "N", "Nm", "s", "header", "random", "{robot}", "{", "a[{robot0}]"]
    ),
    st.text(max_size=5),
)
TABLES = st.recursive(
    SCALARS, lambda inner: st.one_of(st.lists(inner, max_size=2), st.dictionaries(KEYS, inner, max_size=6))
)


def good_map(level: str) -> dict[str, Any]:
    units = {"phi": "deg", "the": "rad", "tau": "mNm", "h_x": "mm", "h_y": "m", "h_z": "m", "for": "N"}
    channels = {name: {"column": f"{name}_{{robot}}", "unit": units[name[:3]]} for name in CHANNELS[level]}  # type: ignore[index]
    return {"version": 1, "level": level, "channels": channels, "time": {"column": "t", "unit": "s"}}


@settings(BOUNDED, max_examples=250)
@given(
    level=st.sampled_from(["joint", "wrist"]),
    changes=st.lists(st.tuples(st.lists(KEYS, min_size=1, max_size=3), TABLES), max_size=3),
)
def test_any_map(level: str, changes: list[tuple[list[str], Any]]) -> None:
    values = good_map(level)
    for path, value in changes:
        table: Any = values
        for key in path[:-1]:
            inner = table.get(key)
            table[key] = dict(inner) if isinstance(inner, dict) else {}
            table = table[key]
        table[path[-1]] = value
    message = refusal(lambda: parse_map(values, "any"))
    if message is not None:
        assert message.startswith("map any")
        assert message.isprintable()
        return
    log_map = parse_map(values, "any")
    for robot in (1, 2, 1000):
        for channel in log_map.channels(robot).values():
            assert np.isfinite(channel.apply(np.zeros(1)))

"""``residuals.npz``: what goes in comes out in single precision, and what is broken is refused in one sentence."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from discrepancy.result.traces import TABLES, Channel, Trace, load_traces, save_traces
from estimator import inputs
from estimator.errors import InputError

EPOCH_S = 1.7e9
CHANNELS = [Channel("force x", "balance", None, "N"), Channel("grasp 2 rotation x", "kinematic", 2, "rad")]


def made_trace(name: str, rows: int = 40, moving: int = 30) -> Trace:
    rng = np.random.default_rng(rows)
    tables = {table: rng.standard_normal((rows, len(CHANNELS))) for table in TABLES}
    time = EPOCH_S + np.arange(rows) / 12.5  # clocks of real robots count from 1970
    quantities = {"speed": rng.uniform(size=rows), "load in N": rng.uniform(size=rows)}
    return Trace(name, time, moving, 12.5, quantities=quantities, **tables)


@pytest.fixture
def written(tmp_path: Path) -> Path:
    path = tmp_path / "residuals.npz"
    save_traces([made_trace("a.parquet"), made_trace("b/ä.parquet", 0, 0)], CHANNELS, path)
    return path


def test_what_is_saved_is_loaded(written: Path) -> None:
    traces, channels = load_traces(written)
    assert channels == CHANNELS
    for trace, original in zip(
        traces, [made_trace("a.parquet"), made_trace("b/ä.parquet", 0, 0)], strict=True
    ):
        assert (trace.name, trace.moving, trace.rate_hz) == (original.name, original.moving, original.rate_hz)
        np.testing.assert_array_equal(trace.time, original.time)
        for table in TABLES:
            values = getattr(trace, table)
            assert values.dtype == float
            np.testing.assert_allclose(values, getattr(original, table), rtol=2.0**-24)
        assert list(trace.quantities) == ["speed", "load in N"]
        for name, values in trace.quantities.items():
            np.testing.assert_allclose(values, original.quantities[name], rtol=2.0**-24)


def edited(
    path: Path, change: Callable[[dict[str, Any]], None], facts: Callable[[Any], Any] | None = None
) -> None:
    """Rewrite some arrays, and the JSON among them."""
    with np.load(path) as file:
        arrays = dict(file)
    if facts is not None:
        values = json.loads(arrays["facts"].tobytes())
        values = facts(values)
        arrays["facts"] = np.frombuffer(json.dumps(values).encode(), dtype=np.uint8)
    change(arrays)
    np.savez(path, **arrays)


def put(name: str, value: Any) -> Callable[[dict[str, Any]], None]:
    return lambda arrays: arrays.__setitem__(name, value)


def with_fact(**changes: Any) -> Callable[[Any], Any]:
    return lambda values: values | changes


def with_trial(**changes: Any) -> Callable[[Any], Any]:
    return lambda values: values | {"trials": [values["trials"][0] | changes, *values["trials"][1:]]}


@pytest.mark.parametrize(
    ("change", "facts", "words"),
    [
        (lambda arrays: arrays.pop("before0"), None, "'before0' is missing"),
        (lambda arrays: arrays.pop("facts"), None, "'facts' is missing"),
        (put("after0", np.zeros((40, 3), np.float32)), None, "after0 must hold finite numbers"),
        (put("time0", np.full(40, np.nan)), None, "time0 must hold finite numbers"),
        (put("sigma0", np.zeros((40, 2), "<U3")), None, "sigma0 must hold finite numbers"),
        (put("facts", np.frombuffer(b"{not json", np.uint8)), None, "Expecting property name"),
        (put("facts", np.frombuffer(b"[" * 100_000, np.uint8)), None, "recursion"),
        (put("facts", np.frombuffer(b"\xff\xff", np.uint8)), None, "can't decode"),
        (dict.copy, with_fact(format="other"), "it must have format 'mocobot-residuals'"),
        (dict.copy, with_fact(version=2), "and version 1"),
        (dict.copy, with_fact(channels=[{"name": "x"}]), "'robot' is missing"),
        (dict.copy, with_fact(trials=3), "not iterable"),
        (dict.copy, lambda values: [values], "list indices"),
        (dict.copy, with_trial(moving=41), "moving is 41 in trial 1"),
        (dict.copy, with_trial(moving=True), "moving is True in trial 1"),
        (dict.copy, with_trial(rate_hz="fast"), "rate_hz is 'fast' in trial 1"),
        (dict.copy, with_trial(rate_hz=0), "rate_hz is 0 in trial 1"),
    ],
)
def test_incomplete_contents_are_refused(written: Path, change, facts, words: str) -> None:
    edited(written, change, facts)
    with pytest.raises(InputError) as refused:
        load_traces(written)
    message = str(refused.value)
    assert message.startswith(f"{written}: not the residuals of a diagnosis")
    assert words in message
    assert "\n" not in message


def test_damaged_files_are_refused(written: Path, tmp_path: Path) -> None:
    whole = written.read_bytes()
    pickled = io.BytesIO()
    np.savez(pickled, facts=np.array([{"a": 1}], dtype=object))
    plain = io.BytesIO()
    np.save(plain, np.zeros(3))
    other = io.BytesIO()
    with zipfile.ZipFile(other, "w") as archive:
        archive.writestr("facts.npy", b"text")
    middle = len(whole) // 2
    spoilt = whole[:middle] + bytes(64) + whole[middle + 64 :]
    cases = [whole[:k] for k in (0, 3, 100, middle, len(whole) - 5)]
    cases += [b"text", pickled.getvalue(), plain.getvalue(), other.getvalue(), spoilt]
    for content in cases:
        path = tmp_path / "broken.npz"
        path.write_bytes(content)
        with pytest.raises(InputError, match="not the residuals of a diagnosis"):
            load_traces(path)


def test_a_file_that_unpacks_to_too_much(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inputs, "FREE_BYTES", 1 << 20)
    save_traces([made_trace("a")], CHANNELS, path := tmp_path / "residuals.npz")
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("more.npy", bytes(10 << 20))
    with pytest.raises(
        InputError, match=r"residuals.npz: unpacks to at least 0.0097\d* GiB; the limit is 0.00"
    ):
        load_traces(path)

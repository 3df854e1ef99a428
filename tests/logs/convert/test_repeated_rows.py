"""Logs in which rows repeat the one before: one reading each, in every format, said and counted."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import joint_logs
from command import refused, run
from estimator.errors import InputError
from estimator.recording.model import Recording
from joint_logs import columns, motion, write_csv
from log_files import write_lerobot
from mocobot_logs.convert import Converted, Labels, convert, write_converted
from mocobot_logs.open_log import open_log
from omnid_design import DESIGN
from recordings import small_recording

FORMATS = ["log.csv", "log.npz", "log.parquet", "bag", "lerobot"]


def with_rows(index: np.ndarray, rate_hz: float = 100.0) -> Recording:
    whole = small_recording(rows=3000, robots=2, ref=False)
    fields = {name: getattr(whole, name)[index] for name in ("phi", "theta", "tau")}
    metadata = replace(whole.metadata, rate_hz=rate_hz)
    return replace(whole, time=np.arange(len(index)) / rate_hz, metadata=metadata, **fields)


def written(recording: Recording, path: Path) -> Path:
    if path.name == "lerobot":
        return write_lerobot(path, [recording], fps=recording.metadata.rate_hz)
    write_converted(recording, path)
    return path


def converted(path: Path) -> Converted:
    return convert(open_log(path), Labels(), DESIGN)


@pytest.mark.parametrize("name", FORMATS)
def test_a_logger_that_is_faster_than_its_messages(tmp_path: Path, name: str) -> None:
    index = np.arange(3000) // 2
    done = converted(written(with_rows(index, 200.0), tmp_path / name))
    assert [stream.repeats for stream in done.streams] == [1500, 1500]
    assert [stream.samples for stream in done.streams] == [3000, 3000]
    assert [stream.native_hz for stream in done.streams] == pytest.approx([100.0, 100.0], rel=1e-4)
    assert done.streams[0].to_dict()["repeats"] == 1500
    if name != "lerobot":  # of 32 bits
        assert np.array_equal(done.recording.tau, with_rows(np.arange(1500)).tau)


@pytest.mark.parametrize("name", FORMATS)
def test_a_logger_that_stuck(tmp_path: Path, name: str) -> None:
    index = np.arange(3000)
    index[1000:1400] = 1000
    with pytest.raises(
        InputError, match=r"no samples for 4 s, from 10 s .* that repeat the one before count"
    ):
        converted(written(with_rows(index), tmp_path / name))


def test_equal_rows_are_one_reading_for_every_command(tmp_path, capsys) -> None:
    rows = with_rows(np.zeros(3000, dtype=int))
    said = "1 samples (2999 rows repeat the one before, and a reading counts once); at least 16 are needed"
    for name in FORMATS[:4]:
        path = written(rows, tmp_path / name)
        for command in ("estimate", "calibrate", "diagnose"):
            assert said in refused(capsys, command, path, "--out", tmp_path / "out.json")
        assert not (tmp_path / "out.json").exists()
        code, out, _ = run(capsys, "inspect", path, "--json", tmp_path / "found.json", "--force")
        assert code == 0
        assert "2999 rows repeat the one before" in out
        assert "ready for: nothing" in out
        found = json.loads((tmp_path / "found.json").read_text())
        assert [stream["repeats"] for stream in found["streams"]] == [2999, 2999]


def test_messages_at_four_fifths_of_the_loggers_rate(tmp_path: Path) -> None:
    """No interval tells whether a reading is missing, and none is taken to be."""
    index = np.floor(0.8 * np.arange(3000)).astype(int)
    stream = converted(written(with_rows(index), tmp_path / "log.csv")).streams[0]
    assert (stream.repeats, stream.filled) == (600, 0)


def test_joint_logs(tmp_path: Path) -> None:
    time = np.arange(3000) / 500.0
    index = np.arange(3000)
    index[1000:1300] = 1000
    rng = np.random.default_rng(0)
    made = {
        name: column + 0.01 * name.endswith(".tau") * rng.standard_normal(3000)
        for name, column in columns(time).items()
    }
    values = {name: (column if name == "t" else column[index]) for name, column in made.items()}
    first, second = joint_logs.read(write_csv(tmp_path / "log.csv", values))
    assert first.notes[0] == "299 rows repeat the one before, and a reading counts once."
    assert second.start_s == pytest.approx(2.6)
    np.testing.assert_allclose(second.q[0], motion(np.array([2.6]))[0][0])

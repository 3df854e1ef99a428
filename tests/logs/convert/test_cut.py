"""Parts of logs: what is cropped, dropped, missing, too short, and what is said of it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import command
import mocobot
from estimator.errors import InputError
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording, write_recording
from log_files import write_text
from mocobot_logs.bag.write import write_bag
from recordings import small_recording

ROWS = 4000
RECORDING = small_recording(rows=ROWS, ref=False)
FIELDS = ("phi", "theta", "tau")


def holed(missing: dict[int, slice]) -> Recording:
    """The recording with NaN in tau2 of some robots, from 0."""
    tau = RECORDING.tau.copy()
    for robot, rows in missing.items():
        tau[rows, robot, 1] = np.nan
    return replace(RECORDING, tau=tau)


def written(recording: Recording, path: Path) -> Path:
    """A log of any format, whatever is in it."""
    if path.suffix == ".csv":
        return write_text(path, dict(recording.columns()))
    if path.suffix == ".parquet":
        write_recording(recording, path)
    else:
        write_bag(recording, path)
    return path


def assert_rows(read: Recording, rows: slice) -> None:
    """These rows of the recording, bit by bit."""
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(read, field), getattr(RECORDING, field)[rows])


@pytest.fixture(params=["log.csv", "log.parquet", "log.mcap"])
def name(request: pytest.FixtureRequest) -> str:
    return request.param


# NaN


def test_single_rows_without_a_value_are_filled_in(tmp_path: Path, name: str) -> None:
    """As if they were not there: the same as in a log that lacks these rows."""
    log = written(holed({1: slice(500, 502), 2: slice(700, 701)}), tmp_path / name)
    found = mocobot.convert(log)
    assert len(found.recording.time) == ROWS
    assert np.isfinite(found.recording.tau).all()
    same = np.ones(ROWS, bool)
    same[500:502] = False
    np.testing.assert_array_equal(found.recording.tau[same, 1], RECORDING.tau[same, 1])
    assert not np.array_equal(found.recording.tau[500:502, 1, 0], RECORDING.tau[500:502, 1, 0])
    assert [(s.blank, s.filled, s.gaps) for s in found.streams] == [(0, 0, 0), (2, 2, 1), (1, 1, 1)]
    assert [s.blank_channels for s in found.streams] == [{}, {"tau2": 2}, {"tau2": 1}]
    report = found.report("out.parquet")
    assert "2 rows of robot 2 without all values (NaN: tau2 2) count as missing" in report
    assert "samples of all robots: taken as they are, missing ones filled in" in report
    text = (tmp_path / "gone.csv").open("w")
    with text:
        print(*RECORDING.columns(), sep=",", file=text)
        for k in range(ROWS):  # robot 2 has no cells at all in two rows
            cells = [
                "" if key.startswith("omnid2") and k in (500, 501) else float(values[k])
                for key, values in RECORDING.columns().items()
            ]
            print(*cells, sep=",", file=text)
    gone = mocobot.convert(tmp_path / "gone.csv").recording
    np.testing.assert_array_equal(gone.tau[:, 1], found.recording.tau[:, 1])


# Crop and drop


@pytest.mark.parametrize(
    ("crop", "rows"),
    [
        ("12:25", slice(1200, 2501)),
        ("12:", slice(1200, ROWS)),
        (":25.5", slice(0, 2551)),
        ("0:1000", slice(0, ROWS)),
        ("1.2345:2", slice(124, 201)),
        (".5:.75", slice(50, 76)),
    ],
)
def test_a_crop_keeps_what_lies_in_it(tmp_path: Path, crop: str, rows: slice) -> None:
    log = written(RECORDING, tmp_path / "log.parquet")
    assert_rows(mocobot.convert(log, crop=crop).recording, rows)


def test_crop_and_drop(tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Seconds count from the log's start, whatever its stamps; drops that overlap are one."""
    log = written(RECORDING, tmp_path / name)
    out, facts = tmp_path / "out.parquet", tmp_path / "facts.json"
    code, text, _ = command.run(
        capsys, "convert", log, out, "--crop", "10:30", "--json", facts,
        "--drop", "robot=2:20-20.03", "--drop", "robot=2:20.02-20.04", "--drop", "robot=3:25-25",
    )  # fmt: skip
    assert code == 0
    read = read_recording(out)
    assert len(read.time) == 2001
    np.testing.assert_array_equal(read.phi[:, 0], RECORDING.phi[1000:3001, 0])
    changed = np.flatnonzero((read.phi != RECORDING.phi[1000:3001])[:, 1].any(axis=1))
    np.testing.assert_array_equal(changed, np.arange(1000, 1005))
    np.testing.assert_array_equal(
        np.flatnonzero((read.phi != RECORDING.phi[1000:3001])[:, 2].any(axis=1)), [1500]
    )
    for words in (
        f"[[Log {log} (10 to 30 s)]]",
        "0 to 10 s: cropped",
        "30 to 39.99 s: cropped",
        "20 to 20.03 s of robot 2: 4 samples, dropped",
        "20.02 to 20.04 s of robot 2: 3 samples, dropped",
        "25 to 25 s of robot 3: 1 sample, dropped",
    ):
        assert words in text
    values = json.loads(facts.read_text())
    assert values["format"] == "mocobot-conversion"
    (part,) = values["recordings"]
    assert (part["file"], part["from_s"], part["to_s"], part["samples"]) == (str(out), 10.0, 30.0, 2001)
    assert [s["filled"] for s in part["streams"]] == [0, 5, 1]
    dropped = [(e["robot"], e["from_s"], e["to_s"], e["samples"]) for e in values["left_out"] if e["robot"]]
    assert dropped == [(2, 20.0, 20.03, 4), (2, 20.02, 20.04, 3), (3, 25.0, 25.0, 1)]
    if name == "log.csv":
        assert read.metadata.source == "log log.csv (10 to 30 s)"


def test_a_crop_leaves_faults_behind(tmp_path: Path) -> None:
    """What is cropped or dropped is not looked at: here, infinity and time that runs back."""
    bad = {k: v.copy() for k, v in RECORDING.columns().items()}
    bad["omnid2.phi1"][100] = np.inf
    bad["omnid3.phi1"][2000] = np.inf
    bad["time"][3900] = 38.0
    log = write_text(tmp_path / "log.csv", bad)
    with pytest.raises(InputError, match="--drop leaves samples out"):
        mocobot.convert(log, crop=":35")
    found = mocobot.convert(log, crop="5:35", drop=["robot=3:19.99-20"])
    np.testing.assert_array_equal(found.recording.phi[:, 1], RECORDING.phi[500:3501, 1])


REFUSED = {
    "crop after the end": (["--crop", "50:60"], "--crop 50 to 60 s: the log ends 39.99 s after its start"),
    "crop of nothing": (["--crop", "12:12"], "--crop is '12:12', which ends before it begins"),
    "crop backwards": (["--crop", "95:12"], "--crop is '95:12', which ends before it begins"),
    "crop without ends": (["--crop", ":"], "it must be FROM:TO in seconds from the log's start"),
    "crop of words": (["--crop", "a:b"], "--crop is 'a:b'; it must be FROM:TO"),
    "crop with infinity": (["--crop", "0:inf"], "it must be FROM:TO"),
    "a few samples": (["--crop", "12:12.1"], "robot 1 has 11 samples; at least 16"),
    "no sample": (["--crop", "12.001:12.002"], "what --crop and --drop leave holds no sample of robot 1"),
    "all dropped": (
        ["--drop", "robot=2:0-100"],
        "holds no sample of robot 2; its samples go from 0 to 39.99 s",
    ),
    "robot 0": (["--drop", "robot=0:1-2"], "there is no robot 0; robots are counted from 1 to 3"),
    "robot 4": (["--drop", "robot=4:1-2"], "there is no robot 4; robots are counted from 1 to 3"),
    "drop after the end": (["--drop", "robot=2:50-51"], "robot 2 has no samples then; its samples go from 0"),
    "drop between samples": (["--drop", "robot=2:5.001-5.002"], "robot 2 has no samples then"),
    "drop backwards": (["--drop", "robot=2:31-30"], "which ends before it begins"),
    "drop of no robot": (["--drop", "30-31"], "it must be robot=N:FROM-TO"),
    "a long drop": (["--drop", "robot=2:20-21"], "robot 2: no samples for 1.02 s"),
    "split, too short": (
        ["--crop", "0:9", "--drop", "robot=1:3-4", "--split-at-gaps"],
        "for 9.5 s without a gap of more than 0.08 s; the longest goes from 4.01 to 9 s",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_cut(tmp_path: Path, capsys: pytest.CaptureFixture[str], case: str) -> None:
    options, words = REFUSED[case]
    log = written(RECORDING, tmp_path / "log.parquet")
    message = command.refused(capsys, "convert", log, tmp_path / "out.parquet", *options)
    assert words in message
    assert [path.name for path in tmp_path.iterdir()] == ["log.parquet"]


# Split


def test_a_trial_of_every_part_between_gaps(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Robot 2 is silent from 10 to 11 s, robot 3 from 15 to 17 s by a drop, robot 1 for 0.03 s at 25 s."""
    log = written(holed({1: slice(1000, 1100), 0: slice(2500, 2503)}), tmp_path / name)
    (tmp_path / "out-7.parquet").write_bytes(b"earlier")
    code, text, err = command.run(
        capsys, "convert", log, tmp_path / "out.parquet", "--split-at-gaps", "--drop", "robot=3:15-17",
        "--json", tmp_path / "facts.json",
    )  # fmt: skip
    assert (code, err) == (0, "")
    assert {path.name for path in tmp_path.iterdir()} == {
        name, "out-1.parquet", "out-2.parquet", "out-7.parquet", "facts.json"
    }  # fmt: skip
    assert_rows(read_recording(tmp_path / "out-1.parquet"), slice(0, 1000))
    second = read_recording(tmp_path / "out-2.parquet")
    np.testing.assert_array_equal(second.phi[:, 1:], RECORDING.phi[1701:, 1:])
    assert np.flatnonzero((second.phi[:, 0] != RECORDING.phi[1701:, 0]).any(axis=1)).tolist() == [
        799,
        800,
        801,
    ]
    left_out = text.split("[[Left out of the log]]\n")[1]
    assert [line.strip() for line in left_out.splitlines()] == [
        "9.99 to 11 s: robot 2 has no samples",
        "11 to 14.99 s: shorter than 9.5 s",
        "14.99 to 17.01 s: robot 3 has no samples",
        "15 to 17 s of robot 3: 201 samples, dropped",
        f"{tmp_path / 'out-7.parquet'} is of an earlier conversion, and was left as it is",
    ]
    values = json.loads((tmp_path / "facts.json").read_text())
    assert [(e["from_s"], e["to_s"]) for e in values["recordings"]] == [(0.0, 9.99), (17.01, 39.99)]
    assert len(values["left_out"]) == 4


def test_parts_of_no_use_are_left_out_with_the_reason(tmp_path: Path) -> None:
    """The second part holds infinity; alone, it is what is said of the log."""
    bad = {k: v.copy() for k, v in holed({2: slice(1500, 1600)}).columns().items()}
    bad["omnid1.phi3"][2500] = np.inf
    log = write_text(tmp_path / "log.csv", bad)
    (found,) = mocobot.convert_parts(log)
    assert_rows(found.recording, slice(0, 1500))
    assert "robot 1: phi3 is inf" in found.left_out[-1].why
    with pytest.raises(InputError, match=r"\(16 to 39.99 s\): robot 1: phi3 is inf in row 900"):
        mocobot.convert_parts(log, crop="14:")


def test_a_part_must_not_overwrite_the_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = written(holed({1: slice(1500, 1600)}), tmp_path / "out-2.parquet")
    before = log.read_bytes()
    message = command.refused(capsys, "convert", log, tmp_path / "out.parquet", "--split-at-gaps")
    assert "is an input; write somewhere else" in message
    assert log.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["out-2.parquet"]

"""``estimate``, ``inspect`` and ``diagnose`` of logs that are no recordings: the same numbers, nothing left behind."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import mocobot
from command import refused, run
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording, write_recording
from log_files import write_text
from mocobot_logs.bag.write import write_bag
from mocobot_sim.trial.sensors import PRESETS, measure

NAMES = ("alice", "bob", "carol")


@pytest.fixture(scope="module")
def recording(random_a) -> Recording:
    return measure(random_a, PRESETS["nominal"], np.random.default_rng(2), payload="a")


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Iterator[Path]:
    """A place with its own temporary folder, which must be empty in the end."""
    (scratch := tmp_path / "scratch").mkdir()
    (place := tmp_path / "place").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    monkeypatch.chdir(place)
    yield place
    assert not list(scratch.iterdir())


@pytest.fixture
def log(folder, recording, capsys) -> Path:
    """The recording as CSV with names and units of its own, and its map."""
    columns = {}
    for key, values in recording.columns().items():
        if key == "time":
            columns["t_ms"] = 1e3 * values
        elif "ref" not in key:
            columns[f"{NAMES[int(key[5]) - 1]}_{key[7:]}{'' if 'tau' in key else '_deg'}"] = (
                values if "tau" in key else np.rad2deg(values)
            )
    path = write_text(folder / "my.csv", columns)
    assert run(capsys, "map", path, "--out", folder / "my.toml")[0] == 0
    return path


def test_estimate(folder, log, recording, capsys):
    write_recording(recording, folder / "rec.parquet")
    code, text, err = run(capsys, "estimate", "my.csv", "--map", "my.toml", "--out", "est.json")
    assert (code, err) == (0, "")
    assert text.startswith(f"my.csv: read as 3 robots, joint level, {recording.time[-1]:.2f} s\n[[Payload]]")
    found = json.loads((folder / "est.json").read_text())
    expected = mocobot.estimate("rec.parquet").to_dict()
    np.testing.assert_allclose(found["mass"]["m_kg"], expected["mass"]["m_kg"], rtol=1e-9)
    np.testing.assert_allclose(found["com"]["p_1c_m"], expected["com"]["p_1c_m"], atol=1e-9)
    assert [file["path"] for file in found["provenance"]["files"]] == ["my.csv", "my.toml"]
    assert found["provenance"]["options"]["map"] == "my.toml"
    assert [each["name"] for each in found["recordings"]] == ["my.csv"]
    assert sorted(path.name for path in folder.iterdir()) == ["est.json", "my.csv", "my.toml", "rec.parquet"]
    assert mocobot.estimate("my.csv", map="my.toml").mass == mocobot.estimate(["my.csv"], map="my.toml").mass


def test_bags_and_recordings_together(folder, recording, capsys):
    """A folder counts as all its files; a bag written here comes back bit by bit."""
    write_recording(recording, folder / "rec.parquet")
    write_bag(recording, folder / "bag")
    code, text, _ = run(capsys, "estimate", "rec.parquet", "bag", "--out", "est.json")
    assert code == 0
    assert text.startswith("bag: read as 3 robots")
    found = json.loads((folder / "est.json").read_text())
    twice = mocobot.estimate([read_recording("rec.parquet"), read_recording("rec.parquet")])
    assert found["mass"]["m_kg"] == twice.to_dict()["mass"]["m_kg"]
    names = [file["name"] for file in found["provenance"]["files"]]
    assert names == ["rec.parquet", *sorted(path.name for path in (folder / "bag").iterdir())]


def test_a_table_with_the_columns_of_a_recording(folder, recording, capsys):
    """Without metadata it is a log, and the report says how it is read."""
    write_recording(recording, folder / "rec.parquet")
    pq.write_table(pq.read_table("rec.parquet").replace_schema_metadata({}), "table.parquet")
    code, text, _ = run(capsys, "estimate", "table.parquet")
    assert code == 0
    assert text.startswith("table.parquet: read as 3 robots, joint level")


def test_inspect(log, capsys):
    code, text, _ = run(capsys, "inspect", "my.csv", "--map", "my.toml")
    assert code == 0
    assert "[[Log my.csv]]" in text
    assert mocobot.map(log).text == Path("my.toml").read_text()
    assert "No map was given" in refused(capsys, "inspect", "my.csv")


def test_diagnose(folder, log, capsys):
    before = sorted(path.name for path in folder.iterdir())
    code, text, err = run(capsys, "diagnose", "my.csv", "--map", "my.toml", "--no-closed-loop", "--jobs", "1")
    assert (code, err) == (0, "")
    assert text.splitlines()[0].startswith("my.csv: read as 3 robots")
    assert "CONSISTENT" in text
    assert sorted(path.name for path in folder.iterdir()) == before


@pytest.mark.parametrize("command", ["estimate", "diagnose"])
def test_what_is_refused_names_the_users_file(folder, log, recording, capsys, command):
    write_recording(recording, folder / "rec.parquet")
    rows = log.read_text().splitlines()
    (folder / "holes.csv").write_text("\n".join([*rows[:300], *rows[400:]]) + "\n")
    for arguments, words in (
        (["my.csv"], "my.csv: missing column 'omnid1.phi1'"),
        (["my.csv"], "No map was given (--map): `mocobot map my.csv` drafts one"),
        (["holes.csv", "--map", "my.toml"], "holes.csv: robot 1: no samples for 1.01 s"),
        (["holes.csv", "--map", "my.toml"], "--split-at-gaps"),
        (["rec.parquet", "--map", "my.toml"], "map my.toml: all files are recordings, which need none"),
        (["my.csv", "--map", "none.toml"], "map none.toml: there is no such file"),
        (["none.csv"], "none.csv: "),
        (["my.toml"], "my.toml: is of no known format; a log is a rosbag2 folder, .mcap or .db3, a CSV file"),
    ):
        message = refused(capsys, command, *arguments)
        assert words in message
        assert "scratch" not in message

"""LeRobot datasets, version 3: one episode, found and named as the format lays down."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from estimator.recording.model import Recording
from estimator.recording.parquet import write_recording
from log_files import assert_same, channels_of, column, read_log, refused, write_lerobot
from mocobot_logs.maps import builtin_map
from recordings import small_recording

JOINT = builtin_map("mocobot")


@pytest.fixture
def episodes() -> list[Recording]:
    rng = np.random.default_rng(4)
    parts = []
    for rows in (50, 70, 60):
        recording = small_recording(rows=rows, ref=False)
        phi = np.float32(recording.phi + rng.uniform(-0.1, 0.1))
        parts.append(
            replace(recording, phi=phi, theta=np.float32(recording.theta), tau=np.float32(recording.tau))
        )
    return parts


@pytest.fixture
def dataset(tmp_path: Path, episodes: list[Recording]) -> Path:
    return write_lerobot(tmp_path / "set", episodes)


@pytest.mark.parametrize("listing", [True, False])
def test_one_episode_of_several(tmp_path: Path, episodes: list[Recording], listing: bool) -> None:
    """Named numbers are found by the default map; 32-bit timestamps become the frames' exact times."""
    folder = write_lerobot(tmp_path / "set", episodes, listing=listing)
    for number, recording in enumerate(episodes):
        assert_same(read_log(folder, episode=number), recording)
        assert_same(read_log(folder / "data" / "chunk-000" / "file-000.parquet", episode=number), recording)


def test_which_episode_must_be_said(dataset: Path) -> None:
    assert "holds 3 episodes, 0 to 2; say which one with --episode" in refused(dataset)
    assert "there is no episode 3; it holds 3, 0 to 2" in refused(dataset, episode=3)
    assert "there is no episode -1" in refused(dataset, episode=-1)


def test_the_only_episode_need_not_be_named(tmp_path: Path, episodes: list[Recording]) -> None:
    assert_same(read_log(write_lerobot(tmp_path / "set", episodes[:1])), episodes[0])


def test_episodes_are_of_lerobot_only(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    write_recording(small_recording(rows=60), path)
    assert "is not a LeRobot dataset, so it has no episode 0" in refused(path, episode=0)


def test_a_recording_that_merely_lies_there(dataset: Path) -> None:
    recording = small_recording(rows=60)
    write_recording(recording, dataset / "data" / "chunk-000" / "own.parquet")
    log = read_log(dataset / "data" / "chunk-000" / "own.parquet")
    assert_same(log, recording)
    assert log.metadata == recording.metadata


def test_numbers_by_index_and_by_feature_and_name(dataset: Path, episodes: list[Recording]) -> None:
    common = {c: m for c, m in JOINT.common.items() if not c.startswith("ref")}
    common["phi1"] = replace(common["phi1"], column="observation.state[0]")
    common["tau1"] = replace(common["tau1"], column="observation.effort.omnid{robot}.tau1")
    log = read_log(dataset, replace(JOINT, common=common, robots=1), episode=1)
    assert np.array_equal(log.streams[0].values, channels_of(episodes[1], 0))


def test_own_timestamps_are_kept(dataset: Path, episodes: list[Recording]) -> None:
    """A dataset whose stamps are not those of its frames was sampled unevenly."""
    file = dataset / "data" / "chunk-000" / "file-000.parquet"
    table = pq.read_table(file)
    stamps = table["timestamp"].to_numpy() + np.float32(0.003) * np.random.default_rng(1).uniform(
        size=len(table)
    )
    pq.write_table(column(table, "timestamp", np.float32(stamps)), file)
    log = read_log(dataset, episode=0)
    assert np.array_equal(
        log.streams[0].stamp_ns, np.rint(1e9 * np.float64(np.float32(stamps[:50]))).astype(np.int64)
    )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"codebase_version": "v2.1"}, "codebase_version is 'v2.1'; version 3 is read"),
        ({"codebase_version": None}, "codebase_version is None"),
        ({"fps": 0}, "fps is 0"),
        ({"fps": True}, "fps is True"),
        ({"fps": float("nan")}, "fps is nan"),
        ({"features": []}, "features must be an object"),
        ({"features": {"a": 1}}, "features must be an object"),
        ({"data_path": "/etc/passwd"}, "data_path is '/etc/passwd'"),
        ({"data_path": "../{chunk_index}"}, "data_path is '../{chunk_index}'"),
        ({"data_path": "{chunk_index.__class__}"}, "data_path is"),
        ({"data_path": "{chunk_index:999999999d}"}, "data_path is"),
        ({"data_path": "{"}, "data_path is '{'"),
        ({"data_path": None}, "data_path is None"),
        ({"data_path": "none/{chunk_index}/{file_index}"}, "not a readable Parquet file"),
    ],
    ids=range(14),
)
def test_info_is_checked(dataset: Path, change: dict[str, object], words: str) -> None:
    info = dataset / "meta" / "info.json"
    info.write_text(json.dumps(json.loads(info.read_text()) | change))
    assert words in refused(dataset, episode=0)


@pytest.mark.parametrize("content", [b"", b"[]", b"{", b"\xff", b"[" * 100_000, b"9" * 10_000])
def test_info_that_is_no_object(dataset: Path, content: bytes) -> None:
    (dataset / "meta" / "info.json").write_bytes(content)
    assert "info.json" in refused(dataset, episode=0)


def test_damaged_datasets(dataset: Path) -> None:
    data, listing = (dataset / part / "chunk-000" / "file-000.parquet" for part in ("data", "meta/episodes"))
    table, names = pq.read_table(data), pq.read_table(listing)
    for missing in ("episode_index", "frame_index", "timestamp"):
        pq.write_table(table.drop_columns(missing), data)
        assert f"have no column '{missing}'" in refused(dataset, episode=0)
    pq.write_table(table, data)
    pq.write_table(names.drop_columns("data/file_index"), listing)
    assert "has no column 'data/file_index'" in refused(dataset, episode=0)
    pq.write_table(column(names, "data/file_index", [None, 0, 0]), listing)
    assert "holds 0, 0, None" in refused(dataset, episode=0)
    listing.unlink()
    data.write_bytes(data.read_bytes()[:100])
    assert "not a readable Parquet file, or a damaged one" in refused(dataset, episode=0)
    data.unlink()
    assert "has no Parquet files under data" in refused(dataset, episode=0)


@pytest.mark.parametrize(
    ("file", "column"),
    [("data/chunk-000/file-000.parquet", b"frame_index"), ("meta/episodes", b"data/chunk_index")],
)
def test_names_of_columns_that_are_no_text(dataset: Path, file: str, column: bytes) -> None:
    path = dataset / file
    path = path if path.is_file() else next(path.glob("*/*.parquet"))
    content = path.read_bytes()
    path.write_bytes(content.replace(column, b"\xff" + column[1:]))
    assert path.read_bytes() != content
    assert "damaged one ('utf-8' codec can't decode byte 0xff" in refused(dataset, episode=0)


def test_directories_that_are_no_logs(tmp_path: Path) -> None:
    assert "is a directory, and neither a rosbag2 bag nor a LeRobot dataset" in refused(tmp_path)

"""Parquet files and LeRobot datasets."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from estimator import inputs
from estimator.recording.model import Recording
from estimator.recording.parquet import write_recording
from log_files import assert_same, channels_of, column, read_log, refused, write_lerobot
from mocobot_logs.maps import builtin_map
from recordings import metadata, small_recording

RECORDING = small_recording(rows=60)
JOINT = builtin_map("mocobot")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "log.parquet"


@pytest.fixture
def table(path: Path) -> pa.Table:
    """A good recording as a table, to be spoiled."""
    write_recording(RECORDING, path)
    return pq.read_table(path)


# Our own


def test_own_recordings_need_no_map(path: Path, table: pa.Table) -> None:
    log = read_log(path)
    assert_same(log, RECORDING)
    assert (log.level, log.metadata) == ("joint", RECORDING.metadata)


def test_own_recordings_at_wrist_level(path: Path) -> None:
    recording = replace(RECORDING, metadata=metadata(level="wrist"))
    write_recording(recording, path)
    log = read_log(path)
    assert log.level == "wrist"
    names = [f"omnid2.{name}" for name in log.channels]
    assert np.array_equal(
        log.streams[1].values, np.stack([recording.file_columns()[name] for name in names], axis=1)
    )


def test_broken_recordings_are_read_as_they_are(path: Path, table: pa.Table) -> None:
    """What read_recording refuses: rows of nothing, NaN, infinity, degrees, time that runs back."""
    time = RECORDING.time.copy()
    time[30:] -= 0.2
    spoiled = column(table, "time", time)
    for k, name in enumerate(n for n in table.column_names if n.startswith("omnid1.")):
        values = np.rad2deg(table[name].to_numpy().copy())
        values[3], values[5:8] = np.inf, np.nan
        spoiled = column(spoiled, name, values if k else [None, *values[1:]])
    pq.write_table(spoiled, path)
    log = read_log(path)
    expected = np.rad2deg(channels_of(RECORDING, 0))
    expected[3], expected[5:8], expected[0, 0] = np.inf, np.nan, np.nan
    assert np.array_equal(log.streams[0].values, expected, equal_nan=True)
    assert np.array_equal(log.streams[0].stamp_ns, np.rint(1e9 * time).astype(np.int64))
    assert np.array_equal(log.streams[1].values, channels_of(RECORDING, 1))


def test_own_metadata_are_checked(path: Path, table: pa.Table) -> None:
    values = json.loads(table.schema.metadata[b"mocobot"])
    for changes, words in (
        ({"robots": 4}, "missing column 'omnid4.phi1'"),
        ({"robots": 10**12}, "metadata: robots is 1000000000000; at most 1000"),
        ({"version": 9}, "metadata: version is 9"),
    ):
        pq.write_table(table.replace_schema_metadata({"mocobot": json.dumps(values | changes)}), path)
        assert words in refused(path)


# Those of others


def test_lists_of_fixed_and_of_open_length(path: Path) -> None:
    columns = {"time": pa.array(RECORDING.time)}
    for name in ("phi", "theta", "tau"):
        values = getattr(RECORDING, name)
        columns[name] = pa.array(values.reshape(60, 9).tolist())  # open length
    columns["phi"] = pa.FixedSizeListArray.from_arrays(
        pa.FixedSizeListArray.from_arrays(pa.array(RECORDING.phi.ravel()), 3), 3
    )
    columns["tau"] = pa.array(RECORDING.tau.tolist())
    pq.write_table(pa.table(columns), path)
    arrays = builtin_map("mocobot-arrays")
    common = {c: m for c, m in arrays.common.items() if not c.startswith("ref")}
    for c in ("theta_z", "theta_y", "theta_x"):
        common[c] = replace(common[c], column=f"theta[{'zyx'.index(c[-1])}]")
    own = {
        r: {
            c: replace(common[c], column=f"theta[{3 * (r - 1) + k}]")
            for k, c in enumerate(common)
            if 3 <= k < 6
        }
        for r in (1, 2, 3)
    }
    own = {
        r: {c: replace(common[c], column=f"theta[{3 * (r - 1) + 'zyx'.index(c[-1])}]") for c in o}
        for r, o in own.items()
    }
    assert_same(
        read_log(path, replace(arrays, robots=3, common=common, own=own)), replace(RECORDING, ref=None)
    )


def test_a_recording_with_a_map_is_read_by_the_map(path: Path, table: pa.Table) -> None:
    common = {**JOINT.common, "tau1": replace(JOINT.common["tau1"], scale=-1.0)}
    log = read_log(path, replace(JOINT, common=common))
    assert np.array_equal(log.streams[0].values[:, 6], -RECORDING.tau[:, 0, 0])
    assert log.metadata == RECORDING.metadata


def test_a_bomb(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Constant columns pack a thousandfold; what is free is lowered, so that the test needs no gigabytes."""
    rows = 400_000
    columns = {name: np.zeros(rows) for name in RECORDING.columns()} | {"time": np.zeros(rows)}
    pq.write_table(pa.table(columns), path, compression="zstd")
    assert path.stat().st_size < rows * 37 * 8 / 200
    assert read_log(path).robots == 3  # 118 MB do no harm
    monkeypatch.setattr(inputs, "FREE_BYTES", 1 << 20)
    assert "unpacks to at least 0.1103 GiB; the limit is 0.0" in refused(path)


LEROBOT_JOINT = builtin_map("mocobot")


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


def test_episodes_are_of_lerobot_only(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    write_recording(small_recording(rows=60), path)
    assert "is not a LeRobot dataset, so it has no episode 0" in refused(path, episode=0)


def test_numbers_by_index_and_by_feature_and_name(dataset: Path, episodes: list[Recording]) -> None:
    common = {c: m for c, m in LEROBOT_JOINT.common.items() if not c.startswith("ref")}
    common["phi1"] = replace(common["phi1"], column="observation.state[0]")
    common["tau1"] = replace(common["tau1"], column="observation.effort.omnid{robot}.tau1")
    log = read_log(dataset, replace(LEROBOT_JOINT, common=common, robots=1), episode=1)
    assert np.array_equal(log.streams[0].values, channels_of(episodes[1], 0))


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


def test_directories_that_are_no_logs(tmp_path: Path) -> None:
    assert "is a directory, and neither a rosbag2 bag nor a LeRobot dataset" in refused(tmp_path)

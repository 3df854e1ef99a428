"""Recordings as the files that other programs write."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from estimator.errors import InputError
from estimator.recording.model import Recording
from mocobot_logs.log import Log, collect
from mocobot_logs.maps import LogMap
from mocobot_logs.open_log import open_log


def read_log(path: Path, log_map: LogMap | None = None, episode: int | None = None) -> Log:
    """A whole log."""
    return collect(open_log(path, log_map, episode))


def refused(path: Path, log_map: LogMap | None = None, episode: int | None = None) -> str:
    """What is said of a log that must not be read, without its name."""
    with pytest.raises(InputError) as caught:
        read_log(path, log_map, episode)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert message.isprintable()
    assert len(message) < 1000
    return message.removeprefix(f"{path}: ")


def channels_of(recording: Recording, robot: int) -> np.ndarray:
    """Joint-level channels of one robot, from 0, in the order of a log."""
    fields = [recording.phi, recording.theta, recording.tau]
    fields += [] if recording.ref is None else [recording.ref]
    return np.concatenate([field[:, robot] for field in fields], axis=1)


def assert_same(log: Log, recording: Recording) -> None:
    """Every sample of every robot, to the last bit, and every stamp to the nanosecond."""
    assert log.robots == recording.metadata.robots
    for robot, stream in enumerate(log.streams):
        assert np.array_equal(stream.values, channels_of(recording, robot)), robot
        assert np.array_equal(stream.stamp_ns, np.rint(1e9 * recording.time).astype(np.int64)), robot
        assert stream.log_ns is None


def write_text(path: Path, columns: dict[str, np.ndarray], delimiter: str = ",", decimal: str = ".") -> Path:
    """A text table with every digit, written cell by cell."""
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines = [delimiter.join(columns)]
    lines += [delimiter.join(repr(value).replace(".", decimal) for value in row) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def column(table: pa.Table, name: str, values: object) -> pa.Table:
    """A table with one column replaced."""
    return table.set_column(table.column_names.index(name), name, pa.array(values))


def write_lerobot(
    folder: Path, episodes: list[Recording], *, listing: bool = True, fps: float = 100.0
) -> Path:
    """A LeRobot dataset of version 3: all episodes in one file, state and effort as lists of 32-bit floats."""
    robots = episodes[0].metadata.robots
    names = {
        "observation.state": [f"omnid{i}.{c}" for i in range(1, robots + 1) for c in _STATE],
        "observation.effort": [f"omnid{i}.tau{k}" for i in range(1, robots + 1) for k in (1, 2, 3)],
    }
    parts = []
    for number, recording in enumerate(episodes):
        rows = len(recording.time)
        state = np.concatenate([recording.phi, recording.theta], axis=2).reshape(rows, -1)
        vectors = {"observation.state": state, "observation.effort": recording.tau.reshape(rows, -1)}
        columns: dict[str, pa.Array] = {
            name: pa.FixedSizeListArray.from_arrays(pa.array(np.float32(v).ravel()), v.shape[1])
            for name, v in vectors.items()
        }
        frame = np.arange(rows)
        columns |= {
            "timestamp": pa.array(np.float32(frame / fps)),
            "frame_index": pa.array(frame),
            "episode_index": pa.array(np.full(rows, number)),
            "index": pa.array(frame),
            "task_index": pa.array(np.zeros(rows, np.int64)),
        }
        parts.append(pa.table(columns))
    (folder / "data" / "chunk-000").mkdir(parents=True)
    (folder / "meta" / "episodes" / "chunk-000").mkdir(parents=True)
    pq.write_table(pa.concat_tables(parts), folder / "data" / "chunk-000" / "file-000.parquet")
    if listing:
        count = len(episodes)
        table = pa.table(
            {
                "episode_index": list(range(count)),
                "data/chunk_index": [0] * count,
                "data/file_index": [0] * count,
            }
        )
        pq.write_table(table, folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    info = {
        "codebase_version": "v3.0",
        "fps": fps,
        "total_episodes": len(episodes),
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "features": {
            name: {"dtype": "float32", "shape": [len(entries)], "names": entries}
            for name, entries in names.items()
        }
        | {"timestamp": {"dtype": "float32", "shape": [1], "names": None}},
    }
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    return folder


_STATE = ("phi1", "phi2", "phi3", "theta_z", "theta_y", "theta_x")

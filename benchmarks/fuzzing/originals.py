"""A small good log in every format that is read."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pcsv
import pyarrow.parquet as pq
from scipy.io import savemat

from estimator.arm.design import load_design
from estimator.recording.metadata import RecordingMetadata
from estimator.recording.model import Recording
from estimator.recording.parquet import write_recording
from mocobot_logs.bag.write import write_bag
from mocobot_logs.maps import MAPS, builtin_map_text

DESIGN = Path(__file__).parents[2] / "models" / "omnid" / "design.toml"
FORMATS = (
    "csv",
    "npz",
    "npz packed",
    "mat",
    "mat packed",
    "parquet",
    "parquet foreign",
    "lerobot data",
    "lerobot episodes",
    "lerobot info",
    "mcap",
    "mcap wrist",
    "db3",
    "bag yaml",
    "bag mcap",
    "map",
)


def small_recording(rows: int = 200, robots: int = 2, seed: int = 0) -> Recording:
    """Random plausible samples of a few robots."""
    rng, shape, design = np.random.default_rng(seed), (rows, robots, 3), load_design(DESIGN)
    metadata = RecordingMetadata(robots, 100.0, "random", "fuzzing", None, None, design)
    return Recording(
        time=np.arange(rows) / 100.0,
        phi=rng.uniform(0.3, 0.9, shape),
        theta=rng.uniform(-0.2, 0.2, shape),
        tau=rng.uniform(-9.0, 9.0, shape),
        ref=rng.uniform(-0.1, 0.4, shape),
        metadata=metadata,
    )


def write_original(kind: str, folder: Path, rows: int = 200) -> tuple[Path, Path]:
    """Write a good log.

    Args:
        kind: one of ``FORMATS``.
        folder: empty; the log goes into it.
        rows: number of samples of each robot.

    Returns:
        The log as a user would name it, and the file in it that is to be damaged.
    """
    recording = small_recording(rows)
    if kind == "csv":
        pcsv.write_csv(pa.table(recording.columns()), folder / "log.csv")
        return _same(folder / "log.csv")
    if kind.startswith("npz"):
        save = np.savez_compressed if kind.endswith("packed") else np.savez
        arrays = {name: getattr(recording, name) for name in ("time", "phi", "theta", "tau", "ref")}
        save(folder / "log.npz", mocobot=np.array(recording.metadata.to_json()), **arrays)
        return _same(folder / "log.npz")
    if kind.startswith("mat"):
        arrays = {name: getattr(recording, name) for name in ("time", "phi", "theta", "tau", "ref")}
        savemat(folder / "log.mat", arrays, do_compression=kind.endswith("packed"))
        return _same(folder / "log.mat")
    if kind == "parquet":
        write_recording(recording, folder / "log.parquet")
        return _same(folder / "log.parquet")
    if kind == "parquet foreign":
        table = pa.table({name: np.round(values, 2) for name, values in recording.columns().items()})
        pq.write_table(table, folder / "log.parquet", compression="zstd", row_group_size=rows // 3)
        return _same(folder / "log.parquet")
    if kind.startswith("lerobot"):
        return _lerobot(recording, folder / "set", kind.split()[1])
    if kind.startswith("mcap") or kind == "db3":
        path = folder / ("log.mcap" if kind.startswith("mcap") else "log.db3")
        storage = "mcap" if kind.startswith("mcap") else "sqlite3"
        write_bag(recording, path, level="wrist" if kind.endswith("wrist") else "joint", storage=storage)
        return _same(path)
    if kind.startswith("bag"):
        path = folder / "bag"
        write_bag(recording, path, storage="sqlite3" if kind.endswith("yaml") else "mcap")
        return path, next(path.glob(f"*.{kind.split()[1]}"))
    (folder / "map.toml").write_text(builtin_map_text(MAPS[rows % len(MAPS)]))
    return _same(folder / "map.toml")


def _same(path: Path) -> tuple[Path, Path]:
    return path, path


def _lerobot(recording: Recording, folder: Path, part: str) -> tuple[Path, Path]:
    data, episodes = (folder / name / "chunk-000" / "file-000.parquet" for name in ("data", "meta/episodes"))
    for path in (data, episodes):
        path.parent.mkdir(parents=True)
    rows, columns = len(recording.time), replace(recording, ref=None).columns()
    names = [name for name in columns if name != "time"]
    state = np.stack([columns[name] for name in names], axis=1).astype(np.float32)
    frame = np.arange(rows)
    table = pa.table(
        {
            "observation.state": pa.FixedSizeListArray.from_arrays(pa.array(state.ravel()), len(names)),
            "timestamp": pa.array(np.float32(frame / 100.0)),
            "frame_index": pa.array(frame),
            "episode_index": pa.array(np.zeros(rows, np.int64)),
        }
    )
    pq.write_table(table, data)
    pq.write_table(
        pa.table({"episode_index": [0], "data/chunk_index": [0], "data/file_index": [0]}), episodes
    )
    info = {
        "codebase_version": "v3.0",
        "fps": 100,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "features": {"observation.state": {"dtype": "float32", "shape": [len(names)], "names": names}},
    }
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    return folder, {"data": data, "episodes": episodes, "info": folder / "meta" / "info.json"}[part]

"""Logs of an invented three-joint robot, whose motion is known in closed form, as files of every kind."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from mocobot_logs.joints.joint_log import JointLog
from mocobot_logs.joints.joint_map import JointMap, parse_joint_map
from mocobot_logs.joints.read import open_joint_log, read_joint_log

JOINTS = ("hip", "knee", "lift")
SLIDES = (False, False, True)
TURNS = np.array([[50.0, 0.0, 0.0], [20.0, -40.0, 0.0], [0.0, 0.0, 300.0]])
"""Motor turns per joint turn: the knee's motor turns with the hip, too; the lift's in radians per metre."""


def motion(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities of the joints, shape (Q, 3) each."""
    rate = 2.0 * np.pi * np.array([0.7, 1.1, 1.3])
    size = np.array([0.8, 0.6, 0.1])
    phase = np.multiply.outer(time, rate) + np.array([0.1, 0.5, 0.9])
    return size * np.sin(phase), size * rate * np.cos(phase)


def torques(time: np.ndarray) -> np.ndarray:
    """Torques at the joints, shape (Q, 3)."""
    return np.array([12.0, 7.0, 90.0]) * np.cos(
        np.multiply.outer(time, 2 * np.pi * np.array([0.9, 0.4, 1.7]))
    )


def columns(time: np.ndarray) -> dict[str, np.ndarray]:
    """A log of joint positions in degrees and millimetres, velocities and torques."""
    q, dq = motion(time)
    found = {"t": time}
    for k, joint in enumerate(JOINTS):
        found[f"{joint}.pos"] = q[:, k] * (1e3 if SLIDES[k] else np.degrees(1.0))
        found[f"{joint}.vel"] = dq[:, k]
        found[f"{joint}.tau"] = torques(time)[:, k]
    return found


MAP = """
joints = ["hip", "knee", "lift"]
[time]
column = "t"
unit = "s"
[channels.q]
column = "{joint}.pos"
unit = "deg"
[channels.dq]
column = "{joint}.vel"
unit = "rad/s"
[channels.torque]
column = "{joint}.tau"
unit = "Nm"
[joint.lift.channels]
q.unit = "mm"
dq.unit = "m/s"
torque.unit = "N"
"""


def parsed(text: str, joints: tuple[str, ...] = JOINTS, slides: tuple[bool, ...] = SLIDES) -> JointMap:
    """A map from its text."""
    return parse_joint_map(tomllib.loads(text), "my.toml", joints, slides)


def read(path: Path, text: str = MAP, episode: int | None = None) -> list[JointLog]:
    """Parts of a log by the text of a map."""
    log_map = parsed(text)
    return read_joint_log(open_joint_log(path, log_map, episode), log_map)


def write_csv(path: Path, values: dict[str, np.ndarray]) -> Path:
    """Every digit of every number, empty cells for NaN."""
    rows = zip(*(column.tolist() for column in values.values()), strict=True)
    lines = [",".join(values)]
    lines += [",".join("" if value != value else repr(value) for value in row) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def write_table(path: Path, values: dict[str, np.ndarray]) -> Path:
    """A table by the suffix of its name."""
    if path.suffix == ".csv":
        return write_csv(path, values)
    if path.suffix == ".npz":
        np.savez(path, **values)  # type: ignore[arg-type]
    else:
        pq.write_table(pa.table(values), path)
    return path


def write_lerobot(folder: Path, q: np.ndarray, action: np.ndarray, fps: float, episodes: int = 1) -> Path:
    """A LeRobot dataset of episodes of one length: states and actions as lists of 32-bit floats."""
    rows = len(q)
    names = [f"{joint}.pos" for joint in JOINTS]

    def listed(values: np.ndarray) -> Any:
        return pa.FixedSizeListArray.from_arrays(pa.array(np.float32(values).ravel()), values.shape[1])

    episode, frame = np.divmod(np.arange(rows), rows // episodes)
    table = pa.table({
        "observation.state": listed(q), "action": listed(action),
        "timestamp": pa.array(np.float32(frame / fps)), "frame_index": frame,
        "episode_index": episode, "index": np.arange(rows), "task_index": np.zeros(rows, np.int64),
    })  # fmt: skip
    (folder / "data" / "chunk-000").mkdir(parents=True)
    (folder / "meta").mkdir()
    pq.write_table(table, folder / "data" / "chunk-000" / "file-000.parquet")
    feature = {"dtype": "float32", "shape": [3], "names": names}
    info = {
        "codebase_version": "v3.0",
        "fps": fps,
        "features": {"observation.state": feature, "action": feature},
    }
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    return folder

"""Columns of samples for the Rerun stream: a whole signal at once, on one timeline."""

from collections.abc import Iterable

import numpy as np
import rerun as rr

from estimator.arrays import Array

TIMELINE = "time"


def time_column(time: Array) -> rr.TimeColumn:
    """The timeline's column for times [s]: whole nanoseconds, rounded where the SDK itself would cut off."""
    return rr.TimeColumn(TIMELINE, duration=np.round(1e9 * time).astype("timedelta64[ns]"))


def send(stream: rr.RecordingStream, path: str, time: Array, columns: Iterable[rr.ComponentColumn]) -> None:
    """Log columns of one entity at times [s]."""
    stream.send_columns(path, [time_column(time)], columns)


def send_poses(
    stream: rr.RecordingStream, path: str, time: Array, position: Array | None, quaternion: Array | None
) -> None:
    """Log the pose of an entity in its parent: positions [m], (Q, 3), and quaternions (x, y, z, w), (Q, 4).

    None for what is constant, zero and unturned. Single precision: 0.1 um at 1 m, far below what an encoder resolves.
    """
    place, turn = (None if part is None else part.astype(np.float32) for part in (position, quaternion))
    send(stream, path, time, rr.Transform3D.columns(translation=place, quaternion=turn))

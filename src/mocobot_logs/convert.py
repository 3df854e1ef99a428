"""From a log to a recording, and from a recording to a file of any kind that is written."""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from estimator.arm.design import OmnidDesign
from estimator.errors import InputError
from estimator.recording.checks import check_recording
from estimator.recording.model import Recording
from estimator.recording.parquet import write_recording
from mocobot_logs.bag.write import write_bag
from mocobot_logs.log import Level, LogSource
from mocobot_logs.one_clock import ClockReport, to_recording
from mocobot_logs.resample.log import MAX_GAP_S, RATE_HZ, resample
from mocobot_logs.resample.report import StreamReport
from mocobot_logs.table.write import write_csv, write_npz

Kind = Literal["parquet", "csv", "npz", "mcap", "sqlite3", "folder"]
SUFFIXES: dict[str, Kind] = {
    ".parquet": "parquet",
    ".csv": "csv",
    ".npz": "npz",
    ".mcap": "mcap",
    ".db3": "sqlite3",
    "": "folder",
}
"""What is written, by the target's suffix; a bag's folder has none."""
UNKNOWN_TRIAL = "random"
"""Kind of trial where nothing says which; it labels reports only."""


@dataclass(frozen=True)
class Labels:
    """What a log may not say about itself; None leaves it to the log.

    Attributes:
        trial: "random", "periodic" or "static".
        payload: name of the payload.
        design: numbers of the robots.
        level: how the output tells the samples, "joint" or "wrist".
    """

    trial: str | None = None
    payload: str | None = None
    design: OmnidDesign | None = None
    level: Level | None = None


@dataclass(frozen=True, eq=False)
class Converted:
    """A log that became a recording.

    Attributes:
        recording: on one grid and one clock, checked.
        level: of the log.
        streams: what was found in each robot's stream, and done to it.
        clocks: how the robots' clocks differ, and whether that was corrected.
    """

    recording: Recording
    level: Level
    streams: tuple[StreamReport, ...]
    clocks: ClockReport


def convert(
    source: LogSource,
    labels: Labels,
    standard: OmnidDesign,
    *,
    rate_hz: float = RATE_HZ,
    max_gap_s: float = MAX_GAP_S,
    correct: bool = False,
    advance: Callable[[int], object] = lambda _: None,
) -> Converted:
    """Bring a log onto one grid and check that the result is a recording that can be estimated from.

    Args:
        source: the log.
        labels: what the user says of it; what the log says of itself comes second.
        standard: design where neither says one.
        rate_hz: sampling rate of the recording [Hz].
        max_gap_s: longest gap that is filled [s].
        correct: whether the robots' clocks are brought to that of robot 1.
        advance: takes the progress made, in the source's units.

    Raises:
        InputError: the log is damaged, cannot be resampled, or is not plausible (see ``check_recording``).
    """
    resampled = resample(source, rate_hz, max_gap_s, advance)
    silent = source.metadata is None
    recording, clocks = to_recording(
        resampled,
        design=labels.design or (standard if silent else None),
        trial=labels.trial or (UNKNOWN_TRIAL if silent else None),
        payload=labels.payload,
        source=f"log {os.path.basename(source.name)}" if silent else None,
        correct=correct,
    )
    recording = replace(recording, metadata=replace(recording.metadata, level=labels.level or source.level))
    streams = resampled.reports
    del resampled  # as large as the recording
    check_recording(recording)
    return Converted(recording, source.level, streams, clocks)


def output_kind(path: Path) -> Kind:
    """What a target is to hold.

    Raises:
        InputError: nothing is written under such a name.
    """
    kind = SUFFIXES.get(path.suffix.lower())
    if kind is None or not path.name:
        known = ", ".join(suffix for suffix in SUFFIXES if suffix)
        raise InputError(f"{path}: the name must end in one of {known}, or have no suffix (a bag's folder)")
    return kind


def write_converted(
    recording: Recording, path: Path, advance: Callable[[int], object] = lambda _: None
) -> None:
    """Write a recording at the level of its metadata, as what the target's name says.

    Args:
        recording: what to write.
        path: target, see ``output_kind``.
        advance: takes the number of samples written since the last call.

    Raises:
        InputError: it cannot be written.
    """
    kind, level = output_kind(path), recording.metadata.level
    if kind == "parquet":
        write_recording(recording, path)
    elif kind == "csv":
        write_csv(recording, path, level)
    elif kind == "npz":
        write_npz(recording, path, level)
    else:
        write_bag(
            recording, path, level=level, storage="sqlite3" if kind == "sqlite3" else "mcap", advance=advance
        )

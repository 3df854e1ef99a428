"""The report of a conversion as JSON.

format, version        "mocobot-conversion", 1
log                    as the user named it
level                  of the log: "joint" or "wrist"
recordings             list of {file, samples, rate_hz, duration_s, level, trial, payload, from_s, to_s, streams,
                       clocks}; from_s and to_s say which part of the log it is, in seconds after its start, null
                       for all of it
recordings[].streams   one per robot: what ``mocobot_logs.resample.report.StreamReport`` holds, and on_grid: whether its
                       samples, after what ``method`` says, were on the recording's grid
recordings[].clocks    {corrected, offset_s, offset_se_s, drift, drift_se, why_not}: lists by robot, null where unknown
left_out               list of {from_s, to_s, robot, samples, why}: robot is null for all robots, samples where
                       they were not counted
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mocobot_logs.convert import Converted
from mocobot_logs.cut.split import Omission
from mocobot_logs.log import Array

FORMAT, VERSION = "mocobot-conversion", 1


def conversion_dict(
    name: str, recordings: Sequence[tuple[Converted, Path | None]], left_out: Sequence[Omission]
) -> dict[str, Any]:
    """Plain JSON values of a conversion, with the keys documented above.

    Args:
        name: the log, as the user named it.
        recordings: what it became, at least one, and the file of each, if any.
        left_out: what is in none of them.
    """
    return {
        "format": FORMAT,
        "version": VERSION,
        "log": name,
        "level": recordings[0][0].level,
        "recordings": [_recording(*each) for each in recordings],
        "left_out": [
            {
                "from_s": each.span.first_ns / 1e9,
                "to_s": each.span.last_ns / 1e9,
                "robot": each.robot,
                "samples": each.samples,
                "why": each.why,
            }
            for each in left_out
        ],
    }


def _recording(converted: Converted, file: Path | None) -> dict[str, Any]:
    recording, span = converted.recording, converted.span
    estimate, metadata = converted.clocks.estimate, recording.metadata
    return {
        "file": None if file is None else str(file),
        "samples": len(recording.time),
        "rate_hz": metadata.rate_hz,
        "duration_s": (len(recording.time) - 1) / metadata.rate_hz,
        "level": metadata.level,
        "trial": metadata.trial,
        "payload": metadata.payload,
        "from_s": None if span is None else span.first_ns / 1e9,
        "to_s": None if span is None else span.last_ns / 1e9,
        "streams": [
            stream.to_dict() | {"on_grid": same}
            for stream, same in zip(converted.streams, converted.clocks.untouched, strict=True)
        ],
        "clocks": {
            "corrected": converted.clocks.corrected,
            "offset_s": _numbers(estimate.offset_s),
            "offset_se_s": _numbers(estimate.offset_se_s),
            "drift": _numbers(estimate.drift),
            "drift_se": _numbers(estimate.drift_se),
            "why_not": list(estimate.why_not),
        },
    }


def _numbers(values: Array) -> list[float | None]:
    return [float(value) if math.isfinite(value) else None for value in values]

"""Report on a conversion, as text and as JSON with these keys:

format, version        "mocobot-conversion", 1
log                    as the user named it
level                  of the log: "joint" or "wrist"
recordings             list of {file, samples, rate_hz, duration_s, level, trial, payload, from_s, to_s, streams,
                       clocks}; from_s and to_s are the part of the log in seconds after its start, null for all of it
recordings[].streams   one per robot: the fields of ``mocobot_logs.resample.StreamReport``, and on_grid: whether its
                       samples, after ``method``, were on the recording's grid
recordings[].clocks    {corrected, offset_s, offset_se_s, drift, drift_se, why_not}: lists by robot, null where unknown
left_out               list of {from_s, to_s, robot, samples, why}: robot is null for all robots, samples is null if
                       not counted
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from estimator.clocks import ClockEstimate
from mocobot_logs.convert import Converted
from mocobot_logs.cut import Omission, Span
from mocobot_logs.log import Array, repeated
from mocobot_logs.resample import StreamReport

SURE = 4.0  # standard errors above which a clock difference is reported ...
SMALL_S, SMALL_DRIFT = 1e-4, 5e-6
"""... if it also exceeds this [s, s/s]; 0.1 ms changes estimates by less than the sensors' noise."""
_COLUMNS = (
    ("samples", ""), ("rate", "Hz"), ("jitter", "rms, max ms"), ("gaps", "longest ms"), ("filled", ""),
    ("doubles", ""),
)  # fmt: skip
_WIDTHS = (9, 9, 15, 13, 7, 8)
_ONTO = "interpolated onto the grid of robot 1"
_DONE = {
    ("untouched", True): "taken as they are",
    ("untouched", False): _ONTO,
    ("filtered", True): "low-passed and thinned",
    ("filtered", False): f"low-passed, thinned and {_ONTO}",
    ("interpolated", True): "interpolated, low-passed and thinned",
    ("interpolated", False): f"interpolated, low-passed, thinned and {_ONTO}",
    ("fitted", True): "fitted by polynomials, as they are many and uneven, low-passed and thinned",
    ("fitted", False): f"fitted by polynomials, as they are many and uneven, low-passed, thinned and {_ONTO}",
}
"""Processing of a robot's samples, by method and by whether its grid is the recording's."""


def format_conversion(converted: Converted, name: str, out: Path) -> str:
    """Return a readable report: streams, clocks, location ``out`` of the recording, and omissions."""
    recording, streams = converted.recording, converted.streams
    if converted.span is not None:
        name = f"{name} ({converted.span})"
    metadata = recording.metadata
    robots = f"{metadata.robots} robot{'s' * (metadata.robots > 1)}"
    lines = [f"[[Log {name}]]  {robots}, {converted.level} level"]
    titles, units = zip(*_COLUMNS, strict=True)
    lines += [_row("robot", titles), _row("", units)]
    lines += [_stream(stream) for stream in streams]
    lines += _methods(converted) + _blank(streams) + [f"    {note}" for note in converted.notes]
    lines += ["[[Clocks against that of robot 1]]", *_clocks(converted)]
    duration_s = (len(recording.time) - 1) / metadata.rate_hz
    payload = "" if metadata.payload is None else f", payload {metadata.payload}"
    lines += [
        f"[[Recording {out}]]  {robots}, {metadata.level} level, {metadata.trial} trial{payload}",
        f"    {len(recording.time)} samples at {metadata.rate_hz:g} Hz, {duration_s:.2f} s, "
        f"commands: {'no' if recording.ref is None else 'yes'}",
    ]
    lost_s = float(np.max(converted.clocks.lost_s))
    if lost_s > 1.0 / metadata.rate_hz:
        lines.append(
            f"    up to {lost_s:.3g} s of a robot's samples lie outside what all robots have in common"
        )
    if converted.left_out:
        lines.append(format_omissions(converted.left_out))
    return "\n".join(lines)


def format_on_the_fly(converted: Converted, name: str) -> str:
    """Return one line about a log that another command converted, with possible problems."""
    metadata, streams = converted.recording.metadata, converted.streams
    duration_s = (len(converted.recording.time) - 1) / metadata.rate_hz
    robots = f"{metadata.robots} robot{'s' * (metadata.robots > 1)}"
    text = f"{name}: read as {robots}, {converted.level} level, {duration_s:.2f} s"
    if repeats := sum(stream.repeats for stream in streams):
        text += f"; {repeated(repeats)}"
    if filled := sum(stream.filled for stream in streams):
        text += f"; {filled} missing samples filled in"
    if _differ(converted.clocks.estimate):
        text += "; the robots' clocks differ (see mocobot convert)"
    return text


def format_omissions(left_out: Sequence[Omission]) -> str:
    """Return the omitted parts of a log, one line each."""
    lines = ["[[Left out of the log]]"]
    for each in left_out:
        whose = "" if each.robot is None else f" of robot {each.robot}"
        count = "" if each.samples is None else f": {each.samples} sample{'s' * (each.samples > 1)}"
        lines.append(f"    {each.span}{whose}{count}{',' if count else ':'} {each.why}")
    return "\n".join(lines)


def _stream(stream: StreamReport) -> str:
    cells = (
        f"{stream.samples}",
        f"{stream.native_hz:.6g}",
        f"{1e3 * stream.jitter_rms_s:.3g}, {1e3 * stream.jitter_max_s:.3g}",
        f"{stream.gaps}, {1e3 * stream.longest_gap_s:.4g}" if stream.gaps else "0",
        f"{stream.filled}",
        f"{stream.duplicates + stream.merged}",
    )
    return _row(f"{stream.robot}", cells)


def _row(first: str, cells: Sequence[str]) -> str:
    row = "".join(f" {cell:>{width}}" for cell, width in zip(cells, _WIDTHS, strict=True))
    return f"    {first:<5}{row}".rstrip()


def _methods(converted: Converted) -> list[str]:
    streams, lines = converted.streams, []
    for done, words in _DONE.items():
        robots = [
            stream
            for stream, same in zip(streams, converted.clocks.untouched, strict=True)
            if (stream.method, same) == done
        ]
        if robots:
            filled = ", missing ones filled in" if any(stream.filled for stream in robots) else ""
            lines.append(f"    samples of {_whose(robots, len(streams))}: {words}{filled}")
    return lines


def _whose(robots: Sequence[StreamReport], of: int) -> str:
    if len(robots) == of:
        return "all robots"
    return f"robot{'s' * (len(robots) > 1)} {', '.join(str(stream.robot) for stream in robots)}"


def _blank(streams: Sequence[StreamReport]) -> list[str]:
    lines = []
    for stream in streams:
        if stream.blank:
            rows = f"{stream.blank} row{'s' * (stream.blank > 1)} of robot {stream.robot}"
            which = ", ".join(f"{name} {count}" for name, count in stream.blank_channels.items())
            lines.append(f"    {rows} without all values (NaN: {which}) count as missing")
        if stream.repeats:
            lines.append(f"    robot {stream.robot}: {repeated(stream.repeats)}")
    return lines


def _clocks(converted: Converted) -> list[str]:
    estimate = converted.clocks.estimate
    if len(estimate.offset_s) == 1:
        return ["    one robot"]
    lines = [_clock(estimate, robot) for robot in range(1, len(estimate.offset_s))]
    if converted.clocks.corrected:
        return [*lines, "    corrected"]
    hint = " (--clock correct takes them out)" if _differ(estimate) else ""
    return [*lines, f"    kept as logged{hint}"]


def _differ(estimate: ClockEstimate) -> bool:
    """Return whether clocks differ significantly and by a relevant amount."""
    if not estimate.determined:
        return False
    offset, drift = np.abs(estimate.offset_s), np.abs(estimate.drift)
    apart = (offset > SURE * estimate.offset_se_s) & (offset > SMALL_S)
    return bool(np.any(apart | (drift > SURE * estimate.drift_se) & (drift > SMALL_DRIFT)))


def _clock(estimate: ClockEstimate, robot: int) -> str:
    if (why := estimate.why_not[robot]) is not None:
        return f"    robot {robot + 1}: not determined, {why}"
    offset, offset_se = 1e3 * estimate.offset_s[robot], 1e3 * estimate.offset_se_s[robot]
    text = f"    robot {robot + 1}: offset {offset:+.4f} +- {offset_se:.4f} ms"
    if np.isfinite(estimate.drift_se[robot]):
        text += f", drift {1e6 * estimate.drift[robot]:+.3f} +- {1e6 * estimate.drift_se[robot]:.3f} ppm"
    else:
        text += ", drift not determined"
    if np.isfinite(estimate.repeats_s[robot]):
        text += f"; the motion repeats itself, so {estimate.repeats_s[robot]:.3g} s more or less fit as well"
    return text


FORMAT, VERSION = "mocobot-conversion", 1
_OF_CLOCKS = ("offset_s", "offset_se_s", "drift", "drift_se")


def conversion_dict(
    name: str, recordings: Sequence[tuple[Converted, Path | None]], left_out: Sequence[Omission]
) -> dict[str, Any]:
    """Return plain JSON values of a conversion of at least one recording, each with its file, if any."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "log": name,
        "level": recordings[0][0].level,
        "recordings": [_recording(*each) for each in recordings],
        "left_out": [
            _ends(each.span) | {"robot": each.robot, "samples": each.samples, "why": each.why}
            for each in left_out
        ],
    }


def _recording(converted: Converted, file: Path | None) -> dict[str, Any]:
    recording, estimate = converted.recording, converted.clocks.estimate
    metadata = recording.metadata
    return {
        "file": None if file is None else str(file),
        "samples": len(recording.time),
        "rate_hz": metadata.rate_hz,
        "duration_s": (len(recording.time) - 1) / metadata.rate_hz,
        "level": metadata.level,
        "trial": metadata.trial,
        "payload": metadata.payload,
        **_ends(converted.span),
        "streams": [
            stream.to_dict() | {"on_grid": same}
            for stream, same in zip(converted.streams, converted.clocks.untouched, strict=True)
        ],
        "clocks": {
            "corrected": converted.clocks.corrected,
            **{key: _numbers(getattr(estimate, key)) for key in _OF_CLOCKS},
            "why_not": list(estimate.why_not),
        },
    }


def _ends(span: Span | None) -> dict[str, float | None]:
    first_s, last_s = (None, None) if span is None else (span.first_ns / 1e9, span.last_ns / 1e9)
    return {"from_s": first_s, "to_s": last_s}


def _numbers(values: Array) -> list[float | None]:
    return [float(value) if math.isfinite(value) else None for value in values]

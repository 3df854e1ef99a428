"""Convert a log into a recording, and write a recording in any supported format."""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pcsv

from estimator.arm.delta import wrist_of
from estimator.arm.design import OmnidDesign
from estimator.errors import InputError
from estimator.files import whole_file
from estimator.recording.checks import check_recording
from estimator.recording.model import Recording
from estimator.recording.parquet import write_recording
from mocobot_logs.cut import SHORTEST_NS, WHOLE, Choice, Omission, Piece, Span, extent_of, seconds, split
from mocobot_logs.formats import output_kind
from mocobot_logs.log import NS, Level, LogSource
from mocobot_logs.one_clock import ClockReport, to_recording
from mocobot_logs.resample import MAX_GAP_S, RATE_HZ, StreamReport, resample
from mocobot_logs.table.arrays import METADATA_NAME

UNKNOWN_TRIAL = "random"  # kind of trial if unknown; it only labels reports
PERIOD_DOUBT = 0.05
"""Largest error of the median of jittering intervals, as a share of the period. Derived: 1.25 / sqrt(1024) of their
scatter, rounded up."""
_CSV_ROWS = 10_000


@dataclass(frozen=True)
class Labels:
    """User's statements about a log; None leaves an entry to the log."""

    trial: str | None = None  # "random", "periodic", "static" or "free"
    payload: str | None = None  # name of the payload
    design: OmnidDesign | None = None  # design of the robots
    level: Level | None = None  # level of the output, "joint" or "wrist"


@dataclass(frozen=True, eq=False)
class Converted:
    recording: Recording  # the checked recording, on one grid and one clock
    level: Level  # level of the log
    streams: tuple[StreamReport, ...]  # properties of each robot's stream, and how it was resampled
    clocks: ClockReport  # differences of the robots' clocks, and whether they were corrected
    span: Span | None  # part of the log, after the log's start, or None for all of it
    left_out: tuple[Omission, ...]  # parts left out on request or because they are unusable
    notes: tuple[str, ...]  # sentences on irregularities of the log


def convert(
    source: LogSource,
    labels: Labels,
    standard: OmnidDesign,
    *,
    choice: Choice = WHOLE,
    rate_hz: float = RATE_HZ,
    max_gap_s: float = MAX_GAP_S,
    correct: bool = False,
    advance: Callable[[int], object] = lambda _: None,
) -> Converted:
    """Convert a log to a recording on one grid that is plausible for an estimate (see ``check_recording``).

    Args:
        source: the log.
        labels: the user's statements, which override the log's own.
        standard: design if neither gives one.
        choice: the wanted part of the log.
        rate_hz: sampling rate of the recording [Hz].
        max_gap_s: longest gap that is filled [s].
        correct: whether to correct the robots' clocks to that of robot 1.
        advance: called with the progress, in the source's units.
    """
    how = partial(
        _convert, labels=labels, standard=standard, rate_hz=rate_hz, max_gap_s=max_gap_s, correct=correct
    )
    if not choice:
        return how(source, advance=advance)
    extent = extent_of(source, choice, max_gap_s, advance)
    span = extent.chosen if choice.crop is not None else None
    converted = how(Piece(source, extent.origin_ns, span, choice.drops))
    return replace(converted, span=span, left_out=extent.left_out)


def convert_parts(
    source: LogSource,
    labels: Labels,
    standard: OmnidDesign,
    *,
    choice: Choice = WHOLE,
    rate_hz: float = RATE_HZ,
    max_gap_s: float = MAX_GAP_S,
    correct: bool = False,
    advance: Callable[[int], object] = lambda _: None,
) -> tuple[list[Converted], list[Omission]]:
    """Convert every part of a log between gaps too long to be filled, see ``split``; arguments as in ``convert``.

    Returns at least one recording, and the omissions: unchosen parts, gaps, and parts too short or unusable.
    """
    extent = extent_of(source, choice, max_gap_s, advance)
    spans, out = split(extent)
    out += extent.left_out
    longest = max(spans, key=lambda span: span.length_ns, default=None)
    if longest is None or longest.length_ns < SHORTEST_NS:
        found = "" if longest is None else f"; the longest goes from {longest}"
        raise InputError(
            f"{source.name}: no part of it has all robots' samples for {seconds(SHORTEST_NS)} s without a gap of more "
            f"than {max_gap_s:g} s{found}"
        )
    # Jitter may shift the median period of a part from that of the log.
    max_gap_s += PERIOD_DOUBT * extent.period_ns * NS
    how = partial(
        _convert, labels=labels, standard=standard, rate_hz=rate_hz, max_gap_s=max_gap_s, correct=correct
    )
    done, errors = [], []
    for span in spans:
        if span.length_ns < SHORTEST_NS:
            out.append(Omission(span, None, None, f"shorter than {seconds(SHORTEST_NS)} s"))
            continue
        try:
            converted = how(Piece(source, extent.origin_ns, span, choice.drops))
        except InputError as error:
            errors.append(error)
            out.append(Omission(span, None, None, str(error).removeprefix(f"{source.name} ({span}): ")))
        else:
            done.append(replace(converted, span=span))
    if not done:
        raise errors[0]
    return done, sorted(out, key=lambda each: each.span.first_ns)


def _convert(
    source: LogSource,
    *,
    labels: Labels,
    standard: OmnidDesign,
    rate_hz: float,
    max_gap_s: float,
    correct: bool,
    advance: Callable[[int], object] = lambda _: None,
) -> Converted:
    resampled = resample(source, rate_hz, max_gap_s, advance)
    silent = source.metadata is None
    recording, clocks = to_recording(
        resampled,
        design=labels.design or (standard if silent else None),
        trial=labels.trial or (UNKNOWN_TRIAL if silent else None),
        payload=labels.payload,
        source=f"log {os.path.basename(source.name)}" if silent else None,
        correct=correct,
        cut=isinstance(source, Piece) and source.span is not None,
    )
    recording = replace(recording, metadata=replace(recording.metadata, level=labels.level or source.level))
    streams = resampled.reports
    del resampled  # as large as the recording
    check_recording(recording)
    return Converted(recording, source.level, streams, clocks, None, (), tuple(source.notes))


def write_converted(
    recording: Recording,
    path: Path,
    advance: Callable[[int], object] = lambda _: None,
    *,
    replace_bag: bool = False,
) -> None:
    """Write a recording at the level of its metadata, in the format that the target's name states (``output_kind``).

    ``advance`` is called with the samples written since the last call; ``replace_bag`` as in ``write_bag``.
    """
    kind, level = output_kind(path), recording.metadata.level
    if kind == "parquet":
        write_recording(recording, path)
    elif kind == "csv":
        write_csv(recording, path, level)
    elif kind == "npz":
        write_npz(recording, path, level)
    else:
        from mocobot_logs.bag.write import write_bag  # the import takes a third of a second

        storage = "sqlite3" if kind == "sqlite3" else "mcap"
        write_bag(
            recording, path, level=level, storage=storage, advance=advance, replace_bag=replace_bag
        )  # fmt: skip


def write_csv(recording: Recording, path: Path, level: Level = "joint") -> None:
    """Write a recording as CSV: a header, commas, the columns of docs/recording.md, every number exactly.

    A text table holds no metadata; a reader must supply trial, payload and design.
    """
    columns = replace(recording, metadata=replace(recording.metadata, level=level)).file_columns()
    table = pa.table({name: np.ascontiguousarray(values) for name, values in columns.items()})
    with whole_file(path) as temporary:
        pcsv.write_csv(table, temporary, pcsv.WriteOptions(batch_size=_CSV_ROWS, quoting_style="none"))


def write_npz(recording: Recording, path: Path, level: Level = "joint") -> None:
    """Write a recording as NPZ: ``time`` (Q,), then ``phi``, ``theta``, ``tau`` and ``ref`` of shape (Q, N, 3).

    At wrist level ``h`` and ``force`` replace phi and tau. ``mocobot`` holds the metadata as JSON text.
    """
    arrays = {"time": recording.time, "phi": recording.phi, "theta": recording.theta, "tau": recording.tau}
    if level == "wrist":
        try:
            h, force = wrist_of(recording.phi, recording.tau, recording.metadata.design)
        except InputError as error:
            raise InputError(f"{recording.name}: {error}") from error
        arrays = {"time": recording.time, "h": h, "theta": recording.theta, "force": force}
    if recording.ref is not None:
        arrays["ref"] = recording.ref
    rows = {name: np.ascontiguousarray(array) for name, array in arrays.items()}  # readers stream rows
    rows[METADATA_NAME] = np.array(replace(recording.metadata, level=level).to_json())
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, **rows)

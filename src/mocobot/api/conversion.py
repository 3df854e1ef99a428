"""Bring a measured log onto one grid and one clock."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from estimator.arm.design import OmnidDesign, load_design
from estimator.recording.metadata import Level
from mocobot.api.public import public
from mocobot_logs import convert as below
from mocobot_logs.convert_report import conversion_dict, format_conversion
from mocobot_logs.cut import parse_choice
from mocobot_logs.log import LogSource
from mocobot_logs.maps import read_map
from mocobot_logs.open_log import open_log
from mocobot_logs.resample import MAX_GAP_S, RATE_HZ
from mocobot_sim.scene.models import omnid_design


@dataclass(frozen=True, eq=False)
class Conversion(below.Converted):
    """A log that became a recording.

    Attributes:
        recording: on one grid and one clock, checked.
        level: of the log.
        streams: what was found in each robot's stream, and done to it.
        clocks: how the robots' clocks differ, and whether that was corrected.
        span: which part of the log it is, or None for all of it.
        left_out: what was left out of the log.
        log: what was converted.
    """

    log: Path

    def report(self, out: Path | str) -> str:
        """What was found and done, as text that names the recording's file."""
        return format_conversion(self, str(self.log), Path(out))

    def to_dict(self) -> dict[str, Any]:
        """Strict JSON with units in the keys; see ``mocobot_logs.convert_report`` for the keys."""
        return conversion_dict(str(self.log), [(self, None)], self.left_out)

    def write(self, path: Path | str, advance: Callable[[int], object] = lambda _: None) -> None:
        """Write the recording: .parquet, .csv, .npz, .mcap or .db3, or a rosbag2 folder if there is no suffix.

        Args:
            path: target.
            advance: takes the number of samples written since the last call.

        Raises:
            InputError: it cannot be written, or nothing is written under such a name.
        """
        below.write_converted(self.recording, Path(path), advance)


def convert(
    log: Path | str,
    *,
    map: Path | str | None = None,
    trial: str | None = None,
    payload: str | None = None,
    design: OmnidDesign | Path | str | None = None,
    level: Level | None = None,
    clock: Literal["keep", "correct"] = "keep",
    rate_hz: float = RATE_HZ,
    max_gap_s: float = MAX_GAP_S,
    crop: str | None = None,
    drop: Iterable[str] = (),
    episode: int | None = None,
    advance: Callable[[int], object] = lambda _: None,
) -> Conversion:
    """Convert a log (ROS 2 bag, CSV, NPZ, Parquet, LeRobot) to a recording.

    Args:
        log: a rosbag2 folder, .mcap, .db3, .csv, .npz, .mat or .parquet file, or a LeRobot dataset.
        map: map file, or name of a built-in map (docs/measured-data.md); found out if not given.
        trial: ``"random"``, ``"periodic"``, ``"static"`` or ``"free"`` (robots that hold nothing), if neither log nor
            map says; ``"random"`` else.
        payload: its name.
        design: numbers of the robots, or a TOML file of them, if not the log's own or those of the Omnid.
        level: how a file of the recording tells the samples; that of the log if not given.
        clock: believe the robots' stamps, or take out what their clocks differ by.
        rate_hz: of the recording [Hz].
        max_gap_s: longest time without samples that is filled [s].
        crop: part of the log that is kept, ``"12:95"``, ``"12:"`` or ``":95"`` in seconds from its start.
        drop: samples that are left out, each as ``"robot=2:30-31"``.
        episode: of a LeRobot dataset that holds several.
        advance: takes the progress made in reading, in the log's units.

    Raises:
        InputError: log, map or design cannot be used, or the result is not a plausible recording.
    """
    source, labels = _opened(log, map, trial, payload, design, level, episode)
    done = below.convert(
        source, labels, omnid_design(), choice=parse_choice(crop, drop),
        rate_hz=rate_hz, max_gap_s=max_gap_s, correct=clock == "correct", advance=advance,
    )  # fmt: skip
    return public(Conversion, done, log=Path(log))


def convert_parts(
    log: Path | str,
    *,
    map: Path | str | None = None,
    trial: str | None = None,
    payload: str | None = None,
    design: OmnidDesign | Path | str | None = None,
    level: Level | None = None,
    clock: Literal["keep", "correct"] = "keep",
    rate_hz: float = RATE_HZ,
    max_gap_s: float = MAX_GAP_S,
    crop: str | None = None,
    drop: Iterable[str] = (),
    episode: int | None = None,
    advance: Callable[[int], object] = lambda _: None,
) -> list[Conversion]:
    """Convert every part of a log between gaps too long to be filled; parts of no use are left out.

    Args:
        log, map, trial, payload, design, level, clock, rate_hz, max_gap_s, crop, drop, episode, advance: as in
            ``convert``.

    Returns:
        At least one; each has in ``left_out`` what is in none of them.

    Raises:
        InputError: as in ``convert``, or no part of it can be used.
    """
    source, labels = _opened(log, map, trial, payload, design, level, episode)
    done, left_out = below.convert_parts(
        source, labels, omnid_design(), choice=parse_choice(crop, drop),
        rate_hz=rate_hz, max_gap_s=max_gap_s, correct=clock == "correct", advance=advance,
    )  # fmt: skip
    return [public(Conversion, replace(each, left_out=tuple(left_out)), log=Path(log)) for each in done]


def _opened(
    log: Path | str,
    map: Path | str | None,
    trial: str | None,
    payload: str | None,
    design: OmnidDesign | Path | str | None,
    level: Level | None,
    episode: int | None,
) -> tuple[LogSource, below.Labels]:
    """The log, and what is said of it."""
    log_map = read_map(str(map)) if map is not None else None
    labels = below.Labels(
        trial=trial or (log_map.trial if log_map is not None else None),
        payload=payload,
        design=load_design(Path(design)) if isinstance(design, Path | str) else design,
        level=level,
    )
    return open_log(log, log_map, episode), labels

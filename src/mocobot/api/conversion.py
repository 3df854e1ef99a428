"""Bring a measured log onto one grid and one clock, and draft the map that says what is where in it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from estimator.arm.design import load_design
from estimator.files import write_text
from mocobot.api.recordings import quiet
from mocobot.options import ConvertOptions, MapOptions, made
from mocobot.results import public
from mocobot_logs import convert as below
from mocobot_logs.convert_report import conversion_dict, format_conversion, format_omissions
from mocobot_logs.cut import parse_choice
from mocobot_logs.log import LogSource
from mocobot_logs.maps import read_map
from mocobot_logs.open_log import open_log
from mocobot_sim.scene.models import omnid_design

if TYPE_CHECKING:
    from mocobot.api.joints import GivenModel


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

    def omissions(self) -> str:
        """What is in no part of the log, as text; empty if nothing."""
        return format_omissions(self.left_out) if self.left_out else ""

    def to_dict(self) -> dict[str, Any]:
        """Strict JSON with units in the keys; see ``mocobot_logs.convert_json`` for the keys."""
        return conversions_dict([(self, None)])

    def write(
        self, path: Path | str, advance: Callable[[int], object] = quiet, *, replace_bag: bool = False
    ) -> None:
        """Write the recording: .parquet, .csv, .npz, .mcap or .db3, or a rosbag2 folder if there is no suffix.

        Args:
            path: target.
            advance: takes the number of samples written since the last call.
            replace_bag: whether a folder that is an earlier bag is replaced.

        Raises:
            InputError: it cannot be written, or nothing is written under such a name.
        """
        below.write_converted(self.recording, Path(path), advance, replace_bag=replace_bag)


def conversions_dict(parts: Sequence[tuple[Conversion, Path | None]]) -> dict[str, Any]:
    """The JSON of all parts of one log, each with the file that it went to."""
    first, _ = parts[0]
    return conversion_dict(str(first.log), list(parts), first.left_out)


def convert(
    log: Path | str,
    options: ConvertOptions | None = None,
    *,
    advance: Callable[[int], object] = quiet,
    **fields: Any,
) -> Conversion:
    """Convert a log (ROS 2 bag, CSV, NPZ, Parquet, LeRobot) to a recording.

    Args:
        log: a rosbag2 folder, .mcap, .db3, .csv, .npz, .mat or .parquet file, or a LeRobot dataset.
        options: how; ``fields`` are fields of it.
        advance: takes the progress made in reading, in the log's units.

    Raises:
        InputError: log, map or design cannot be used, or the result is not a plausible recording.
    """
    source, labels, how = _opened(log, made(ConvertOptions, options, fields))
    done = below.convert(source, labels, omnid_design(), advance=advance, **how)
    return public(Conversion, done, log=Path(log))


def convert_parts(
    log: Path | str,
    options: ConvertOptions | None = None,
    *,
    advance: Callable[[int], object] = quiet,
    **fields: Any,
) -> list[Conversion]:
    """Convert every part of a log between gaps too long to be filled; parts of no use are left out.

    Args:
        log, options, advance: as in ``convert``.

    Returns:
        At least one; each has in ``left_out`` what is in none of them.

    Raises:
        InputError: as in ``convert``, or no part of it can be used.
    """
    source, labels, how = _opened(log, made(ConvertOptions, options, fields))
    done, left_out = below.convert_parts(source, labels, omnid_design(), advance=advance, **how)
    return [public(Conversion, replace(each, left_out=tuple(left_out)), log=Path(log)) for each in done]


def _opened(log: Path | str, chosen: ConvertOptions) -> tuple[LogSource, below.Labels, dict[str, Any]]:
    """The log, what is said of it, and how it is converted."""
    log_map, design = read_map(str(chosen.map)) if chosen.map is not None else None, chosen.design
    labels = below.Labels(
        trial=chosen.trial or (log_map.trial if log_map is not None else None),
        payload=chosen.payload,
        design=load_design(Path(design)) if isinstance(design, Path | str) else design,
        level=chosen.level,
    )
    how = {
        "choice": parse_choice(chosen.crop, chosen.drop),
        "rate_hz": chosen.rate_hz,
        "max_gap_s": chosen.max_gap_s,
        "correct": chosen.clock == "correct",
    }
    return open_log(log, log_map, chosen.episode), labels, how


@dataclass(frozen=True)
class MapDraft:
    """A draft of a map: TOML, with comments where names and values do not tell.

    Attributes:
        text: the draft.
        of: what was found, such as ``"3 robots"``.
        doubtful: number of lines that must be looked at.
        missing: what was not found; without it the map is not complete.
    """

    text: str
    of: str
    doubtful: int
    missing: tuple[str, ...]

    @property
    def summary(self) -> str:
        """What is left to do, in a line."""
        doubts = f"{self.doubtful} doubtful line{'s' * (self.doubtful != 1)} must be looked at"
        if self.missing:
            lacking = f"the draft is not complete: {', '.join(self.missing)} must be filled in"
            return "; ".join([self.of, *([doubts] if self.doubtful else []), lacking])
        return f"{self.of}; {doubts if self.doubtful else 'nothing is doubtful'}"

    def __str__(self) -> str:
        """The draft."""
        return self.text

    def write(self, path: Path | str) -> None:
        """Write it.

        Raises:
            InputError: the file cannot be written.
        """
        write_text(Path(path), self.text)


def map(
    log: Path | str, model: GivenModel | None = None, options: MapOptions | None = None, **fields: Any
) -> MapDraft:
    """Draft the map of a log: what is which channel, by names, the units in them, and values.

    Args:
        log: of any format that ``convert`` reads.
        model: of one robot whose joints were logged, or its file; None for a team.
        options: how; ``fields`` are fields of it.

    Raises:
        InputError: the log or the model cannot be read.
    """
    chosen = made(MapOptions, options, fields)
    if model is None:
        from mocobot_logs.draft import draft_of

        draft = draft_of(Path(log), chosen.episode)
        return MapDraft(draft.text, _count(draft.robots, "robot"), draft.doubtful, draft.missing)
    from mocobot.api.joints import read_model
    from mocobot_logs.draft import draft_joint_map

    robot = read_model(model)
    made_of = draft_joint_map(Path(log), robot.joints, [bool(s) for s in robot.slides], chosen.episode)
    return MapDraft(made_of.text, _count(len(robot.joints), "joint"), made_of.doubtful, made_of.missing)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number > 1)}"

"""Convert a measured log to one time grid and one clock, and draft the map of its channels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from estimator.arm.design import load_design
from estimator.files import write_text
from mocobot.api.recordings import quiet
from mocobot.option_types import made
from mocobot.options import ConvertOptions, MapOptions
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
    """A log that was converted to a recording.

    Attributes:
        recording: checked recording on one time grid and one clock.
        level: level of the log, joint or wrist.
        streams: findings in each robot's stream, and the changes made to it.
        clocks: offsets between the robots' clocks, and whether they were corrected.
        span: part of the log that the recording covers; None for all of it.
        left_out: parts of the log that no recording covers.
        log: path of the converted log.
    """

    log: Path

    def report(self, out: Path | str) -> str:
        """Report findings and changes as text; ``out`` is the file of the recording."""
        return format_conversion(self, str(self.log), Path(out))

    def omissions(self) -> str:
        """List as text which parts of the log were left out; empty if none."""
        return format_omissions(self.left_out) if self.left_out else ""

    def to_dict(self) -> dict[str, Any]:
        """Return strict JSON values with units in the keys; see ``mocobot_logs.convert_json``."""
        return conversions_dict([(self, None)])

    def write(
        self, path: Path | str, advance: Callable[[int], object] = quiet, *, replace_bag: bool = False
    ) -> None:
        """Write the recording as .parquet, .csv, .npz, .mcap or .db3, or as a rosbag2 folder without a suffix.

        Args:
            path: file or folder to write; its suffix determines the format.
            advance: called with the number of samples written since the last call.
            replace_bag: whether to replace a folder that holds an earlier bag.

        Raises:
            InputError: the target cannot be written, or its suffix belongs to no format.
        """
        below.write_converted(self.recording, Path(path), advance, replace_bag=replace_bag)


def conversions_dict(parts: Sequence[tuple[Conversion, Path | None]]) -> dict[str, Any]:
    """Return the JSON of all parts of one log, each with the file to which it was written, or None."""
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
        log: rosbag2 folder; .mcap, .db3, .csv, .npz, .mat or .parquet file; or LeRobot dataset.
        options: options of the conversion; ``fields`` replace its fields.
        advance: called with the progress of reading since the last call, in units that depend on the log's format.

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
    """Convert each part of a log between gaps that are too long to fill; unusable parts are left out.

    Args:
        log, options, advance: as for ``convert``.

    Returns:
        At least one conversion; ``left_out`` of each lists what none of them covers.

    Raises:
        InputError: as for ``convert``, or no part can be used.
    """
    source, labels, how = _opened(log, made(ConvertOptions, options, fields))
    done, left_out = below.convert_parts(source, labels, omnid_design(), advance=advance, **how)
    return [public(Conversion, replace(each, left_out=tuple(left_out)), log=Path(log)) for each in done]


def _opened(log: Path | str, chosen: ConvertOptions) -> tuple[LogSource, below.Labels, dict[str, Any]]:
    """Open a log; return it with the labels that the options state and the arguments of the conversion."""
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
    """Draft of a map in TOML, with comments on lines that names and values leave open.

    Attributes:
        text: the draft.
        of: what the log contains, such as ``"3 robots"``.
        doubtful: number of lines that the user must check.
        missing: required channels that were not found.
    """

    text: str
    of: str
    doubtful: int
    missing: tuple[str, ...]

    @property
    def summary(self) -> str:
        """Summary of the draft and of what the user must check or fill in, on one line."""
        doubts = f"{self.doubtful} doubtful line{'s' * (self.doubtful != 1)} must be looked at"
        if self.missing:
            lacking = f"the draft is not complete: {', '.join(self.missing)} must be filled in"
            return "; ".join([self.of, *([doubts] if self.doubtful else []), lacking])
        return f"{self.of}; {doubts if self.doubtful else 'nothing is doubtful'}"

    def __str__(self) -> str:
        """Return the draft."""
        return self.text

    def write(self, path: Path | str) -> None:
        """Write the draft to a file.
        Raises:
            InputError: the file cannot be written.
        """
        write_text(Path(path), self.text)


def map(
    log: Path | str, model: GivenModel | None = None, options: MapOptions | None = None, **fields: Any
) -> MapDraft:
    """Draft the map of a log: match its columns to channels by their names, units and values.

    Args:
        log: log in any format that ``convert`` reads.
        model: model of a single robot whose joints were logged, or path of its file. Without it, the log tells whether
            it is of a team or of one robot's joints.
        options: options of the draft; ``fields`` replace its fields.

    Raises:
        InputError: the log or the model cannot be read.
    """
    chosen = made(MapOptions, options, fields)
    chosen.check_part(model)
    if model is None:
        from mocobot_logs.draft_kind import draft_any

        draft, joints = draft_any(Path(log), chosen.episode)
        of = _count(draft.robots, "robot") if joints is None else _count(joints, "joint")
        return MapDraft(draft.text, of, draft.doubtful, draft.missing)
    from mocobot.api.joints import read_model
    from mocobot_logs.draft_joints import draft_joint_map

    robot = read_model(model, lock=chosen.lock, base=chosen.base)
    rest = [0.0 if a < 0.0 < b else 0.5 * (a + b) for a, b in zip(robot.lower, robot.upper, strict=True)]
    made_of = draft_joint_map(Path(log), robot.joints, [bool(s) for s in robot.slides], chosen.episode, rest)
    return MapDraft(made_of.text, _count(len(robot.joints), "joint"), made_of.doubtful, made_of.missing)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number > 1)}"

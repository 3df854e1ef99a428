"""``mocobot convert``: read a log of any format, bring it onto one grid, write it as any format, say what was done."""

import re
from collections.abc import Sequence
from pathlib import Path

from estimator.arm.design import load_design
from estimator.errors import InputError
from estimator.files import check_place, write_json
from mocobot.files.targets import check_no_input, check_output, map_file
from mocobot.options import Convert
from mocobot.progress import bar
from mocobot_logs.convert import Converted, Labels, convert, convert_parts, output_kind, write_converted
from mocobot_logs.convert_json import conversion_dict
from mocobot_logs.convert_report import format_conversion, format_omissions
from mocobot_logs.cut.choice import parse_choice
from mocobot_logs.cut.split import Omission
from mocobot_logs.map.files import read_map
from mocobot_logs.open_log import open_log
from mocobot_sim.scene.models import omnid_design

SLOWEST_HZ, FASTEST_HZ = 20.0, 2000.0
"""Bounds of the recording's rate: the estimator's filter passes 5 Hz."""
LONGEST_GAP_S = 10.0


def run(options: Convert) -> None:
    """Run the command.

    Raises:
        InputError: log, map or options that cannot be used, or an output that cannot be written.
    """
    _check(options)
    parts, left_out = _converted(options)
    targets = _targets(options.out, len(parts)) if options.split_at_gaps else [options.out]
    for target in targets if options.split_at_gaps else ():
        _check_target(options, target)
    for part, target in zip(parts, targets, strict=True):
        with bar(len(part.recording.time), "writing", "sample") as advance:
            write_converted(part.recording, target, advance)
    if options.json is not None:
        written = list(zip(parts, targets, strict=True))
        write_json(options.json, conversion_dict(str(options.log), written, left_out))
    for part, target in zip(parts, targets, strict=True):
        print(format_conversion(part, str(options.log), target))
    if options.split_at_gaps:
        if left_out:
            print(format_omissions(left_out))
        for old in _earlier(options.out, targets):
            print(f"{old} is of an earlier conversion, and was left as it is")


def _converted(options: Convert) -> tuple[list[Converted], Sequence[Omission]]:
    """The recordings, and what is in none of them."""
    log_map = read_map(options.map) if options.map is not None else None
    labels = Labels(
        trial=options.trial or (log_map.trial if log_map is not None else None),
        payload=options.payload,
        design=load_design(options.design) if options.design is not None else None,
        level=options.level,
    )
    choice = parse_choice(options.crop, options.drop)
    source = open_log(options.log, log_map, options.episode)
    with bar(source.size, "reading", "") as advance:
        how = {
            "choice": choice,
            "rate_hz": options.rate,
            "max_gap_s": options.max_gap,
            "correct": options.clock == "correct",
            "advance": advance,
        }
        if options.split_at_gaps:
            return convert_parts(source, labels, omnid_design(), **how)
        converted = convert(source, labels, omnid_design(), **how)
    return [converted], converted.left_out


def _targets(out: Path, count: int) -> list[Path]:
    width = len(str(count))
    return [out.with_name(f"{out.stem}-{k:0{width}}{out.suffix}") for k in range(1, count + 1)]


def _earlier(out: Path, targets: list[Path]) -> list[Path]:
    """Numbered recordings that this conversion did not write."""
    numbered = re.compile(re.escape(out.stem) + r"-[0-9]+" + re.escape(out.suffix))
    names = {target.name for target in targets}
    return sorted(
        path for path in out.parent.iterdir() if numbered.fullmatch(path.name) and path.name not in names
    )


def _check(options: Convert) -> None:
    """Everything that can be refused before the log is read."""
    _check_target(options, _targets(options.out, 1)[0] if options.split_at_gaps else options.out)
    if options.json is not None:
        check_output(options.json, [*_inputs(options), options.out], force=options.force)
    for option, value, low, high in (
        ("--rate", options.rate, SLOWEST_HZ, FASTEST_HZ),
        ("--max-gap", options.max_gap, 0.0, LONGEST_GAP_S),
    ):
        if not low <= value <= high:
            raise InputError(f"{option} is {value:g}; it must be from {low:g} to {high:g}")


def _inputs(options: Convert) -> list[Path]:
    design = [options.design] if options.design is not None else []
    return [options.log, *design, *map_file(options.map)]


def _check_target(options: Convert, out: Path) -> None:
    if output_kind(out) != "folder":
        check_output(out, _inputs(options), force=options.force)
        return
    check_no_input(out, _inputs(options))
    check_place(out)
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out}: exists; name a new folder for the bag, or a file with a suffix")

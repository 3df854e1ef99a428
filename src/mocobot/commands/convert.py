"""``mocobot convert``: read a log of any format, bring it onto one grid, write it as any format, say what was done."""

import re
from collections.abc import Sequence
from pathlib import Path

from estimator.arm.design import load_design
from estimator.files import write_json
from mocobot.checks import check_target, targets
from mocobot.options import Convert
from mocobot.progress import bar
from mocobot_logs.convert import Converted, Labels, convert, convert_parts, write_converted
from mocobot_logs.convert_report import conversion_dict, format_conversion, format_omissions
from mocobot_logs.cut import Omission, parse_choice
from mocobot_logs.maps import read_map
from mocobot_logs.open_log import open_log
from mocobot_sim.scene.models import omnid_design


def run(options: Convert) -> None:
    """Run the command.

    Raises:
        InputError: log, map or options that cannot be used, or an output that cannot be written.
    """
    parts, left_out = _converted(options)
    names = targets(options.out, len(parts)) if options.split_at_gaps else [options.out]
    for target in names if options.split_at_gaps else ():
        check_target(options, target)
    for part, target in zip(parts, names, strict=True):
        with bar(len(part.recording.time), "writing", "sample") as advance:
            write_converted(part.recording, target, advance, replace_bag=options.force)
    if options.json is not None:
        written = list(zip(parts, names, strict=True))
        write_json(options.json, conversion_dict(str(options.log), written, left_out))
    for part, target in zip(parts, names, strict=True):
        print(format_conversion(part, str(options.log), target))
    if options.split_at_gaps:
        if left_out:
            print(format_omissions(left_out))
        for old in _earlier(options.out, names):
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


def _earlier(out: Path, written: list[Path]) -> list[Path]:
    """Numbered recordings that this conversion did not write."""
    numbered = re.compile(re.escape(out.stem) + r"-[0-9]+" + re.escape(out.suffix))
    names = {target.name for target in written}
    return sorted(
        path for path in out.parent.iterdir() if numbered.fullmatch(path.name) and path.name not in names
    )

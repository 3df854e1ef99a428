"""``mocobot convert``: read a log of any format, bring it onto one grid, write it as any format, say what was done."""

from pathlib import Path

from estimator.arm.design import load_design
from estimator.errors import InputError
from estimator.files import check_place
from mocobot.files.targets import check_no_input, check_output
from mocobot.options import Convert
from mocobot.progress import bar
from mocobot_logs.convert import Labels, convert, output_kind, write_converted
from mocobot_logs.convert_report import format_conversion
from mocobot_logs.map.files import MAPS, read_map
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
    log_map = read_map(options.map) if options.map is not None else None
    labels = Labels(
        trial=options.trial or (log_map.trial if log_map is not None else None),
        payload=options.payload,
        design=load_design(options.design) if options.design is not None else None,
        level=options.level,
    )
    source = open_log(options.log, log_map, options.episode)
    with bar(source.size, "reading", "") as advance:
        converted = convert(
            source,
            labels,
            omnid_design(),
            rate_hz=options.rate,
            max_gap_s=options.max_gap,
            correct=options.clock == "correct",
            advance=advance,
        )
    with bar(len(converted.recording.time), "writing", "sample") as advance:
        write_converted(converted.recording, options.out, advance)
    print(format_conversion(converted, str(options.log), options.out))


def _check(options: Convert) -> None:
    """Everything that can be refused before the log is read."""
    out = options.out
    kind = output_kind(out)
    inputs = [options.log, *([options.design] if options.design is not None else [])]
    if options.map is not None and options.map not in MAPS and Path(options.map).is_file():
        inputs.append(Path(options.map))
    if kind != "folder":
        check_output(out, inputs, force=options.force)
    else:
        check_no_input(out, inputs)
        check_place(out)
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise InputError(f"{out}: exists; name a new folder for the bag, or a file with a suffix")
    for option, value, low, high in (
        ("--rate", options.rate, SLOWEST_HZ, FASTEST_HZ),
        ("--max-gap", options.max_gap, 0.0, LONGEST_GAP_S),
    ):
        if not low <= value <= high:
            raise InputError(f"{option} is {value:g}; it must be from {low:g} to {high:g}")

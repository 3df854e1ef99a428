"""What ``mocobot convert`` refuses at once."""

from pathlib import Path

from estimator.errors import InputError
from estimator.written import holds
from mocobot.files.targets import (
    check_folder,
    check_formats,
    check_no_input,
    check_output,
    check_there,
    map_file,
)
from mocobot.options import Convert
from mocobot_logs.output_kind import output_kind

SLOWEST_HZ, FASTEST_HZ = 20.0, 2000.0
"""Bounds of the recording's rate: the estimator's filter passes 5 Hz."""
LONGEST_GAP_S = 10.0


def check(options: Convert) -> None:
    """Everything that can be refused before the log is read.

    Raises:
        InputError: an option or an output that cannot be met, or a missing log.
    """
    check_target(options, targets(options.out, 1)[0] if options.split_at_gaps else options.out)
    if options.json is not None:
        check_output(options.json, [*_inputs(options), options.out], force=options.force)
    for option, value, low, high in (
        ("--rate", options.rate, SLOWEST_HZ, FASTEST_HZ),
        ("--max-gap", options.max_gap, 0.0, LONGEST_GAP_S),
    ):
        if not low <= value <= high:
            raise InputError(f"{option} is {value:g}; it must be from {low:g} to {high:g}")
    check_there([options.log])
    check_formats([options.log])


def targets(out: Path, count: int) -> list[Path]:
    """Numbered names for the parts of a log."""
    width = len(str(count))
    return [out.with_name(f"{out.stem}-{k:0{width}}{out.suffix}") for k in range(1, count + 1)]


def check_target(options: Convert, out: Path) -> None:
    """One recording, under the name that it will have.

    Raises:
        InputError: it may not be written, or cannot.
    """
    if output_kind(out) != "folder":
        check_output(out, _inputs(options), force=options.force)
        return
    check_no_input(out, _inputs(options))
    check_folder(out, _inputs(options), holds("bag"), "a bag of an earlier conversion", force=options.force)


def _inputs(options: Convert) -> list[Path]:
    design = [options.design] if options.design is not None else []
    return [options.log, *design, *map_file(options.map)]

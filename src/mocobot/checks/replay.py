"""What ``mocobot replay`` refuses at once."""

from pathlib import Path

from estimator.errors import InputError
from mocobot.files.targets import (
    calibration_file,
    check_formats,
    check_no_team,
    check_output,
    check_recordings,
    check_there,
)
from mocobot.options import Replay


def check(options: Replay) -> None:
    """Everything that can be refused before a recording is read.

    Raises:
        InputError: an option or an output that cannot be met, or a missing file.
    """
    if options.save is not None and options.web:
        raise InputError("--save and --web are both given; choose a file or a browser")
    check_recordings(options.rec)
    if options.model is not None:
        check_no_team(options, ("estimate", "calibration", "diagnosis", "payload", "truth"))
    elif options.map is not None:
        raise InputError("--map goes with --model; logs of a team are converted to recordings first")
    if options.save is not None:
        inputs = [*options.rec, *([options.estimate] if options.estimate else [])]
        inputs += calibration_file(options.calibration)
        inputs += [options.model] if options.model is not None else []
        inputs += [Path(options.map)] if options.map is not None else []
        check_output(options.save, inputs, force=options.force, suffix=".rrd")
    check_there([*options.rec, *([options.model] if options.model is not None else [])])
    check_formats(options.rec)

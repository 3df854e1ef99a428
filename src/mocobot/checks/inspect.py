"""What ``mocobot inspect`` refuses at once."""

from pathlib import Path

from mocobot.files.targets import calibration_file, check_formats, check_no_team, check_output, check_there
from mocobot.options import Inspect


def check(options: Inspect) -> None:
    """Everything that can be refused before the log is read.

    Raises:
        InputError: an option or an output that cannot be met, or a missing file.
    """
    inputs = [options.rec, *calibration_file(options.calibration)]
    if options.model is not None:
        check_no_team(options, ("design", "calibration"))
        inputs += [options.model, *([Path(options.map)] if options.map is not None else [])]
    if options.json is not None:
        check_output(options.json, inputs, force=options.force)
    check_there([options.rec, *([options.model] if options.model is not None else [])])
    check_formats([options.rec])

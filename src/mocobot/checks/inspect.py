"""What ``mocobot inspect`` refuses at once."""

from mocobot.files.targets import calibration_file, check_output, check_there
from mocobot.options import Inspect


def check(options: Inspect) -> None:
    """Everything that can be refused before the log is read.

    Raises:
        InputError: an output that cannot be written, or a missing file.
    """
    if options.json is not None:
        check_output(options.json, [options.rec, *calibration_file(options.calibration)], force=options.force)
    check_there([options.rec])

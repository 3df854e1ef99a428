"""What ``mocobot replay`` refuses at once."""

from estimator.errors import InputError
from mocobot.files.targets import calibration_file, check_output, check_recordings, check_there
from mocobot.options import Replay


def check(options: Replay) -> None:
    """Everything that can be refused before a recording is read.

    Raises:
        InputError: an option or an output that cannot be met, or a missing file.
    """
    if options.save is not None and options.web:
        raise InputError("--save and --web are both given; choose a file or a browser")
    check_recordings(options.rec)
    if options.save is not None:
        inputs = [*options.rec, *([options.estimate] if options.estimate else [])]
        inputs += calibration_file(options.calibration)
        check_output(options.save, inputs, force=options.force, suffix=".rrd")
    check_there(options.rec)

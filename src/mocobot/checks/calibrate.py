"""What ``mocobot calibrate`` refuses at once."""

from estimator.errors import InputError
from estimator.written import holds
from mocobot.files.targets import check_folder, check_formats, check_recordings, check_there, map_file
from mocobot.options import Calibrate


def check(options: Calibrate) -> None:
    """Everything that can be refused before a recording is read.

    Raises:
        InputError: an option or an output that cannot be met, or a missing file.
    """
    if not options.rec:
        raise InputError("no recording with a payload is given; name them first, those of --free after it")
    files = [*options.rec, *options.free]
    check_recordings(files)
    if options.out is not None:
        inputs = [*files, *([options.prior] if options.prior else []), *map_file(options.map)]
        check_folder(options.out, inputs, holds("calibration"), "an earlier calibration", force=options.force)
    check_there(files)
    check_formats(files)

"""What ``mocobot estimate`` refuses at once."""

from estimator.errors import InputError
from mocobot.files.targets import (
    calibration_file,
    check_formats,
    check_output,
    check_recordings,
    check_there,
    map_file,
)
from mocobot.options import Estimate


def check(options: Estimate) -> None:
    """Everything that can be refused before a recording is read.

    Raises:
        InputError: an option or an output that cannot be met, or a missing file.
    """
    check_recordings(options.rec)
    for name, given in (
        ("--calibration", options.calibration is not None),
        (f"--method {options.method}", options.method != "auto"),
    ):
        if options.self_calibrate and given:
            raise InputError(f"--self-calibrate and {name} are both given; choose one")
    if options.out is not None:
        inputs = [*options.rec, *map_file(options.map), *calibration_file(options.calibration)]
        check_output(options.out, inputs, force=options.force)
    check_there(options.rec)
    check_formats(options.rec)

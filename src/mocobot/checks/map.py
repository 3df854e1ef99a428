"""What ``mocobot map`` refuses at once."""

from mocobot.files.targets import check_formats, check_output, check_there
from mocobot.options import Map


def check(options: Map) -> None:
    """Everything that can be refused before the log is read.

    Raises:
        InputError: an output that cannot be written, or a missing file.
    """
    inputs = [options.log, *([options.model] if options.model is not None else [])]
    if options.out is not None:
        check_output(options.out, inputs, force=options.force)
    check_there(inputs)
    check_formats([options.log])

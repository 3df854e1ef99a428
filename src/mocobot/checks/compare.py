"""What ``mocobot compare`` refuses at once."""

from estimator.written import holds
from mocobot.files.targets import check_folder, check_there
from mocobot.options import Compare


def check(options: Compare) -> None:
    """Everything that can be refused before a result is read.

    Raises:
        InputError: an output that cannot be written, or a missing file.
    """
    if options.out is not None:
        inputs = [options.a, options.b]
        check_folder(options.out, inputs, holds("comparison"), "an earlier comparison", force=options.force)
    check_there([options.a, options.b])

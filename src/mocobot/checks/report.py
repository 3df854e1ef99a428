"""What ``mocobot report`` refuses at once."""

from mocobot.files.targets import check_output
from mocobot.options import Report
from mocobot_report.sought import NAME, SUFFIX, check_folder


def check(options: Report) -> None:
    """A folder that is none, and a page that may not be written, or cannot.

    Raises:
        InputError: it is one.
    """
    if options.dir.is_file() and options.dir.suffix != ".json":
        return  # the command finds out what kind of file it is
    check_folder(options.dir)
    check_output(options.out or options.dir / NAME, force=options.force, suffix=SUFFIX)

"""What ``mocobot watch`` refuses at once."""

from estimator.errors import InputError
from estimator.written import holds
from mocobot.files.targets import check_folder, check_formats, check_recordings, check_there, map_file
from mocobot.options import Watch

VERDICT, PAGE = "verdict.txt", "report.html"


def check(options: Watch) -> None:
    """Everything that can be refused before a log is read.

    Raises:
        InputError: an option or an output that cannot be met, or a missing file.
    """
    if options.jobs < 1:
        raise InputError(f"jobs is {options.jobs}; it must be at least 1")
    check_recordings(options.rec)
    stems = [path.stem for path in options.rec]
    for stem in stems:
        if stems.count(stem) > 1:
            raise InputError(f"{stem} is the name of two recordings; give each a name of its own")
    if options.out is not None:
        inputs = [*options.rec, *map_file(options.map)]
        check_folder(options.out, inputs, holds("watch"), "an earlier result of watch", force=options.force)
    check_there(options.rec)
    check_formats(options.rec)

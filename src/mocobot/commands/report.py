"""``mocobot report``: one HTML page of a result folder."""

from estimator.errors import InputError
from mocobot.files.recordings import check_no_log
from mocobot.options import Report
from mocobot.progress import stages
from mocobot_report import NAME
from mocobot_report.page import write_report


def run(options: Report) -> None:
    """Run the command.

    Raises:
        InputError: the folder holds no result, or one that cannot be read, or the page cannot be written.
    """
    if options.dir.is_file() and options.dir.suffix != ".json":
        check_no_log(options.dir)
        raise InputError(
            f"{options.dir}: is a file; name a folder of results, such as mocobot estimate --out results/est.json makes"
        )
    out = options.out if options.out is not None else options.dir / NAME
    with stages() as (say, _):
        write_report(options.dir, out, say)
    print(f"{out}: {out.stat().st_size / 1e6:.1f} MB; open it in a browser, or hand it on.")

"""``mocobot report``: one HTML page of a result folder."""

from mocobot.options import Report
from mocobot.progress import stages
from mocobot_report.page import write_report


def run(options: Report) -> None:
    """Run the command.

    Raises:
        InputError: the folder holds no result, or one that cannot be read, or the page cannot be written.
    """
    with stages() as (say, _):
        out = write_report(options.dir, options.out, say)
    print(f"{out}: {out.stat().st_size / 1e6:.1f} MB; open it in a browser, or hand it on.")

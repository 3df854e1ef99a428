"""Where a report goes: nothing is overwritten but an earlier report."""

from pathlib import Path

from estimator.errors import InputError
from estimator.files import check_target, system_errors

MARK = "mocobot report"
"""Generator that a page names; a file without it is no report."""
SUFFIX = ".html"
HEAD_BYTES = 1000


def check_page(out: Path) -> None:
    """Find out that a page cannot be written before it is made.

    Raises:
        InputError: the name does not end in .html, is that of a folder or of a file that is no report, or its folder
            does not exist.
    """
    check_target(out, SUFFIX)
    with system_errors(out):
        if out.exists() and not is_report(out):
            raise InputError(f"{out}: exists and is not a report of mocobot; name another file")


def is_report(path: Path) -> bool:
    """Whether a file is a page of this module; an empty one may be overwritten, too."""
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    return not head or f'<meta name="generator" content="{MARK}">'.encode() in head

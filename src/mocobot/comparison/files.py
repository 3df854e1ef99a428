"""A comparison as a folder: comparison.json, report.txt, and comparison.png if there is a number to be drawn."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from estimator.extras import draws_plots
from estimator.files import write_json, write_text
from mocobot.comparison.comparison import Comparison
from mocobot.comparison.text import format_comparison

NAME, REPORT, PICTURE = "comparison.json", "report.txt", "comparison.png"


def write_into(folder: Path, found: Comparison, made_with: Mapping[str, Any] | None = None) -> None:
    """Write everything into an existing folder.

    Args:
        folder: it.
        found: what is written.
        made_with: what ``mocobot.files.provenance.provenance`` says, or None.

    Raises:
        InputError: something cannot be written.
    """
    more = {} if made_with is None else {"provenance": dict(made_with)}
    write_json(folder / NAME, found.to_dict() | more)
    write_text(folder / REPORT, f"{format_comparison(found)}\n")
    if found.groups and draws_plots():
        from mocobot.comparison.picture import save_picture  # matplotlib

        save_picture(found, folder / PICTURE)

"""What an installation may do without, and the sentence that says how to get it."""

import sys
from functools import cache
from importlib.util import find_spec

PLOTS = ("matplotlib", "PIL")
"""Packages that draw pictures into files, and teams into pages."""
NO_PLOTS = "no pictures are drawn: matplotlib and pillow are not installed; get them with: pip install 'mocobot[plots]'"


def has_plots() -> bool:
    """Whether pictures can be drawn."""
    return all(find_spec(name) is not None for name in PLOTS)


@cache
def draws_plots() -> bool:
    """Whether pictures are drawn into files; if not, standard error says so, once."""
    if not has_plots():
        print(f"mocobot: {NO_PLOTS}", file=sys.stderr)
    return has_plots()

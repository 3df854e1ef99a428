"""Optional packages, and the hint how to install them."""

import sys
from functools import cache
from importlib.util import find_spec

PLOTS = ("matplotlib", "PIL")
"""Packages required to draw plots to files, and robots to web pages."""
NO_PLOTS = "no pictures are drawn: matplotlib and pillow are not installed; get them with: pip install 'mocobot[plots]'"


def has_plots() -> bool:
    """Return whether the packages for plots are installed."""
    return all(find_spec(name) is not None for name in PLOTS)


@cache
def draws_plots() -> bool:
    """Return whether plots are drawn to files; if not, print a hint to standard error once."""
    if not has_plots():
        print(f"mocobot: {NO_PLOTS}", file=sys.stderr)
    return has_plots()

"""Plots with literal text: matplotlib would otherwise parse some names given by users as formulas."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from matplotlib import rc_context
from matplotlib.axis import Axis
from matplotlib.ticker import LogFormatter


@contextmanager
def plain_words() -> Iterator[None]:
    """Context manager or decorator that draws text literally and suppresses warnings about missing glyphs."""
    with rc_context({"text.parse_math": False}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


class _Plain(LogFormatter):
    def __call__(self, x: float, pos: int | None = None) -> str:
        """Plain number where LogFormatter would label the axis, else an empty string."""
        return f"{x:g}" if super().__call__(x, pos) else ""


def plain_numbers(axis: Axis) -> None:
    """Label a logarithmic axis with plain numbers instead of powers of ten."""
    axis.set_major_formatter(_Plain())
    axis.set_minor_formatter(_Plain())

"""Pictures whose words are shown as they are: names that users give may look like formulas to matplotlib."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from matplotlib import rc_context
from matplotlib.axis import Axis
from matplotlib.ticker import LogFormatter


@contextmanager
def plain_words() -> Iterator[None]:
    """A block, or a function that this decorates, that draws without formulas and quietly without rare letters."""
    with rc_context({"text.parse_math": False}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


class _Plain(LogFormatter):
    def __call__(self, x: float, pos: int | None = None) -> str:
        """The number, where LogFormatter has one."""
        return f"{x:g}" if super().__call__(x, pos) else ""


def plain_numbers(axis: Axis) -> None:
    """Label a logarithmic axis with numbers in place of formulas."""
    axis.set_major_formatter(_Plain())
    axis.set_minor_formatter(_Plain())

"""Progress bars on standard error."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tqdm import tqdm


@contextmanager
def bar(total: int | None, what: str, unit: str) -> Iterator[Callable[[int], object]]:
    """Show a bar while the block runs, on terminals only; yields a function that takes the progress made.

    Args:
        total: how many units there are, or None where unknown.
        what: what is being done.
        unit: name of one unit.
    """
    with tqdm(total=total, desc=what, unit=unit, dynamic_ncols=True, leave=False, disable=None) as shown:
        yield shown.update

"""Progress bars on standard error."""

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


@contextmanager
def stages() -> Iterator[tuple[Callable[[str], object], Callable[[int], object]]]:
    """Show a bar of work whose length nobody knows, on terminals only.

    Yields a function that takes the name of the stage that begins, and one that takes the progress made.
    """
    with tqdm(desc="start", unit="step", dynamic_ncols=True, leave=False, disable=None) as shown:

        def say(what: str) -> None:
            shown.set_description_str(what, refresh=False)
            shown.update(1)

        yield say, shown.update

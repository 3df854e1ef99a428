"""Show progress bars on standard error."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tqdm import tqdm


@contextmanager
def bar(total: int | None, what: str, unit: str) -> Iterator[Callable[[int], object]]:
    """Show a progress bar while the block runs, on terminals only.

    Yields a function that takes the number of units done since its last call.

    Args:
        total: number of units, or None if unknown.
        what: name of the work.
        unit: name of one unit.
    """
    with tqdm(total=total, desc=what, unit=unit, dynamic_ncols=True, leave=False, disable=None) as shown:
        yield shown.update


@contextmanager
def share_bar(what: str, unit: str) -> Iterator[Callable[[float, float, str], object]]:
    """Show a progress bar for work whose amount is known only once it runs, on terminals only.

    Yields a function that takes the amount done, the total amount and the name of the current stage.

    Args:
        what: name of the work.
        unit: unit of the amounts.
    """
    form = "{desc}: {percentage:3.0f}%|{bar}| {n:.1f} of {total:g} " + unit + " [{elapsed}<{remaining}]"
    # Little smoothing, because progress arrives in bursts while the time per unit hardly changes.
    with tqdm(
        desc=what, bar_format="{desc}", dynamic_ncols=True, smoothing=0.05, leave=False, disable=None
    ) as shown:

        def tell(done: float, total: float, stage: str = "") -> None:
            shown.total, shown.bar_format = total, form
            shown.set_description_str(f"{what}, {stage}" if stage else what, refresh=False)
            shown.update(done - shown.n)

        yield tell


@contextmanager
def stages() -> Iterator[tuple[Callable[[str], object], Callable[[int], object]]]:
    """Show a progress bar for work of unknown length, on terminals only.

    Yields two functions: one takes the name of the stage that begins, the other the number of steps done.
    """
    with tqdm(desc="start", unit="step", dynamic_ncols=True, leave=False, disable=None) as shown:

        def say(what: str) -> None:
            shown.set_description_str(what, refresh=False)
            shown.update(1)

        yield say, shown.update

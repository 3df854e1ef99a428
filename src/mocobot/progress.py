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
def share_bar(what: str, unit: str) -> Iterator[Callable[[float, float, str], object]]:
    """Show a bar of work whose amount shows when it begins, on terminals only.

    Yields a function that takes what is done, what there is to do, and a name for the stage that runs.

    Args:
        what: what is being done.
        unit: of the work.
    """
    form = "{desc}: {percentage:3.0f}%|{bar}| {n:.1f} of {total:g} " + unit + " [{elapsed}<{remaining}]"
    # Little smoothing: the time per unit is much the same all along, while what is done arrives in bursts.
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
    """Show a bar of work whose length nobody knows, on terminals only.

    Yields a function that takes the name of the stage that begins, and one that takes the progress made.
    """
    with tqdm(desc="start", unit="step", dynamic_ncols=True, leave=False, disable=None) as shown:

        def say(what: str) -> None:
            shown.set_description_str(what, refresh=False)
            shown.update(1)

        yield say, shown.update

"""How much of several tasks is done, wherever they run: shares in a file that processes map."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread

import numpy as np

from estimator.arrays import Array
from estimator.processes import scratch_folder

EVERY_S = 0.2
"""Time between two looks at the shares."""


@contextmanager
def shares(tasks: int, told: Callable[[float], object]) -> Iterator[Array]:
    """Watch tasks while the block runs.

    Args:
        tasks: how many there are.
        told: called, from a thread of its own, with how much is done, in tasks; at first with 0.

    Yields:
        The share of each task that is done, shape (tasks,), for the tasks to write to, in any process.
    """
    with scratch_folder() as folder:
        done = np.memmap(folder / "shares", dtype=float, mode="w+", shape=(tasks,))
        over = Event()

        def tell() -> None:
            ends = False
            while not ends:
                ends = over.wait(EVERY_S)
                told(float(done.sum()))

        told(0.0)
        thread = Thread(target=tell, daemon=True)
        thread.start()
        try:
            yield done
        finally:
            over.set()
            thread.join()

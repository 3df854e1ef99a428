"""Stages of an experiment: many tasks each, in several processes, with progress, kept on disk as they end."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from threading import Event, Thread
from typing import Any

import numpy as np
from joblib import Parallel, delayed

from estimator.arrays import Array
from estimator.files import scratch_folder
from mocobot_sim.paper.store import Store

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


Progress = Callable[[float, float, str], object]


class Work:
    """Runs stage after stage.

    Attributes:
        steps: tasks of all stages.
        progress: called with what is done, ``steps``, and the name of the stage.
        store: where outcomes are kept; None to keep none.
        remote: whether the processes are on other machines: they cannot say how much of a task is done.
    """

    def __init__(
        self, pool: Parallel, steps: int, progress: Progress, store: Store | None, *, remote: bool
    ) -> None:
        """Run in an open pool, which returns outcomes as they come (``generator_unordered``)."""
        self.steps, self.progress, self.store, self.remote = steps, progress, store, remote
        self._pool, self._before = pool, 0

    def each(
        self, stage: str, function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]
    ) -> Iterator[Any]:
        """Outcomes of a function of a share to write to and a task, in the order of the tasks."""
        start, self._before = self._before, self._before + len(tasks)
        kept = {k for k in range(len(tasks)) if self.store is not None and self.store.has(stage, k)}
        with shares(len(tasks), lambda now: self.progress(start + now, self.steps, stage)) as done:
            done[list(kept)] = 1.0
            calls = (
                delayed(_run)(None if self.remote else done[k : k + 1], k, function, task)
                for k, task in enumerate(tasks)
                if k not in kept
            )
            ended, following = {}, 0
            outcomes: Any = self._pool(calls)
            for k, outcome in outcomes:
                done[k] = 1.0
                if self.store is not None:
                    self.store.put(stage, k, outcome)
                ended[k] = outcome
                while following in ended or following in kept:
                    yield self._take(stage, following, ended)
                    following += 1
            while following < len(tasks):
                yield self._take(stage, following, ended)
                following += 1

    def _take(self, stage: str, k: int, ended: dict[int, Any]) -> Any:
        if k in ended:
            return ended.pop(k)
        assert self.store is not None
        return self.store.get(stage, k)


def _run(share: Array | None, k: int, function: Callable[..., Any], task: tuple[Any, ...]) -> tuple[int, Any]:
    """One task, with its number: outcomes come as they are done."""
    return k, function(np.zeros(1) if share is None else share, *task)

"""Run joblib's tasks on other machines, through a Dask scheduler."""

import platform
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from estimator.errors import InputError

INSTALL = "pip install 'mocobot[cluster]'"
REACH_S, WORKERS_S = 20.0, 120.0
"""Time limits for reaching the scheduler and for its first worker [s]. Chosen."""

LARGE_TASKS = {"distributed.admin.large-graph-warning-threshold": "1TB"}
"""Raises Dask's 10 MB warning limit, because an estimate sends all recordings of its experiment, tens of MB."""


@contextmanager
def workers_of(scheduler: str | None) -> Iterator[None]:
    """Context manager: ``joblib.Parallel`` runs on the workers of a scheduler inside the block.

    Another worker takes over the tasks of a lost one. Workers must have one thread each and the same versions of all
    numerical packages, so that results do not depend on the number of workers.

    Args:
        scheduler: address (``tcp://host:8786``) or path of the scheduler file; None leaves joblib unchanged.

    Raises:
        InputError: dask.distributed is not installed; the scheduler cannot be reached, has no workers or is lost;
            a worker has other versions or more threads; or a task ends every worker that tries it.
    """
    if scheduler is None:
        yield
        return
    try:
        from dask import config
        from distributed import CancelledError, Client, KilledWorker
        from distributed.comm.core import CommClosedError
        from joblib._dask import DaskDistributedBackend  # joblib's backend "dask"; it has no public name
    except ImportError as error:
        raise InputError(
            f"--scheduler needs dask.distributed, which is not installed; get it with: {INSTALL}"
        ) from error
    from joblib import parallel_config

    class Workers(DaskDistributedBackend):
        """Sends tasks to the cluster even if one worker is left; joblib would then use this process."""

        def effective_n_jobs(self, n_jobs: int) -> int:
            return max(2, super().effective_n_jobs(n_jobs))

    is_file = "://" not in scheduler
    if is_file and not Path(scheduler).is_file():
        raise InputError(
            f"--scheduler is {scheduler!r}; it must be an address such as tcp://host:8786, or a scheduler file"
        )
    try:
        if is_file:
            client = Client(scheduler_file=scheduler, timeout=REACH_S, set_as_default=True)
        else:
            client = Client(scheduler, timeout=REACH_S, set_as_default=True)
    except (OSError, ValueError, TypeError) as error:  # a timeout is an OSError
        raise InputError(f"scheduler {scheduler}: cannot be reached ({_line(error)})") from error
    with client:
        _check_workers(client, scheduler)
        try:
            with config.set(LARGE_TASKS), parallel_config(backend=Workers(client=client)):
                yield
        except KilledWorker as error:
            raise InputError(
                f"scheduler {scheduler}: a task ended every worker that tried it; they may be short of memory "
                f"({_line(error)})"
            ) from error
        except (CommClosedError, CancelledError) as error:
            raise InputError(
                f"scheduler {scheduler}: it, or data on a worker, was lost ({_line(error)})"
            ) from error


def _check_workers(client: Any, scheduler: str) -> None:
    try:
        client.wait_for_workers(1, timeout=WORKERS_S)
    except TimeoutError as error:
        raise InputError(f"scheduler {scheduler}: has no workers, after {WORKERS_S:g} s") from error
    threads = {
        name: worker["nthreads"] for name, worker in client.scheduler_info(n_workers=-1)["workers"].items()
    }
    for name, count in threads.items():
        if count != 1:
            raise InputError(f"worker {name} has {count} threads; start workers with --nthreads 1")
    here = versions()
    for name, there in client.run(versions, on_error="return").items():
        if not isinstance(there, Mapping):
            raise InputError(f"worker {name}: mocobot cannot be loaded there ({_line(there)})")
        for what, version in here.items():
            if there.get(what) != version:
                raise InputError(f"worker {name} has {what} {there.get(what)}; it must be {version}, as here")


def versions() -> dict[str, str]:
    """Versions of Python, the numerical packages and the code, which must be the same on every machine."""
    from mocobot.results import PACKAGES, code_digest, version_of

    found = {name: version_of(name) or "none" for name in PACKAGES}
    return found | {"python": platform.python_version(), "mocobot": code_digest()[:12]}


def _line(error: object) -> str:
    return " ".join(str(error).split())[:200]

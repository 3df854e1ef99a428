"""What a task costs on a cluster besides its work: seconds from here to a worker and back, and bytes of a trial.

python benchmarks/speed/cluster.py [TASKS]            (needs dask.distributed)
python benchmarks/speed/cluster.py --speed-up [N]     the paper's method on N random trials: processes, and workers
"""

from __future__ import annotations

import pickle
import sys
import time

import numpy as np
from distributed import LocalCluster
from joblib import Parallel, delayed

from mocobot.cluster import workers_of
from mocobot_sim.paper.experiment import PaperPlan, run_paper
from mocobot_sim.trial.sensors import PRESETS
from mocobot_sim.trial.simulate import TrialRequest, simulate


def echo(values: np.ndarray) -> np.ndarray:
    """Nothing is done."""
    return values


def seconds_per_task(tasks: int, values: np.ndarray) -> float:
    """Wall time of a task that returns what it is given, a new array each time [s], on one worker."""
    with Parallel(n_jobs=-1, return_as="generator_unordered") as pool:
        list(pool(delayed(echo)(values.copy()) for _ in range(4)))
        start = time.perf_counter()
        list(pool(delayed(echo)(values.copy()) for _ in range(tasks)))
        return (time.perf_counter() - start) / tasks


def speed_up(trials: int = 12) -> None:
    """Print the wall times of one experiment in one and two processes, and on one and two workers."""
    plan = PaperPlan(payloads=("b",), trials=trials, staged_only=True)
    warm = PaperPlan(payloads=("b",), presets=("ideal",), trials=2, vias=2, duration_s=5.0, staged_only=True)
    alone = 0.0

    def timed(what: str, jobs: int, *, remote: bool) -> None:
        nonlocal alone
        run_paper(warm, jobs, remote=remote)  # libraries and machine code are loaded
        start, work = time.perf_counter(), time.process_time()
        run_paper(plan, jobs, remote=remote)
        wall = time.perf_counter() - start
        alone = alone or wall
        here = time.process_time() - work
        print(
            f"{what}: {wall:.1f} s, {alone / wall:.2f} times as fast; {here:.1f} s of CPU in the command",
            flush=True,
        )

    for jobs in (1, 2):
        timed(f"{jobs} process{'es' * (jobs > 1)}", jobs, remote=False)
    for workers in (1, 2):
        with (
            LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None
            ) as cluster,
            workers_of(cluster.scheduler_address),
        ):
            timed(f"{workers} worker{'s' * (workers > 1)}", 1, remote=True)


def main(tasks: int = 100) -> None:
    """Print them beside what the work of a trial takes."""
    start = time.process_time()
    done = simulate(TrialRequest("b", "random"), [PRESETS["nominal"]])
    work = time.process_time() - start
    outcome = pickle.dumps(done.recordings, protocol=pickle.HIGHEST_PROTOCOL)
    print(
        f"a trial of {done.log.time[-1]:.0f} s: {work:.1f} s of CPU, {len(outcome) / 1e6:.2f} MB to send back"
    )
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        workers_of(cluster.scheduler_address),
    ):
        for what, values in (
            ("nothing", np.zeros(1)),
            ("as much as a trial", np.frombuffer(outcome, np.uint8).copy()),
        ):
            print(f"a task that returns {what}: {1e3 * seconds_per_task(tasks, values):.1f} ms")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--speed-up"]:
        speed_up(*map(int, sys.argv[2:]))
    else:
        main(*map(int, sys.argv[1:]))

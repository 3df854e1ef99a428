"""Run many hidden sets: resumable, in parallel."""

from __future__ import annotations

import hashlib
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed, parallel_config
from tqdm import tqdm

import discrepancy
from discrepancy.engine.diagnose import When
from hidden.parts import Task
from hidden.score import score
from hidden.store import append_result, read_results, recordings_of
from hidden.verdict import Loop, verdict_on
from mocobot_sim.errors import TrialError


def run_tasks(
    tasks: Sequence[Task],
    folder: Path,
    jobs: int,
    *,
    again: bool = False,
    closed_loop: Loop = "always",
    laws: When = "auto",
) -> None:
    """Run what is not finished yet, and append each result as soon as it is there.

    Args:
        tasks: what to run.
        folder: recordings and results.
        jobs: processes.
        again: also repeat what was not found right.
        closed_loop, laws: as in ``verdict_on``.
    """
    path = folder / "results.jsonl"
    path.parent.mkdir(parents=True, exist_ok=True)
    finished = {(r["part"], r["key"]) for r in read_results(path) if not (again and failed(r))}
    todo = [task for task in tasks if (task.part, task.request.key) not in finished]
    with parallel_config("loky", inner_max_num_threads=1):
        run = Parallel(jobs, return_as="generator_unordered")
        done: Any = run(delayed(run_task)(task, folder, closed_loop, laws) for task in todo)
        for result in tqdm(done, total=len(todo), unit="set", dynamic_ncols=True):
            append_result(path, result)


def run_task(task: Task, folder: Path, closed_loop: Loop = "always", laws: When = "auto") -> dict[str, Any]:
    """Simulate and diagnose one set; the truth is opened after the verdict."""
    result = {"part": task.part, "key": task.request.key, "engine": engine(), "error": None}
    try:
        recordings, sealed = recordings_of(task.request, folder / "sets")
        verdict = verdict_on(recordings, task.excluded, closed_loop, laws)
        return result | {"verdict": verdict, "truth": sealed.open(verdict)}
    except TrialError as error:
        return result | {"error": f"not simulated: {error}"}
    except Exception:  # one broken set must not end the campaign
        return result | {"error": traceback.format_exc()}


def failed(result: dict[str, Any]) -> bool:
    """Whether something hidden was not found right, or something named that is not there."""
    if result["error"]:
        return True
    if result["part"] == "leave-one-out":
        return False
    scores, extras = score(result["verdict"], result["truth"])
    return bool(extras) or not all((s.member or s.ambiguous) and s.place for s in scores)


def engine() -> str:
    """Which version of the diagnosis' code this is."""
    digest = hashlib.sha256()
    for path in sorted(Path(discrepancy.__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:10]

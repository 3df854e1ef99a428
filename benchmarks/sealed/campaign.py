"""Run many sets, each in a process of its own: resumable, and a broken one ends alone."""

from __future__ import annotations

import os
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mocobot_sim.errors import TrialError
from sealed import store
from sealed.law_score import score_laws
from sealed.sets import SealedSet
from sealed.verdict import engine, verdict_on


def simulate_all(requests: Sequence[SealedSet], out: Path, jobs: int) -> None:
    """Simulate what is not there yet; what cannot be simulated is listed in ``not_simulated.jsonl``."""
    failed = {line["key"] for line in store.read(out / "not_simulated.jsonl")}
    todo = [r for r in requests if r.key not in failed and not store.is_simulated(r, out)]
    apart(todo, lambda request: _simulate(request, out), jobs)


def _simulate(request: SealedSet, out: Path) -> None:
    start = time.process_time()
    try:
        store.simulate(request, out)
        said = f"{time.process_time() - start:.1f} s of CPU"
    except Exception as error:  # one that cannot be simulated must not end the campaign
        cause = str(error) if isinstance(error, TrialError) else traceback.format_exc()
        store.append(out / "not_simulated.jsonl", {"key": request.key, "error": cause})
        said = f"not simulated: {error}"
    print(f"{request.key}: {said}", flush=True)


def diagnose_all(
    requests: Sequence[SealedSet], out: Path, label: str, jobs: int, *, closed_loop: bool, keep: bool
) -> None:
    """Diagnose what was simulated and has no result of this label yet."""
    path = out / f"{label}.jsonl"
    finished = {line["key"] for line in store.read(path)}
    todo = [r for r in requests if r.key not in finished and store.is_simulated(r, out)]
    apart(todo, lambda request: _diagnose(request, out, path, closed_loop=closed_loop, keep=keep), jobs)


def simulate_and_diagnose(
    requests: Sequence[SealedSet], out: Path, label: str, jobs: int, *, closed_loop: bool, keep: bool
) -> None:
    """Set by set, so that a campaign that is cut short has verdicts on what it simulated."""
    path = out / f"{label}.jsonl"
    failed = {line["key"] for line in store.read(out / "not_simulated.jsonl")}
    finished = {line["key"] for line in store.read(path)}

    def work(request: SealedSet) -> None:
        if not store.is_simulated(request, out):
            # In a process of its own: its memory is none of the diagnosis'.
            apart([request], lambda one: _simulate(one, out), 1)
        if store.is_simulated(request, out):
            _diagnose(request, out, path, closed_loop=closed_loop, keep=keep)

    apart([r for r in requests if r.key not in failed | finished], work, jobs)


def _diagnose(request: SealedSet, out: Path, path: Path, *, closed_loop: bool, keep: bool) -> None:
    result: dict[str, Any] = {"key": request.key, "set": request.to_dict(), "engine": engine(), "error": None}
    excluded = request.names if request.kind == "left-out" else ()
    try:
        result["verdict"] = verdict_on(store.recordings_of(request, out), excluded, closed_loop=closed_loop)
        said = result["verdict"]["verdict"] + f", {result['verdict']['cpu_s']:.1f} s of CPU"
    except Exception:
        result["error"] = traceback.format_exc()
        said = result["error"].splitlines()[-1]
    result["truth"] = store.truth_of(request, out)  # opened after the verdict
    if request.kind in ("unlisted", "outside", "unlisted-pairs") and not result["error"]:
        scores = score_laws(result, store.recordings_of(request, out))
        result["law_scores"] = [asdict(one) for one in scores]
    store.append(path, result)
    if not keep:
        store.forget(request, out)
    print(f"{request.key}: {said}", flush=True)


def apart(requests: Sequence[SealedSet], work: Callable[[SealedSet], None], jobs: int) -> None:
    """Do the work for each in a forked process of its own, a number of them at a time."""
    running: set[int] = set()
    try:
        for request in requests:
            while len(running) >= jobs:
                running.discard(os.wait()[0])
            sys.stdout.flush()
            child = os.fork()
            if not child:
                code = 1
                try:
                    work(request)
                    code = 0
                finally:
                    sys.stdout.flush()
                    os._exit(code)
            running.add(child)
    finally:
        for child in running:
            os.waitpid(child, 0)

"""Run many sets, each in a process of its own: resumable, and one that breaks or takes too long ends alone."""

from __future__ import annotations

import hashlib
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import discrepancy
import mocobot
from mocobot_sim.errors import TrialError
from sealed import sets
from sealed.score import score_laws
from sealed.sets import SealedSet

T = TypeVar("T")
LEFT_AWAY = {"evidence", "undecidable", "detection_limits", "provenance"}
"""Keys of a verdict that no score reads."""


@dataclass(frozen=True)
class How:
    """How sets are diagnosed.

    Attributes:
        out: folder of the campaign.
        label: name of the results.
        jobs: processes.
        cpu_s: CPU time after which a diagnosis is given up [s].
        closed_loop: run the recorded commands again.
        keep: keep the recordings of diagnosed sets.
    """

    out: Path
    label: str = "results"
    jobs: int = 1
    cpu_s: int = 600
    closed_loop: bool = True
    keep: bool = True

    @property
    def path(self) -> Path:
        """Results, a JSON line each."""
        return self.out / f"{self.label}.jsonl"


def simulate_all(requests: Sequence[SealedSet], how: How) -> None:
    """Simulate what is not there yet; what cannot be simulated is listed in ``not_simulated.jsonl``."""
    failed = {line["key"] for line in sets.read(how.out / "not_simulated.jsonl")}
    todo = [r for r in requests if r.key not in failed and not sets.is_simulated(r, how.out)]
    apart(todo, lambda request: _simulate(request, how.out), how.jobs)


def diagnose_all(requests: Sequence[SealedSet], how: How) -> None:
    """Diagnose what was simulated and has no result of this label yet."""
    finished = {line["key"] for line in sets.read(how.path)}
    todo = [r for r in requests if r.key not in finished and sets.is_simulated(r, how.out)]
    apart(todo, lambda request: _diagnose(request, how), how.jobs)


def simulate_and_diagnose(requests: Sequence[SealedSet], how: How) -> None:
    """Set by set, so that a campaign that is cut short has verdicts on what it simulated."""
    each = replace(how, jobs=1)

    def work(request: SealedSet) -> None:
        simulate_all([request], each)  # in a process of its own: its memory is none of the diagnosis'
        diagnose_all([request], each)

    apart(requests, work, how.jobs)


def _simulate(request: SealedSet, out: Path) -> None:
    start = time.process_time()
    try:
        sets.simulate(request, out)
        said = f"{time.process_time() - start:.1f} s of CPU"
    except Exception as error:  # one that cannot be simulated must not end the campaign
        cause = str(error) if isinstance(error, TrialError) else traceback.format_exc()
        sets.append(out / "not_simulated.jsonl", {"key": request.key, "error": cause})
        said = f"not simulated: {error}"
    print(f"{request.key}: {said}", flush=True)


def _diagnose(request: SealedSet, how: How) -> None:
    result: dict[str, Any] = {"key": request.key, "set": request.to_dict(), "engine": engine(), "error": None}
    excluded = request.names if request.kind == "left-out" else ()
    _stop_after(how.cpu_s)
    try:
        result["verdict"] = verdict_on(
            sets.recordings_of(request, how.out), excluded, closed_loop=how.closed_loop
        )
        said = result["verdict"]["verdict"]
    except Exception:
        result["error"] = traceback.format_exc()
        said = result["error"].splitlines()[-1]
    result |= costs()
    result["truth"] = sets.truth_of(request, how.out)  # opened after the verdict
    if not result["error"]:
        scores = score_laws(result, sets.recordings_of(request, how.out))
        result["law_scores"] = [asdict(one) for one in scores]
    sets.append(how.path, result)
    if not how.keep:
        sets.forget(request, how.out)
    print(f"{result['key']}: {said}, {result['cpu_s']:.1f} s of CPU", flush=True)


def verdict_on(
    trials: Sequence[Path], excluded: Sequence[str] = (), *, closed_loop: bool = True
) -> dict[str, Any]:
    """What the diagnosis says, through its public face."""
    values = mocobot.diagnose(trials, exclude=excluded, closed_loop=closed_loop).to_dict()
    return {key: value for key, value in values.items() if key not in LEFT_AWAY}


def costs() -> dict[str, float]:
    """CPU time [s] and peak memory [GB] of this process so far."""
    own, others = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    cpu = own.ru_utime + own.ru_stime + others.ru_utime + others.ru_stime
    return {"cpu_s": cpu, "peak_gb": own.ru_maxrss * (1.0 if sys.platform == "darwin" else 1024.0) / 1e9}


def engine() -> str:
    """Which version of the diagnosis' code this is."""
    digest = hashlib.sha256()
    for path in sorted(Path(discrepancy.__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:10]


def _stop_after(cpu_s: int) -> None:
    """Raise TimeoutError in this process once it has had so much CPU time."""

    def stop(*_: object) -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (resource.RLIM_INFINITY,) * 2)
        raise TimeoutError(f"more than {cpu_s} s of CPU")

    signal.signal(signal.SIGXCPU, stop)
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, resource.RLIM_INFINITY))


def apart(requests: Sequence[T], work: Callable[[T], None], jobs: int) -> None:
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

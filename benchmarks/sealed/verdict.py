"""The verdict of the product on a set, as plain data, and what it cost."""

from __future__ import annotations

import hashlib
import resource
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import discrepancy
import mocobot
from sealed.law_score import stated_series


def verdict_on(
    trials: Sequence[Path], excluded: Sequence[str] = (), *, closed_loop: bool = True
) -> dict[str, Any]:
    """What the diagnosis says, through its public face, with the CPU time and the peak memory of this process."""
    before = _cpu_s()
    diagnosis = mocobot.diagnose(trials, exclude=excluded, closed_loop=closed_loop)
    values = diagnosis.to_dict() | {"law_series": stated_series(diagnosis)}
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    left = {"evidence", "undecidable", "detection_limits", "provenance"}
    return {key: value for key, value in values.items() if key not in left} | {
        "cpu_s": _cpu_s() - before,
        "peak_gb": memory * (1.0 if sys.platform == "darwin" else 1024.0) / 1e9,
    }


def _cpu_s() -> float:
    own, others = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + others.ru_utime + others.ru_stime


def engine() -> str:
    """Which version of the diagnosis' code this is."""
    digest = hashlib.sha256()
    for path in sorted(Path(discrepancy.__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:10]

"""Measure the table in ``hidden.limits``."""

from __future__ import annotations

from typing import Any

import numpy as np
from joblib import Parallel, delayed

from discrepancy.problem import Problem
from discrepancy.team.pushes import push
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import DEFAULTS, read_tolerances
from estimator.estimate import estimate_payload
from hidden.generator import PAYLOADS, HiddenSet, generate
from hidden.limits import GAIN, PUSH_S


def measure_limits(jobs: int) -> dict[str, dict[str, float]]:
    """Median over places and payloads of every parameter's detection limit, by cause."""
    found: dict[str, list[list[float]]] = {}
    names: dict[str, tuple[str, ...]] = {}
    runs: Any = Parallel(jobs)(delayed(_limits)(payload) for payload in PAYLOADS)
    for limits in runs:
        for cause, parameters, values in limits:
            names[cause] = parameters
            found.setdefault(cause, []).append(values)
    table = {}
    for cause, values in found.items():
        medians = np.median(values, axis=0)
        table[cause] = {name: float(f"{m:.2g}") for name, m in zip(names[cause], medians, strict=True)}
    return table


def _limits(payload: str) -> list[tuple[str, tuple[str, ...], list[float]]]:
    recordings, _ = generate(HiddenSet("clean", 0, payload=payload))
    rig = TeamRig.of(recordings, estimate_payload(recordings), read_tolerances(None))
    candidates = rig.candidates()
    candidates += [
        push(trial, start, PUSH_S, DEFAULTS["push"])
        for trial in range(3)
        for start in np.arange(5.0, 35.0, 5.0)
    ]
    fit = Problem.of(rig.rows(candidates), candidates).fit()
    return [
        (candidate.cause, tuple(p.name for p in candidate.parameters), values.tolist())
        for candidate, values in zip(candidates, fit.limits(GAIN), strict=True)
    ]

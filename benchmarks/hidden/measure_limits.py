"""Measure the tables in ``hidden.limits``."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from joblib import Parallel, delayed

from discrepancy.candidate import Transient
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.team.causes import CAUSES
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import default_tolerances, read_tolerances
from estimator.estimate.payload import estimate_payload
from hidden.generator import PAYLOADS, HiddenSet, generate
from hidden.limits import PENDULUM_LENGTHS_M
from hidden.sizes import sizes_of
from mocobot.campaign.limits import GAIN, PUSH_S


def measure_limits(jobs: int) -> tuple[dict[str, dict[str, float]], dict[float, float]]:
    """Median over places and payloads of every parameter's detection limit, by cause; a pendulum's [kg] by length."""
    found: dict[str, list[list[float]]] = {}
    names: dict[str, tuple[str, ...]] = {}
    runs: Any = Parallel(jobs)(delayed(_limits)(payload) for payload in PAYLOADS)
    for limits, _ in runs:
        for cause, parameters, values in limits:
            names[cause] = parameters
            found.setdefault(cause, []).append(values)
    table = {}
    for cause, values in found.items():
        medians = np.median(values, axis=0)
        table[cause] = {name: float(f"{m:.2g}") for name, m in zip(names[cause], medians, strict=True)}
    masses = np.median([by_length for _, by_length in runs], axis=0)
    return table, {length: float(f"{m:.2g}") for length, m in zip(PENDULUM_LENGTHS_M, masses, strict=True)}


def _limits(payload: str) -> tuple[list[tuple[str, tuple[str, ...], list[float]]], list[float]]:
    recordings, _ = generate(HiddenSet("clean", 0, payload=payload))
    rig = TeamRig.of(recordings, estimate_payload(recordings), read_tolerances(None))
    candidates = rig.candidates()
    tolerance = default_tolerances()["push"]
    candidates += [
        CAUSES["push"].event(tolerance, Transient(trial, start, PUSH_S))
        for trial in range(3)
        for start in np.arange(5.0, 35.0, 5.0)
    ]
    problem = Problem.of(rig.rows(candidates), candidates)
    limits = [
        (candidate.cause, tuple(p.name for p in candidate.parameters), values.tolist())
        for candidate, values in zip(candidates, sizes_of(Fit.of(problem), GAIN), strict=True)
    ]
    return limits, _pendulum(rig, problem)


def _pendulum(rig: TeamRig, problem: Problem) -> list[float]:
    index = next(k for k, candidate in enumerate(problem.candidates) if candidate.cause == "slosh")
    masses = []
    for length in PENDULUM_LENGTHS_M:
        shape = {"length_m": length, "damping_ratio": 0.05}
        candidate = replace(problem.candidates[index], shape=shape)
        other = problem.with_columns(index, candidate, rig.columns(candidate))
        masses.append(float(sizes_of(Fit.of(other), GAIN)[index][0]))
    return masses

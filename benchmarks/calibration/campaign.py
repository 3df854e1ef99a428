"""Calibrate many simulated teams and score them: resumable, in parallel."""

from __future__ import annotations

import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed, parallel_config
from tqdm import tqdm

from calibration.score import of_estimate, score, score_calibration
from calibration.teams import TILT_RAD, Team
from calibration.truth import Truth
from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.calibration import Calibration, Prior
from estimator.estimate.payload import estimate_payload
from estimator.recording.model import Recording
from mocobot_sim.errors import TrialError
from sealed import store

HELD = Prior(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
ARM_MASS_RATIO = 0.05
WEIGHED = 1e-4
"""Relative standard error of a known weight."""

PRIORS = {
    "calibrated": Prior(),
    "narrow": Prior().scaled(1.0 / 3.0),
    "wide": Prior().scaled(3.0),
    "masses": Prior(arm_mass_ratio=ARM_MASS_RATIO),
    "tilted": Prior(tilt_rad=TILT_RAD),
    "held": HELD,
}


@dataclass(frozen=True)
class Task:
    """One calibration or estimate of one team.

    Attributes:
        method: "staged", "joint", a key of ``PRIORS``, "weighed" (this payload's weight is known, another's is asked
            for), "weighed masses" (and the arms' masses are not known), "free" (a recording of unloaded arms decides
            these) or "transfer" (robots from payload (a)).
        team: the team.
    """

    method: str
    team: Team


def tasks(part: str, seeds: Sequence[int], payloads: Sequence[str], robots: Sequence[int]) -> list[Task]:
    """What one part of the campaign consists of.

    Args:
        part: "main", "prior", "weighed", "transfer", "masses", "tilt", "robots" or "nominal".
        seeds: of the teams.
        payloads: what they carry.
        robots: sizes of teams in part "robots".
    """
    teams = [Team(seed, payload) for seed in seeds for payload in payloads]
    if part == "robots":
        teams = [Team(seed, f"plate{N}") for seed in seeds for N in robots]
    change: dict[str, Any] = {
        "nominal": {"preset": "nominal"},
        "masses": {"arm_mass_ratio": ARM_MASS_RATIO},
        "tilt": {"tilted": True},
    }.get(part, {})
    methods = {
        "main": ("staged", "joint", "calibrated"),
        "prior": ("narrow", "wide"),
        "weighed": ("weighed",),
        "transfer": ("transfer",),
        "masses": ("masses", "free", "weighed masses"),
        "tilt": ("tilted",),
        "robots": ("staged", "calibrated"),
        "nominal": ("staged", "joint", "held", "calibrated"),
    }[part]
    listed = [Task(method, replace(team, **change)) for team in teams for method in methods]
    return [task for task in listed if task.method != "transfer" or task.team.payload != "a"]


def run_tasks(listed: Sequence[Task], folder: Path, jobs: int) -> None:
    """Run what is not finished yet, and append each result as soon as it is there."""
    path = folder / "results.jsonl"
    folder.mkdir(parents=True, exist_ok=True)
    finished = {(r["part"], r["key"]) for r in store.read(path) if not r["error"]}
    todo = [task for task in listed if (task.method, task.team.key) not in finished]
    # All of one team in one process: recordings are simulated once.
    by_team: dict[Team, list[Task]] = {}
    for task in todo:
        by_team.setdefault(task.team, []).append(task)
    with parallel_config("loky", inner_max_num_threads=1):
        run = Parallel(jobs, return_as="generator_unordered")
        done: Any = run(delayed(_run_team)(group, folder) for group in by_team.values())
        for results in tqdm(done, total=len(by_team), unit="team", dynamic_ncols=True):
            for result in results:
                store.append(path, result)


def _run_team(group: Sequence[Task], folder: Path) -> list[dict[str, Any]]:
    return [run_task(task, folder) for task in group]


def run_task(task: Task, folder: Path) -> dict[str, Any]:
    """One result, as a line of ``results.jsonl``."""
    result = {"part": task.method, "key": task.team.key, "error": None}
    try:
        return result | _outcome(task, folder / "sets")
    except TrialError as error:
        return result | {"error": f"not simulated: {error}"}
    except Exception:  # one broken team must not end the campaign
        return result | {"error": traceback.format_exc()}


def _outcome(task: Task, folder: Path) -> dict[str, Any]:
    recordings, told = task.team.recordings(folder)
    truth = Truth.of(told)
    if task.method in ("staged", "joint"):
        start = time.process_time()
        found = of_estimate(estimate_payload(recordings, task.method, withhold=False))
        took = time.process_time() - start
        if found is None:
            return {"error": "not determined"}
        built = score(found, Truth.of(told, encoder_frames=False), truth.scale)
        return score(found, truth, truth.scale) | {
            "cpu_s": took,
            "as_built": {key: built[key] for key in ("R_deg", "p_mm", "com_mm")},
        }
    if task.method == "transfer":
        return _transfer(task, folder, recordings, truth)
    if task.method.startswith("weighed"):
        return _weighed(task, folder, recordings, truth)
    free, prior = [], PRIORS.get(task.method)
    if task.method == "free":
        (free, _), prior = task.team.recordings(folder, free=True), PRIORS["masses"]
    start = time.process_time()
    calibration = calibrate(recordings, free=free, prior=prior)
    took = time.process_time() - start
    return score_calibration(calibration, 0, truth) | _fit(calibration) | {"cpu_s": took}


def _transfer(task: Task, folder: Path, recordings: list[Recording], truth: Truth) -> dict[str, Any]:
    calibration = calibrate(replace(task.team, payload="a").recordings(folder)[0])
    start = time.process_time()
    found = calibrate(recordings, robots=calibration)
    took = time.process_time() - start
    return score_calibration(found, 0, truth) | {"cpu_s": took}


def _weighed(task: Task, folder: Path, recordings: list[Recording], truth: Truth) -> dict[str, Any]:
    """This team's payload is weighed; a second one's mass is asked for."""
    other = replace(task.team, payload="bcda"["abcd".index(task.team.payload)])
    more, told = other.recordings(folder)
    known = {task.team.payload: (truth.mass, WEIGHED * truth.mass)}
    prior = PRIORS["masses"] if task.team.arm_mass_ratio else None
    start = time.process_time()
    calibration = calibrate([*recordings, *more], prior=prior, known_mass=known)
    took = time.process_time() - start
    second = score_calibration(calibration, 1, Truth.of(told))
    return score_calibration(calibration, 0, truth) | _fit(calibration) | {"cpu_s": took, "second": second}


def _fit(calibration: Calibration) -> dict[str, Any]:
    return {
        "steps": calibration.steps,
        "trials": [
            {"kind": one.kind, "before": one.before, "after": one.after, "held_out": one.held_out}
            for one in calibration.trials
        ],
    }

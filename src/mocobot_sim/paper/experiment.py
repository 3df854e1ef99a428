"""Simulate the paper's trials, estimate from the recordings, score against Table I.

Order as in the paper (section IV.C): random trials first; the grasps estimated from them construct the periodic
motion and the static orientations; then everything is estimated.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from estimator.errors import InputError
from estimator.estimate.grasps import estimate_grasps
from estimator.estimate.payload import estimate_payload
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording
from estimator.signals.process import process_recording
from mocobot_sim.paper.published import payload_truth
from mocobot_sim.paper.scoring import score
from mocobot_sim.scene.models import payload_path
from mocobot_sim.trial.sensors import PRESETS, SensorPreset, sensor_preset
from mocobot_sim.trial.simulate import TrialRequest, simulate

Progress = Callable[[int], object]
# Positions p_1i and orientations R_1i between processes: arrays keep their bits there, a RigidTransform is normalised.
Grasps = tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True)
class PaperPlan:
    """What to run.

    Attributes:
        payloads: names of shipped payloads.
        presets: names of sensor presets.
        trials: random trials per payload; half as many (at least one) are periodic, as in the paper's 6 and 3,
            and as many random ones serve the inertia.
        seed: seed of everything random.
        vias: vias of a random trial.
        duration_s: length of a periodic trial's motion [s].

    Raises:
        InputError: an unknown payload or preset, or a number out of range.
    """

    payloads: tuple[str, ...] = ("a", "b", "c", "d")
    presets: tuple[str, ...] = ("ideal", "nominal", "uncalibrated")
    trials: int = 6
    seed: int = 0
    vias: int = 80
    duration_s: float = 60.0

    def __post_init__(self) -> None:
        """Check before hours are spent."""
        for payload in self.payloads:
            payload_path(payload)
        for preset in self.presets:
            sensor_preset(preset)
        for name, values in (("payload", self.payloads), ("preset", self.presets)):
            if not values:
                raise InputError(f"no {name} given; name at least one")
            if len(set(values)) != len(values):
                raise InputError(f"{name} is {' '.join(values)!r}; give each once")
        for name, value, least in (("seed", self.seed, 0), ("trials", self.trials, 1)):
            if value < least:
                raise InputError(f"{name} is {value}; it must be at least {least}")

    @property
    def inertia_trials(self) -> int:
        """Periodic trials, and random trials that serve the inertia."""
        return max(1, self.trials // 2)

    @property
    def steps(self) -> int:
        """Units of progress: simulated trials and estimates."""
        teams = len(self.teams()) * len(self.payloads)
        return teams * (self.trials + self.inertia_trials + 2) + len(self.presets) * len(self.payloads)

    def teams(self) -> list[list[SensorPreset]]:
        """Presets that share their robots, and so their trials; the least ideal last, however they were asked for."""
        groups: dict[Any, list[SensorPreset]] = {}
        for name in sorted(self.presets, key=list(PRESETS).index):
            groups.setdefault(sensor_preset(name).spread, []).append(sensor_preset(name))
        return list(groups.values())


@dataclass(frozen=True)
class TrialSummary:
    """Extremes of one trial: payload rotation [deg], SEA torque [N m], rod and weld errors [m], weld angle [deg]."""

    name: str
    rotation_deg: float
    torque_Nm: float
    rod_error_m: float
    weld_error_m: float
    weld_error_deg: float


@dataclass
class PaperResult:
    """What came out, by preset and payload.

    Attributes:
        scores: errors against Table I; the content of ``paper.json``.
        estimates: the estimates.
        recordings: the recordings they came from.
        trials: a summary of every simulated trial.
    """

    scores: dict[str, dict[str, dict[str, Any]]] = field(default_factory=dict)
    estimates: dict[str, dict[str, PayloadEstimate]] = field(default_factory=dict)
    recordings: dict[str, dict[str, list[Recording]]] = field(default_factory=dict)
    trials: list[TrialSummary] = field(default_factory=list)


def run_paper(plan: PaperPlan, jobs: int = 1, progress: Progress | None = None) -> PaperResult:
    """Run the whole experiment.

    Args:
        plan: what to run.
        jobs: parallel processes; the result does not depend on them.
        progress: called with the number of steps (of ``plan.steps``) done since the last call.

    Raises:
        TrialError: the physics of a trial cannot be trusted.
    """
    progress = progress or (lambda _: None)
    result = PaperResult()
    teams = list(product(plan.payloads, plan.teams()))
    with Parallel(n_jobs=jobs, return_as="generator") as pool:

        def each(function: Callable[..., Any], tasks: Iterable[tuple[Any, ...]]) -> Iterable[Any]:
            for outcome in pool(delayed(function)(*task) for task in tasks):
                progress(1)
                yield outcome

        first = [
            (_request(plan, payload, "random", k), team, None)
            for payload, team in teams
            for k in range(plan.trials)
        ]
        recordings = _collect(first, each(_trial, first), result)

        # Grasps from the random trials, read through the team's last (least ideal) preset.
        grasps = list(each(_grasps, [(recordings[payload, team[-1].name],) for payload, team in teams]))
        second = [
            (_request(plan, payload, trial, k), team, held)
            for (payload, team), held in zip(teams, grasps, strict=True)
            for trial, count in (("static", 1), ("periodic", plan.inertia_trials))
            for k in range(count)
        ]
        for key, more in _collect(second, each(_trial, second), result).items():
            recordings[key] = recordings[key] + more

        sets = [(payload, preset) for preset in plan.presets for payload in plan.payloads]
        estimates = each(estimate_payload, [(recordings[key], "staged") for key in sets])
        for (payload, preset), estimate in zip(sets, estimates, strict=True):
            result.estimates.setdefault(preset, {})[payload] = estimate
            result.recordings.setdefault(preset, {})[payload] = recordings[payload, preset]
            result.scores.setdefault(preset, {})[payload] = score(estimate, payload_truth(payload))
    return result


def _request(plan: PaperPlan, payload: str, trial: str, number: int) -> TrialRequest:
    return TrialRequest(payload, trial, plan.seed, number, plan.vias, plan.duration_s)


def _trial(
    request: TrialRequest, team: Sequence[SensorPreset], grasps: Grasps | None
) -> tuple[dict[str, Recording], TrialSummary]:
    X_1i = grasps and RigidTransform.from_components(grasps[0], Rotation.from_matrix(grasps[1]))
    done = simulate(request, team, X_1i)
    summary = TrialSummary(
        name=f"{request.payload} {request.trial} {request.number} {team[-1].name}",
        rotation_deg=float(np.rad2deg(np.linalg.norm(done.log.payload_rotation(), axis=1).max())),
        torque_Nm=float(np.abs(done.log.tau).max()),
        rod_error_m=done.log.rod_error_m,
        weld_error_m=done.log.weld_error_m,
        weld_error_deg=float(np.rad2deg(done.log.weld_error_rad)),
    )
    return done.recordings, summary


def _collect(
    tasks: Sequence[tuple[TrialRequest, Sequence[SensorPreset], Grasps | None]],
    outcomes: Iterable[tuple[dict[str, Recording], TrialSummary]],
    result: PaperResult,
) -> dict[tuple[str, str], list[Recording]]:
    """Recordings by (payload, preset), in the order of the tasks."""
    recordings: dict[tuple[str, str], list[Recording]] = {}
    for (request, _, _), (measured, summary) in zip(tasks, outcomes, strict=True):
        result.trials.append(summary)
        for preset, recording in measured.items():
            recordings.setdefault((request.payload, preset), []).append(recording)
    return recordings


def _grasps(recordings: Sequence[Recording]) -> Grasps:
    estimate, steps = estimate_grasps([process_recording(recording) for recording in recordings])
    if estimate is None:
        weak = [str(direction) for step in steps for direction in step.weak]
        raise InputError(f"the random trials do not determine the grasps: {weak[0]}")
    return estimate.p_1i, estimate.R_1i

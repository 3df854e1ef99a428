"""Simulate the paper's trials, estimate from the recordings, score against Table I.

The order is that of the paper (section IV.C). Random trials come first. The grasps estimated from them define the
periodic motion and the static orientations. Then all parameters are estimated twice: in stages as in the paper, and in
one joint fit.

The joint fit is one least-squares problem per payload, with residuals of loop closure and wrench balance over three
trials. Robots without deviations are held at the design. Robots with deviations are calibrated on the same recordings,
or held at the calibration from another payload's recordings.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np
from joblib import Parallel
from scipy.spatial.transform import RigidTransform, Rotation

from estimator.arrays import Array
from estimator.calibrate.calibrate import calibrate, start_estimate
from estimator.calibrate.calibration import Calibration
from estimator.calibrate.prior import Prior
from estimator.errors import InputError
from estimator.estimate.grasps import estimate_grasps
from estimator.estimate.payload import estimate_from_trials, trial_of, within_arithmetic
from estimator.estimate.result import PayloadEstimate
from estimator.files import ends_with_this
from estimator.recording.model import Recording
from estimator.signals import process_recording
from mocobot_sim.effects import EFFECTS, Effect, make_effect
from mocobot_sim.effects.base import JOINTS
from mocobot_sim.paper.measured import simulated
from mocobot_sim.paper.scoring import PAYLOADS, TrialSummary, payload_truth, score, score_fit
from mocobot_sim.paper.store import Progress, Store, Work
from mocobot_sim.scene.models import payload_path
from mocobot_sim.trial.sensors import PRESETS, SensorPreset, sensor_preset
from mocobot_sim.trial.simulate import TrialRequest, draw_units, simulate

ONE_FIT = "nominal, one fit"
SELF_CALIBRATED = "uncalibrated, self-calibrated"
TRANSFER = "uncalibrated, transfer"
ROBOTS, KINDS = 3, ("random", "static", "periodic")
COLUMNS = {"nominal": (ONE_FIT,), "uncalibrated": (SELF_CALIBRATED, TRANSFER)}
"""Columns with results of joint fits, by preset."""
SCATTERED = "scattered"
"""Preset of this experiment alone: the uncalibrated robots with the effects of ``simulated.toml``."""
NO_SPREAD = Prior().scaled(0.0)
"""Prior that holds all robots exactly at the design."""


def preset_named(name: str) -> SensorPreset:
    """Look up a preset by name, ``SCATTERED`` included.

    Raises:
        InputError: there is no such preset.
    """
    return replace(sensor_preset("uncalibrated"), name=name) if name == SCATTERED else sensor_preset(name)


def scattering(payload: str, trial: str, number: int) -> list[Effect]:
    """Effects of the preset ``SCATTERED`` in one trial: each on every robot and, if it has a joint, on every joint."""
    draw = 1 + PAYLOADS.index(payload) + len(PAYLOADS) * (KINDS.index(trial) + len(KINDS) * number)
    found = []
    for cause, parameters in simulated()["effects"].items():
        drawn = {"draw": draw} if "draw" in EFFECTS[cause].parameter_names() else {}
        joints = range(1, JOINTS + 1) if "joint" in EFFECTS[cause].place_names() else (None,)
        found += [
            make_effect(cause, {**parameters, **drawn}, robot, joint)
            for robot in range(1, ROBOTS + 1)
            for joint in joints
        ]
    return found


def three_trials(recordings: Sequence[Recording]) -> list[Recording]:
    """Select the first recording of each kind of trial: random, static and periodic.

    A fit of three recordings is not limited by noise, and more recordings would take minutes longer.
    """
    first: dict[str, Recording] = {}
    for recording in recordings:
        first.setdefault(recording.metadata.trial, recording)
    return list(first.values())


def estimate_both(
    recordings: Sequence[Recording], fitted: bool
) -> tuple[PayloadEstimate, PayloadEstimate | None]:
    """Make the staged estimate from one payload's recordings and, if ``fitted``, the initial estimate of a joint fit.

    All recordings must have the same preset. They are processed once for both estimates.

    Returns:
        The staged estimate, and the initial estimate for a fit of ``three_trials``; None without ``fitted``.

    Raises:
        InputError: nothing can be estimated from the recordings.
    """
    with within_arithmetic([recording.name for recording in recordings]):
        trials = [trial_of(recording) for recording in recordings]
        first = [recordings.index(one) for one in three_trials(recordings)]
        start = start_estimate([trials[k] for k in first]) if fitted else None
        return estimate_from_trials(trials, "staged"), start


def fit_trials(
    recordings: Sequence[Recording],
    preset: str,
    robots: Calibration | None = None,
    start: PayloadEstimate | None = None,
) -> Calibration:
    """Estimate a payload by one joint fit of its recordings.

    Robots of a calibrated preset are held at the design. Other robots are calibrated in the same fit, unless ``robots``
    is given.

    Args:
        recordings: recordings of one payload with one preset.
        preset: name of the preset.
        robots: calibration from another payload at which the robots are held; None for none.
        start: result of ``start_estimate`` for these recordings; None to compute it.

    Raises:
        InputError: the recordings do not determine the parameters.
    """
    as_designed = robots is None and sensor_preset(preset).calibrated
    starts = None if start is None else {recordings[0].metadata.payload: start}
    return calibrate(recordings, prior=NO_SPREAD if as_designed else None, robots=robots, starts=starts)


# Positions p_1i and orientations R_1i. Arrays pass between processes unchanged; a RigidTransform is normalised again.
Grasps = tuple[Array, Array]


@dataclass(frozen=True)
class PaperPlan:
    """Options of the experiment.

    Raises:
        InputError: a payload or preset is unknown or repeated, or a number is out of range.
    """

    payloads: tuple[str, ...] = ("a", "b", "c", "d")  # names of shipped payloads
    presets: tuple[str, ...] = ("ideal", "nominal", "uncalibrated", SCATTERED)  # names of sensor presets
    # random trials per payload; half as many trials (at least one) are periodic, as in the paper (6 and 3)
    trials: int = 6
    seed: int = 0  # seed of all random numbers
    vias: int = 80  # vias of a random trial
    duration_s: float = 60.0  # length of a periodic trial's motion [s]
    staged_only: bool = False  # whether to skip the joint fits

    def __post_init__(self) -> None:
        """Check the options."""
        for payload in self.payloads:
            payload_path(payload, rigid=True)
        for preset in self.presets:
            preset_named(preset)
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
        """Number of periodic trials, which is also the number of random trials used for the inertia."""
        return max(1, self.trials // 2)

    @property
    def steps(self) -> int:
        """Total number of tasks: simulated trials, estimates and fits."""
        teams = len(self.teams()) * len(self.payloads)
        estimates = len(self.presets) * len(self.payloads) + len(self.fits()) + len(self.transfers())
        return teams * (self.trials + self.inertia_trials + 2) + estimates

    def fits(self) -> list[tuple[str, str, str]]:
        """Column, preset and payload of every joint fit without a given calibration."""
        return [
            (COLUMNS[preset][0], preset, payload)
            for preset in self.presets
            if preset in COLUMNS and not self.staged_only
            for payload in self.payloads
        ]

    def transfers(self) -> list[tuple[str, str, str]]:
        """Column, preset and payload of every joint fit with the robots held at the first payload's calibration."""
        return [
            (TRANSFER, preset, payload)
            for column, preset, payload in self.fits()
            if column == SELF_CALIBRATED and payload != self.payloads[0]
        ]

    def teams(self) -> list[list[SensorPreset]]:
        """Groups of presets that share robots, effects and trials, each in the order of ``PRESETS`` (worst last)."""
        groups: dict[Any, list[SensorPreset]] = {}
        for name in sorted(self.presets, key=[*PRESETS, SCATTERED].index):
            preset = preset_named(name)
            groups.setdefault((preset.spread, name == SCATTERED), []).append(preset)
        return list(groups.values())


@dataclass
class PaperResult:
    """Results of the experiment."""

    # errors against Table I by preset or column of fits, then payload; the content of ``paper.json``. In the transfer
    # column the payload that calibrated the robots has None
    scores: dict[str, dict[str, dict[str, Any] | None]] = field(default_factory=dict)
    # staged estimates, by preset and payload
    estimates: dict[str, dict[str, PayloadEstimate]] = field(default_factory=dict)
    # joint fits, by column and payload
    fits: dict[str, dict[str, Calibration]] = field(default_factory=dict)
    # recordings, by preset and payload
    recordings: dict[str, dict[str, list[Recording]]] = field(default_factory=dict)
    trials: list[TrialSummary] = field(default_factory=list)  # summaries of all simulated trials


def run_paper(
    plan: PaperPlan,
    jobs: int = 1,
    progress: Progress | None = None,
    store: Store | None = None,
    *,
    remote: bool = False,
) -> PaperResult:
    """Run the whole experiment; the result does not depend on the number of processes.

    Args:
        plan: options.
        jobs: number of parallel processes.
        progress: called several times a second from another thread. Arguments: tasks done (fractions included), all
            tasks, name of the current stage.
        store: keeps the outcome of each finished task; stored outcomes are not computed again.
        remote: whether joblib's backend runs processes on other machines.

    Raises:
        InputError: the recordings do not determine an estimate.
        TrialError: the simulation of a trial failed a check.
    """
    result = PaperResult()
    teams = list(product(plan.payloads, plan.teams()))
    # Remote backends get all tasks at once, because workers may join later. The arguments of a task are one tuple;
    # joblib does not scatter it to a worker in advance, so a lost worker does not lose it.
    ahead = "all" if remote else "2 * n_jobs"
    with Parallel(
        n_jobs=jobs, return_as="generator_unordered", pre_dispatch=ahead, **ends_with_this()
    ) as pool:
        each = Work(pool, plan.steps, progress or _untold, store, remote=remote).each
        first = [
            (_request(plan, payload, "random", k), team, None)
            for payload, team in teams
            for k in range(plan.trials)
        ]
        recordings = _collect(first, each("random trials", _trial, first), result)

        # Estimate the grasps from the random trials with the team's last preset, which has the worst sensors.
        random = [(recordings[payload, team[-1].name],) for payload, team in teams]
        grasps = list(each("grasps", _grasps, random))
        second = [
            (_request(plan, payload, trial, k), team, held)
            for (payload, team), held in zip(teams, grasps, strict=True)
            for trial, count in (("static", 1), ("periodic", plan.inertia_trials))
            for k in range(count)
        ]
        for key, more in _collect(second, each("other trials", _trial, second), result).items():
            recordings[key] = recordings[key] + more

        sets = [(payload, preset) for preset in plan.presets for payload in plan.payloads]
        fits = {(payload, preset) for _, preset, payload in plan.fits()}
        tasks = [(recordings[key], key in fits) for key in sets]
        estimates = dict(zip(sets, each("estimates", _estimate, tasks), strict=True))
        for payload, preset in sets:
            result.estimates.setdefault(preset, {})[payload] = estimates[payload, preset][0]
            result.recordings.setdefault(preset, {})[payload] = recordings[payload, preset]

        for stage, tasks in (("calibrations", plan.fits()), ("transfer", plan.transfers())):
            if not tasks:
                continue
            fitted = [
                (
                    three_trials(recordings[payload, preset]),
                    preset,
                    result.fits[SELF_CALIBRATED][plan.payloads[0]] if column == TRANSFER else None,
                    estimates[payload, preset][1],
                )
                for column, preset, payload in tasks
            ]
            for (column, _, payload), found in zip(tasks, each(stage, _fit, fitted), strict=True):
                result.fits.setdefault(column, {})[payload] = found
    result.scores = _scores(plan, result)
    return result


def _untold(_done: float, _steps: float, _stage: str) -> None:
    """Default for ``progress``: do nothing."""


def _scores(plan: PaperPlan, result: PaperResult) -> dict[str, dict[str, dict[str, Any] | None]]:
    """Score all results, in the order of the presets, each followed by its joint fits."""
    scores: dict[str, dict[str, dict[str, Any] | None]] = {}
    for preset in plan.presets:
        units = {payload: draw_units(payload, preset_named(preset), plan.seed) for payload in plan.payloads}
        scores[preset] = {
            payload: score(estimate, payload_truth(payload), units[payload])
            for payload, estimate in result.estimates[preset].items()
        }
        for column in COLUMNS.get(preset, ()):
            if column in result.fits:
                found = result.fits[column]
                scores[column] = {
                    payload: score_fit(found[payload].payloads[0], payload_truth(payload), units[payload])
                    if payload in found
                    else None
                    for payload in plan.payloads
                }
    return scores


def _request(plan: PaperPlan, payload: str, trial: str, number: int) -> TrialRequest:
    return TrialRequest(payload, trial, plan.seed, number, plan.vias, plan.duration_s)


def _trial(
    share: Array, request: TrialRequest, team: Sequence[SensorPreset], grasps: Grasps | None
) -> tuple[dict[str, Recording], TrialSummary]:
    X_1i = grasps and RigidTransform.from_components(grasps[0], Rotation.from_matrix(grasps[1]))

    def tell(done: int, samples: int) -> None:
        share[0] = done / samples

    key = request.payload, request.trial, request.number
    effects = scattering(*key) if team[-1].name == SCATTERED else ()
    done = simulate(request, team, X_1i, progress=tell, effects=effects)
    summary = TrialSummary(
        name=f"{request.payload} {request.trial} {request.number} {team[-1].name}",
        rotation_deg=float(np.rad2deg(np.linalg.norm(done.log.payload_rotation(), axis=1).max())),
        torque_Nm=float(np.abs(done.log.tau).max()),
        rod_error_m=done.log.rod_error_m,
        weld_error_m=done.log.weld_error_m,
        weld_error_deg=float(np.rad2deg(done.log.weld_error_rad)),
        damping_ratio=done.log.stability.damping_ratio if done.log.stability else None,
    )
    return done.recordings, summary


def _collect(
    tasks: Sequence[tuple[TrialRequest, Sequence[SensorPreset], Grasps | None]],
    outcomes: Iterable[tuple[dict[str, Recording], TrialSummary]],
    result: PaperResult,
) -> dict[tuple[str, str], list[Recording]]:
    """Collect recordings by (payload, preset), in the order of the tasks, and add summaries to ``result``."""
    recordings: dict[tuple[str, str], list[Recording]] = {}
    for (request, _, _), (measured, summary) in zip(tasks, outcomes, strict=True):
        result.trials.append(summary)
        for preset, recording in measured.items():
            recordings.setdefault((request.payload, preset), []).append(recording)
    return recordings


def _grasps(_share: Array, recordings: Sequence[Recording]) -> Grasps:
    estimate, steps = estimate_grasps([process_recording(recording) for recording in recordings])
    if estimate is None:
        weak = [str(direction) for step in steps for direction in step.weak]
        raise InputError(f"the random trials do not determine the grasps: {weak[0]}")
    return estimate.p_1i, estimate.R_1i


def _fit(_share: Array, *task: Any) -> Calibration:
    return fit_trials(*task)


def _estimate(_share: Array, *task: Any) -> tuple[PayloadEstimate, PayloadEstimate | None]:
    return estimate_both(*task)

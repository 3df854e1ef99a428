"""The unknowns before any cause: from the estimate, then Gauss-Newton on the whitened residual."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import cast

import numpy as np
from joblib import Parallel, delayed

from discrepancy.team.linear.adjust import SignalNoise, with_adjusted_signals
from discrepancy.team.linear.chatter import NOISE_SEED
from discrepancy.team.linear.filed import held, is_filed, rested
from discrepancy.team.linear.inertia import held_inertia, inertia_is_like_held, is_another
from discrepancy.team.linear.noise import Noise
from discrepancy.team.linear.reduction import Reduction
from discrepancy.team.linear.rest import Resting, Tolerances, draws_at_a_time
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.trial_linear import TrialLinear, filtered, linearise
from discrepancy.team.linear.whitening import Whitening
from estimator.arm.unit import Arms
from estimator.arrays import Array, inertia_parameters
from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from estimator.files import ends_with_this
from estimator.recording.model import Recording
from estimator.rigid_team import (
    Bases,
    Shared,
    balance,
    grasp_data,
    pose_residual,
    poses,
    start_bases,
)

NOISE_DRAWS = 24
"""From which the rows' covariance is made. Chosen."""


def start_shared(estimate: PayloadEstimate) -> Shared:
    """Unknowns from the estimate; an inertia that it does not tell is that of a mass where it is held.

    Raises:
        InputError: grasps, mass or centre of mass are missing.
    """
    grasps, mass, c = estimate.grasps, estimate.mass, estimate.p_1c
    if grasps is None or mass is None or c is None:
        missing = "grasps" if grasps is None else "mass" if mass is None else "centre of mass"
        raise InputError(
            f"these recordings do not determine the {missing}, so there is nothing to hold the data against; "
            "add a recording with motion in all axes"
        )
    inertia = estimate.inertia.inertia if estimate.inertia else held_inertia(grasps.p_1i, mass.mass, c)
    about_1 = inertia + mass.mass * (c @ c * np.eye(3) - np.outer(c, c))
    return Shared(grasps, np.concatenate([[mass.mass], mass.mass * c, inertia_parameters(about_1)]))


@dataclass(frozen=True, eq=False)
class Sensed:
    """What noise leaves in the rows of some trials.

    Attributes:
        noise: resolution of the sensors.
        whitening: of every trial.
        signals: what the residual tells of it in the signals, of every trial.
        draws: what the sensors' noise alone leaves in the rows of every trial, (D, n, C) each; None where it is long.
    """

    noise: Noise
    whitening: tuple[Whitening, ...]
    signals: tuple[SignalNoise, ...]
    draws: tuple[Array | None, ...] = ()


def linearised_trials(
    recordings: Sequence[Recording],
    shared: Shared,
    tolerances: Tolerances,
    jobs: int = 1,
    sensed: Sensed | None = None,
    explained: Callable[[int, TrialLinear], Array] | None = None,
) -> tuple[tuple[TrialLinear, ...], Sensed]:
    """Every trial linearised around the best unknowns, and what noise and friction at rest leave in its rows.

    Args:
        recordings: the trials.
        shared: unknowns to start from.
        tolerances: standard deviations by cause and parameter.
        jobs: parallel processes.
        sensed: what noise leaves, where that is known already.
        explained: what causes put into every sample's residual of a trial, shape (Q, C); None for none. With causes the
            shared unknowns stay where they are: those that fit best without them are others.

    Raises:
        InputError: a recording is too short.
    """
    arms = recordings[0].metadata.arms
    signals = [Signals.of(recording) for recording in recordings]
    noise = Noise.of(signals) if sensed is None else sensed.noise
    signals = [noise.known_to(one) for one in signals]
    reductions = [Reduction.of(s) for s in signals]
    for recording, reduction in zip(recordings, reductions, strict=True):
        if len(reduction.time) < 4:
            raise InputError(f"{recording.name}: too short to diagnose")
    bases = [start_bases(*poses(s.phi[s.keep], s.theta[s.keep], arms), shared) for s in signals]
    run = _processes(jobs)
    full = sensed is None or explained is not None  # causes may be errors of the signals
    linear = _linearised(run, signals, shared, bases, arms, reductions, full=full)
    if sensed is None:
        sensed = sensed_in(linear, noise, tolerances, jobs)
        likely, _ = gauss_newton(linear, sensed.whitening, inertia_is_like_held(shared))
        if is_another(shared, likely):
            linear = _linearised(run, signals, likely, bases, arms, reductions, full=True)
            sensed = sensed_in(linear, noise, tolerances, jobs)
    for _ in range(0 if explained else 2):
        shared, bases = gauss_newton(linear, sensed.whitening)
        linear = tuple(
            replace(
                t, shared=shared, bases=b, residual=exact_residual(t.signals, shared, b, arms, t.reduction)
            )
            for t, b in zip(linear, bases, strict=True)
        )
    there = (
        explained(k, t) if explained else 0.0 for k, t in enumerate(linear)
    )  # one by one: they may be long
    parts = zip(linear, sensed.signals, there, strict=True)
    return held(with_adjusted_signals(*part) for part in parts), sensed


def _processes(jobs: int) -> Parallel:
    prefer = "processes" if jobs > 1 else "threads"
    return Parallel(
        n_jobs=jobs, prefer=prefer, return_as="generator", **ends_with_this()
    )  # for the sake of memory


def _linearised(
    run: Parallel,
    signals: Sequence[Signals],
    shared: Shared,
    bases: Sequence[Bases],
    arms: Arms,
    reductions: Sequence[Reduction],
    *,
    full: bool,
) -> tuple[TrialLinear, ...]:
    """Every trial, linearised where the unknowns are said to be."""
    tasks = zip(signals, bases, reductions, strict=True)
    each = run(delayed(linearise)(s, shared, b, arms, r, full=full) for s, b, r in tasks)
    return held(cast("Iterator[TrialLinear]", each))


def sensed_in(
    linear: Sequence[TrialLinear],
    noise: Noise,
    tolerances: Tolerances,
    jobs: int = 1,
    before: Sensed | None = None,
) -> Sensed:
    """What noise and friction at rest leave in the rows of linearised trials; of the noise, as it was found before."""
    told = zip(before.draws, before.signals, strict=True) if before and before.draws else [None] * len(linear)
    tasks = enumerate(zip(linear, told, strict=True))
    left = _processes(jobs)(delayed(what_noise_leaves)(t, noise, k, tolerances, old) for k, (t, old) in tasks)
    parts = cast("Iterator[tuple[Whitening, SignalNoise, Array | None]]", left)
    whitening, signals, draws = zip(*parts, strict=True)
    return Sensed(noise, tuple(whitening), tuple(signals), tuple(draws))


def what_noise_leaves(
    trial: TrialLinear,
    noise: Noise,
    k: int,
    tolerances: Tolerances,
    before: tuple[Array | None, SignalNoise] | None = None,
) -> tuple[Whitening, SignalNoise, Array | None]:
    """What noise and friction at rest leave in the rows of trial number k, what it tells of signals, and its draws."""
    moving = trial.reduction.moving
    draws, told = before or (None, None)
    if draws is None or told is None:
        draws, errors = noise_rows(trial, noise, np.random.default_rng([NOISE_SEED, k]))
        told = SignalNoise.of(draws, errors, moving)
    rests = Resting(trial, tolerances)(np.random.default_rng([NOISE_SEED, k, 1]), len(draws))
    rested(trial)
    return Whitening.of(draws + rests, moving, uneven=True), told, None if is_filed(trial) else draws


def exact_residual(signals: Signals, shared: Shared, bases: Bases, arms: Arms, reduction: Reduction) -> Array:
    force = balance(grasp_data(filtered(signals), arms, signals.rate_hz), shared)[0]
    pose = pose_residual(signals.phi, signals.theta, shared, bases, arms)
    return reduction(np.concatenate([pose, force], axis=1))


def gauss_newton(
    linear: Sequence[TrialLinear], whitening: Sequence[Whitening], known: Array | None = None
) -> tuple[Shared, list[Bases]]:
    """One step of all unknowns, with no cause in the model.

    Args:
        linear, whitening: of every trial.
        known: information beforehand that each shared unknown stays where it is, shape (6 (N - 1) + 10,).
    """
    own = linear[0].by_bases.shape[2]
    shared_columns = linear[0].by_shared.shape[2]
    total = shared_columns + own * len(linear)
    gram, right = np.zeros((total, total)), np.zeros(total)
    if known is not None:
        gram[np.arange(shared_columns), np.arange(shared_columns)] = known
    for t, (trial, white) in enumerate(zip(linear, whitening, strict=True)):
        at = np.r_[np.arange(shared_columns), shared_columns + own * t + np.arange(own)]
        columns = np.concatenate([white(trial.by_shared), white(trial.by_bases)], axis=2)
        columns = columns.reshape(-1, columns.shape[2])
        gram[np.ix_(at, at)] += columns.T @ columns
        right[at] += columns.T @ white(trial.residual).ravel()
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
    step = -np.linalg.lstsq(gram * np.outer(scale, scale), right * scale, rcond=1e-12)[0] * scale
    return linear[0].shared.moved(step[:shared_columns]), [
        trial.bases.moved(step[shared_columns + own * t : shared_columns + own * (t + 1)])
        for t, trial in enumerate(linear)
    ]


def noise_rows(trial: TrialLinear, noise: Noise, rng: np.random.Generator) -> tuple[Array, Array]:
    """What the sensors' errors alone would leave: residuals (draws, n, C), and signals (draws, n, N, 21)."""
    out: list[tuple[Array, Array]] = []
    errors = noise.draws(trial.signals, rng, NOISE_DRAWS)
    while some := list(islice(errors, draws_at_a_time(trial))):  # not all at once, for the sake of memory
        phi, theta, tau = (np.array([getattr(e, kind) for e in some]) for kind in ("phi", "theta", "tau"))
        out.append(trial.of_all_signals(phi, theta, tau))
    rows, signals = zip(*out, strict=True)
    return np.concatenate(rows), np.concatenate(signals)

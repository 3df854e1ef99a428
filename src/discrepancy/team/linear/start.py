"""The unknowns before any cause, at adjusted signals: from the estimate, then Gauss-Newton on the whitened residual."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import cast, overload

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from scipy.sparse import csr_array

from discrepancy.team.linear.jacobian import by_signals
from discrepancy.team.linear.noise import NOISE_SEED, Noise
from discrepancy.team.linear.rest import Resting, Tolerances, draws_at_a_time
from discrepancy.team.linear.rows import Reduction, Whitening
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.trial_linear import (
    TrialLinear,
    by_bases,
    by_shared,
    filtered,
    given_back,
    is_stored,
    linearise,
    stored,
)
from estimator.arm.motion import PHI, TAU, THETA
from estimator.arm.unit import Arms
from estimator.arrays import Array, inertia_matrix, inertia_parameters
from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from estimator.files import ends_with_this
from estimator.recording.model import Recording
from estimator.rigid_team import (
    Bases,
    Shared,
    balance,
    grasp_data,
    pose_error,
    pose_residual,
    poses,
    start_bases,
)
from estimator.signals import GraspData

INERTIA_OFF = 0.3
"""Relative error of the inertia up to which noise in moments is not drawn again."""


def held_inertia(p_1i: Array, mass: float, p_1c: Array) -> Array:
    """Inertia of a payload whose mass lies where it is held, about its centre of mass [kg m^2], shape (3, 3).

    Args:
        p_1i: origins of the grasp frames in {1} [m], shape (N, 3).
        mass: [kg].
        p_1c: centre of mass in {1} [m], shape (3,).
    """
    lever = p_1i - p_1c
    spread = mass * lever.T @ lever / len(lever)
    return np.asarray(np.trace(spread) * np.eye(3) - spread)


def inertia_about_centre(shared: Shared) -> Array:
    """About the centre of mass, in the axes of {1} [kg m^2], shape (3, 3)."""
    mass, c = shared.pi[0], shared.pi[1:4] / shared.pi[0]
    return np.asarray(inertia_matrix(shared.pi[4:]) - mass * (c @ c * np.eye(3) - np.outer(c, c)))


def inertia_is_like_held(shared: Shared) -> Array:
    """Information that an inertia is as it is to within that of a mass where it is held, (6 (N - 1) + 10,).

    It counts beside what trials tell: axes about which a payload hardly turns keep what was taken for them.
    """
    mass, c = shared.pi[0], shared.pi[1:4] / shared.pi[0]
    size = float(np.trace(held_inertia(shared.grasps.p_1i, mass, c))) / 3.0
    known = np.zeros(6 * shared.grasps.robots + 4)
    known[-6:] = 1.0 / max(size, 1e-6) ** 2
    return known


def is_another(a: Shared, b: Shared) -> bool:
    """Whether noise that is turned into moments by a's inertia must be so again, by b's."""
    first, second = inertia_about_centre(a), inertia_about_centre(b)
    return bool(np.linalg.norm(first - second) > INERTIA_OFF * np.linalg.norm(second))


@dataclass(frozen=True, eq=False)
class SignalNoise:
    """What a residual tells of the noise of every signal in a trial.

    Attributes:
        told: regression of the signals' noise on the residual's channels, in motion and in holds, (N, 21, C) each.
    """

    told: tuple[Array, Array]

    @classmethod
    def of(cls, rows: Array, signals: Array, moving: int) -> SignalNoise:
        """From draws of the noise alone: residuals (D, n, C), reduced signals (D, n, N, 21)."""
        kinds = slice(None, moving), slice(moving, None)
        moves, holds = (_regression(rows[:, at], signals[:, at]) for at in kinds)
        return cls((moves, holds))


def _regression(rows: Array, signals: Array) -> Array:
    """E[s r^T] E[r r^T]^-1, shape (N, 21, C); few draws tell of every channel by itself, none of nothing."""
    r, s = rows.reshape(-1, rows.shape[2]), signals.reshape(-1, *signals.shape[2:])
    squares, weight = r.T @ r, min(1.0, r.shape[1] / max(len(r), 1))
    size = np.sqrt(np.maximum(np.diag(squares), 1e-300))
    alike = (1.0 - weight) * squares / np.outer(size, size) + weight * np.diag(np.diag(squares) / size**2)
    inverse = np.linalg.pinv(alike, hermitian=True) / np.outer(size, size)
    return np.asarray(np.einsum("kns,kc->nsc", s, r, optimize=True) @ inverse)


def with_adjusted_signals(
    linear: TrialLinear, noise: SignalNoise, explained: Array | float = 0.0
) -> TrialLinear:
    """The trial linear at its signals moved the likeliest way that leaves no residual but what causes explain.

    Columns of scales, lengths and masses are functions of the signals. At measured signals their noise is in column
    and residual alike and biases them; at adjusted ones it is not (Deming, Statistical Adjustment of Data, 1943).

    Args:
        linear: the trial.
        noise: what its residual tells of its signals.
        explained: what causes put into every sample's residual, shape (Q, C).
    """
    shared, bases, arms = linear.shared, linear.bases, linear.arms
    s = linear.s - _noise_in(linear.data, shared, bases, linear.reduction, noise, explained)
    data = grasp_data(s, arms, linear.signals.rate_hz)
    return replace(
        linear,
        s=s,
        data=data,
        J=by_signals(s, data, shared, bases, arms),
        by_shared=linear.reduction(by_shared(data, shared, bases)),
        by_bases=linear.reduction(by_bases(data, shared, bases)),
    )


def noise_of(
    signals: Signals, shared: Shared, bases: Bases, linear: TrialLinear, noise: SignalNoise
) -> Signals:
    """What residuals tell of the noise in signals without any error, angles and torques of shape (Q, N, 3)."""
    data = grasp_data(filtered(signals), linear.arms, signals.rate_hz)
    each = _noise_in(data, shared, bases, linear.reduction, noise)
    phi, theta, tau = (each[..., kind] for kind in (PHI, THETA, TAU))
    return Signals(signals.time, phi, theta, tau, signals.rate_hz)


def as_loud(signals: Signals, shared: Shared, bases: Bases, linear: TrialLinear, noise: SignalNoise) -> Array:
    """What has to be added to a residual so that its noise is as loud as where the trial is linear, rows (n, C).

    Noise of accelerations is in the residual as often as there is mass, and that of a spring's reading at the lever of
    its robot. Elsewhere it would be louder or quieter than its whitening says, and the quieter the likelier.
    """
    s = filtered(signals)
    data = grasp_data(s, linear.arms, signals.rate_hz)
    each = _noise_in(data, shared, bases, linear.reduction, noise)
    quiet = grasp_data(s - each, linear.arms, signals.rate_hz)
    here = _residual(data, shared, bases) - _residual(quiet, shared, bases)
    there = sum(linear.J(robot, slice(None), each[:, robot]) for robot in range(linear.robots))
    return linear.reduction(there - here)


def _residual(data: GraspData, shared: Shared, bases: Bases) -> Array:
    """Residual of every sample, shape (Q, 6 N)."""
    return np.concatenate([pose_error(data.R_bi, data.p_bi, shared, bases), balance(data, shared)[0]], axis=1)


def _noise_in(
    data: GraspData,
    shared: Shared,
    bases: Bases,
    reduction: Reduction,
    noise: SignalNoise,
    explained: Array | float = 0.0,
) -> Array:
    """Noise of every sample's signals, shape (Q, N, 21)."""
    residual = _residual(data, shared, bases) - explained
    held = np.zeros(len(residual), dtype=bool)
    held[reduction.operator[reduction.moving :].indices] = True
    moves, holds = (np.einsum("nsc,qc->qns", told, residual, optimize=True) for told in noise.told)
    return np.where(held[:, None, None], holds, moves)


LINEAR_BYTES = 1.5e8
"""Size of all linear trials from which they are kept in files: seven minutes of three robots."""


def held(trials: Iterable[TrialLinear]) -> tuple[TrialLinear, ...]:
    """Trials one after the other, in files if together they take more memory than they should."""
    out: list[TrialLinear] = []
    total = 0
    for trial in trials:
        out.append(trial)
        total += sum(x.nbytes for x in _arrays(trial))
        if total > LINEAR_BYTES:
            out = [filed(each) for each in out]
    return tuple(out)


def filed(trial: TrialLinear) -> TrialLinear:
    """The same trial with its arrays in files."""
    data, J = trial.data, trial.J
    names = ("R_bi", "p_bi", "twist", "twist_dot", "wrench")
    return replace(
        trial, s=stored(trial.s), by_shared=stored(trial.by_shared), by_bases=stored(trial.by_bases),
        data=replace(data, **{name: stored(getattr(data, name)) for name in names}),
        J=replace(J, knots=tuple(map(stored, J.knots))),
        reduction=_reduction(trial.reduction),
    )  # fmt: skip


def is_filed(trial: TrialLinear) -> bool:
    """Whether a trial is in files."""
    return is_stored(trial.s)


def rested(trial: TrialLinear) -> None:
    """Let the system take what a trial takes until it is asked for again."""
    if is_filed(trial):
        given_back(*_arrays(trial), *(x for x in (trial.__dict__.get("by_wrist"),) if x is not None))


class OneByOne(Sequence[Array]):
    """So many arrays, each made by its number whenever it is asked for."""

    def __init__(self, of: Callable[[int], Array], count: int) -> None:
        self._of, self._count = of, count

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, at: int) -> Array: ...
    @overload
    def __getitem__(self, at: slice) -> list[Array]: ...
    def __getitem__(self, at: int | slice) -> Array | list[Array]:
        where = range(self._count)[at]
        return self._of(where) if isinstance(where, int) else [self._of(k) for k in where]


def _reduction(reduction: Reduction) -> Reduction:
    of = reduction.operator
    if is_stored(of.data):
        return reduction
    operator = csr_array((stored(of.data), stored(of.indices), of.indptr), shape=of.shape)
    return replace(reduction, operator=operator)


def _arrays(trial: TrialLinear) -> Iterator[NDArray[np.generic]]:
    """What is large of a trial."""
    data, of = trial.data, trial.reduction.operator
    yield from (trial.s, trial.by_shared, trial.by_bases, *trial.J.knots, of.data, of.indices)
    yield from (data.R_bi, data.p_bi, data.twist, data.twist_dot, data.wrench)


def trial_at(recording: Recording, shared: Shared, noise: Noise, *, full: bool) -> TrialLinear:
    """The trial where its bases fit it on average; without ``full`` the robots' signals are left out."""
    signals, arms = noise.known_to(Signals.of(recording)), recording.metadata.arms
    angles = signals.phi[signals.keep], signals.theta[signals.keep]
    bases = start_bases(*poses(*angles, arms), shared)
    return linearise(signals, shared, bases, arms, Reduction.of(signals), full=full, known=True)


def without_bases(trial: TrialLinear, rows: Array) -> Array:
    """Rows, shape (n, C), without what the bases' places can explain of them, every channel in its own scale."""
    if not rows.size:
        return rows
    scale = np.maximum(np.sqrt(np.mean(rows**2, axis=0)), 1e-300)
    columns = (trial.by_bases / scale[:, None]).reshape(rows.size, -1)
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    values = np.linalg.lstsq(columns / size, (rows / scale).ravel(), rcond=None)[0] / size
    return rows - trial.by_bases @ values


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

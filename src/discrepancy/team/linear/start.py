"""Fit the unknowns before any cause is considered, and linearise each trial at adjusted signals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import cast

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from scipy.sparse import csr_array

from discrepancy.team.linear.jacobian import by_signals
from discrepancy.team.linear.noise import NOISE_SEED, Noise, drifts
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
from estimator.arrays import Array, inertia_matrix
from estimator.errors import InputError
from estimator.estimate.inertia import about_com, about_origin
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
"""Relative change of the inertia above which the noise draws are repeated. Chosen."""


def held_inertia(p_1i: Array, mass: float, p_1c: Array) -> Array:
    """Inertia about the centre of mass of a payload whose mass lies at the grasps [kg m^2], shape (3, 3).

    Args:
        p_1i: origins of the grasp frames in {1} [m], shape (N, 3).
        mass: [kg].
        p_1c: centre of mass in {1} [m], shape (3,).
    """
    lever = p_1i - p_1c
    spread = mass * lever.T @ lever / len(lever)
    return np.asarray(np.trace(spread) * np.eye(3) - spread)


def inertia_about_centre(shared: Shared) -> Array:
    """Inertia about the centre of mass, in the axes of {1} [kg m^2], shape (3, 3)."""
    return inertia_matrix(about_com(shared.pi)[4:])


def inertia_is_like_held(shared: Shared) -> Array:
    """Prior information (inverse variance) of the shared unknowns, shape (6 (N - 1) + 10,).

    It only constrains the inertia, to within that of a mass at the grasps. Axes about which the payload hardly turns
    thus keep their assumed inertia.
    """
    mass, c = shared.pi[0], shared.pi[1:4] / shared.pi[0]
    size = float(np.trace(held_inertia(shared.grasps.p_1i, mass, c))) / 3.0
    known = np.zeros(6 * shared.grasps.robots + 4)
    known[-6:] = 1.0 / max(size, 1e-6) ** 2
    return known


def is_another(a: Shared, b: Shared) -> bool:
    """Whether the inertias of a and b differ so much that the noise in moments must be drawn again."""
    first, second = inertia_about_centre(a), inertia_about_centre(b)
    return bool(np.linalg.norm(first - second) > INERTIA_OFF * np.linalg.norm(second))


@dataclass(frozen=True, eq=False)
class SignalNoise:
    """Regression that estimates the noise of every signal in a trial from the residual.

    Attributes:
        told: regression coefficients of the signals' noise on the residual's channels, in motion and in holds,
            shape (N, 21, C) each.
    """

    told: tuple[Array, Array]

    @classmethod
    def of(cls, rows: Array, signals: Array, moving: int) -> SignalNoise:
        """Estimate the regression from draws of the noise: residuals (D, n, C), reduced signals (D, n, N, 21)."""
        kinds = slice(None, moving), slice(moving, None)
        moves, holds = (_regression(rows[:, at], signals[:, at]) for at in kinds)
        return cls((moves, holds))


def _regression(rows: Array, signals: Array) -> Array:
    """Regression matrix E[s r^T] E[r r^T]^-1, shape (N, 21, C). Few draws shrink the covariance to its diagonal."""
    r, s = rows.reshape(-1, rows.shape[2]), signals.reshape(-1, *signals.shape[2:])
    squares, weight = r.T @ r, min(1.0, r.shape[1] / max(len(r), 1))
    size = np.sqrt(np.maximum(np.diag(squares), 1e-300))
    alike = (1.0 - weight) * squares / np.outer(size, size) + weight * np.diag(np.diag(squares) / size**2)
    inverse = np.linalg.pinv(alike, hermitian=True) / np.outer(size, size)
    return np.asarray(np.einsum("kns,kc->nsc", s, r, optimize=True) @ inverse)


def with_adjusted_signals(
    linear: TrialLinear, noise: SignalNoise, explained: Array | float = 0.0
) -> TrialLinear:
    """Linearise a trial at its most likely true signals, whose residual equals the part that causes explain.

    Columns of scales, lengths and masses depend on the signals. At measured signals the same noise is in columns and
    residual, which biases the estimate. Adjusted signals avoid that (Deming, Statistical Adjustment of Data, 1943).

    Args:
        linear: the trial.
        noise: regression of its signals' noise on the residual.
        explained: residual of every sample that the causes explain, shape (Q, C).
    """
    shared, bases, arms = linear.shared, linear.bases, linear.arms
    s = _without(linear.s, _noise_in(linear.data, shared, bases, linear.reduction, noise, explained))
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
    """Estimate the noise in signals from their residual; angles and torques of shape (Q, N, 3).

    The signals must contain no other errors.
    """
    data = grasp_data(filtered(signals), linear.arms, signals.rate_hz)
    each = _noise_in(data, shared, bases, linear.reduction, noise)
    phi, theta, tau = (each[..., kind] for kind in (PHI, THETA, TAU))
    return Signals(signals.time, phi, theta, tau, signals.rate_hz)


def as_loud(signals: Signals, shared: Shared, bases: Bases, linear: TrialLinear, noise: SignalNoise) -> Array:
    """Correction of a residual so that its noise equals that at the linearisation point, rows (n, C).

    The noise of accelerations enters the residual in proportion to mass, and that of a spring's torque with its lever
    arm. Without the correction, values that merely reduce the noise would look likelier.
    """
    s = filtered(signals)
    data = grasp_data(s, linear.arms, signals.rate_hz)
    each = _noise_in(data, shared, bases, linear.reduction, noise)
    quiet = grasp_data(_without(s, each), linear.arms, signals.rate_hz)
    here = _residual(data, shared, bases) - _residual(quiet, shared, bases)
    there = sum(linear.J(robot, slice(None), each[:, robot]) for robot in range(linear.robots))
    return linear.reduction(there - here)


def _without(s: Array, noise: Array) -> Array:
    """Subtract noise (Q, N, 21) from signals, which of driving bases have further slots."""
    s = s.copy()
    s[..., : noise.shape[2]] -= noise
    return s


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
    """Estimated noise of every sample's signals, shape (Q, N, 21)."""
    residual = _residual(data, shared, bases) - explained
    held = np.zeros(len(residual), dtype=bool)
    held[reduction.operator[reduction.moving :].indices] = True
    moves, holds = (np.einsum("nsc,qc->qns", told, residual, optimize=True) for told in noise.told)
    return np.where(held[:, None, None], holds, moves)


LINEAR_BYTES = 1.5e8
"""Size of all linearised trials [bytes] above which they are kept in files. Chosen: seven minutes of three robots."""


def held(trials: Iterable[TrialLinear]) -> tuple[TrialLinear, ...]:
    """Collect trials, and move them to files if together they exceed ``LINEAR_BYTES``."""
    out: list[TrialLinear] = []
    total = 0
    for trial in trials:
        out.append(trial)
        total += sum(x.nbytes for x in _arrays(trial))
        if total > LINEAR_BYTES:
            out = [filed(each) for each in out]
    return tuple(out)


def filed(trial: TrialLinear) -> TrialLinear:
    """Return the same trial with its arrays in files."""
    data, J = trial.data, trial.J
    names = ("R_bi", "p_bi", "twist", "twist_dot", "wrench")
    return replace(
        trial, s=stored(trial.s), by_shared=stored(trial.by_shared), by_bases=stored(trial.by_bases),
        data=replace(data, **{name: stored(getattr(data, name)) for name in names}),
        J=replace(J, knots=tuple(map(stored, J.knots))),
        reduction=_reduction(trial.reduction),
    )  # fmt: skip


def is_filed(trial: TrialLinear) -> bool:
    """Whether the arrays of a trial are in files."""
    return is_stored(trial.s)


def rested(trial: TrialLinear) -> None:
    """Release the memory of a trial that is kept in files until it is read again."""
    if is_filed(trial):
        given_back(*_arrays(trial), *(x for x in (trial.__dict__.get("by_wrist"),) if x is not None))


def _reduction(reduction: Reduction) -> Reduction:
    of = reduction.operator
    if is_stored(of.data):
        return reduction
    operator = csr_array((stored(of.data), stored(of.indices), of.indptr), shape=of.shape)
    return replace(reduction, operator=operator)


def _arrays(trial: TrialLinear) -> Iterator[NDArray[np.generic]]:
    """The large arrays of a trial."""
    data, of = trial.data, trial.reduction.operator
    yield from (trial.s, trial.by_shared, trial.by_bases, *trial.J.knots, of.data, of.indices)
    yield from (data.R_bi, data.p_bi, data.twist, data.twist_dot, data.wrench)


def trial_at(recording: Recording, shared: Shared, noise: Noise) -> TrialLinear:
    """Linearise a trial by the bases alone, at given shared unknowns and with bases that fit its poses.

    Args:
        recording: the trial.
        shared: the shared unknowns, which stay fixed.
        noise: resolution of the sensors.
    """
    signals, arms = noise.known_to(Signals.of(recording)), recording.metadata.arms
    bases = start_bases(*_kept_poses(signals, arms), shared)
    return linearise(signals, shared, bases, arms, Reduction.of(signals), full=False, known=True)


def _kept_poses(signals: Signals, arms: Arms) -> tuple[Array, Array]:
    """Poses without the filters' transients, as from ``poses``."""
    keep, base = signals.keep, signals.base
    return poses(signals.phi[keep], signals.theta[keep], arms, None if base is None else base[keep])


def without_bases(trial: TrialLinear, rows: Array) -> Array:
    """Fit errors of the base poses to rows, shape (n, C), and subtract them. Each channel is scaled by its own rms."""
    if not rows.size:
        return rows
    scale = np.maximum(np.sqrt(np.mean(rows**2, axis=0)), 1e-300)
    columns = (trial.by_bases / scale[:, None]).reshape(rows.size, -1)
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    values = np.linalg.lstsq(columns / size, (rows / scale).ravel(), rcond=None)[0] / size
    return rows - trial.by_bases @ values


NOISE_DRAWS = 24
"""Number of noise draws that estimate the covariance of the rows. Chosen."""


def start_shared(estimate: PayloadEstimate) -> Shared:
    """Take the unknowns from the estimate. An undetermined inertia is replaced by that of a mass at the grasps.

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
    return Shared(grasps, about_origin(mass.mass, c, inertia))


@dataclass(frozen=True, eq=False)
class Sensed:
    """Effect of sensor noise on the rows of some trials.

    Attributes:
        noise: resolution of the sensors.
        whitening: of every trial.
        signals: regression of the signals' noise on the residual, of every trial.
        draws: residual rows of sensor noise alone, (D, n, C) a trial; None for trials that are kept in files.
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
    """Linearise every trial at the best unknowns, and find the effect of noise and friction at rest on its rows.

    Args:
        recordings: the trials.
        shared: unknowns to start from.
        tolerances: standard deviations by cause and parameter.
        jobs: parallel processes.
        sensed: effect of the noise, if it is already known.
        explained: residual of every sample of a trial that the causes explain, shape (Q, C); None without causes. With
            causes the shared unknowns stay fixed, because a fit without the causes would shift them.

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
    bases = [start_bases(*_kept_poses(s, arms), shared) for s in signals]
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
    )  # one by one, to limit memory
    parts = zip(linear, sensed.signals, there, strict=True)
    return held(with_adjusted_signals(*part) for part in parts), sensed


def _processes(jobs: int) -> Parallel:
    prefer = "processes" if jobs > 1 else "threads"
    return Parallel(
        n_jobs=jobs, prefer=prefer, return_as="generator", **ends_with_this()
    )  # a generator, to limit memory


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
    """Linearise every trial at the given unknowns."""
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
    """Effect of noise and friction at rest on the rows of linearised trials.

    Args:
        linear: the trials.
        noise: resolution of the sensors.
        tolerances: standard deviations by cause and parameter.
        jobs: parallel processes.
        before: an earlier result, whose noise draws are reused.
    """
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
    """Return the whitening of trial k, the regression of its signals' noise, and its noise draws.

    Args:
        trial: linearised.
        noise: resolution of the sensors.
        k: number of the trial, which seeds the draws.
        tolerances: standard deviations by cause and parameter; they size friction at rest and play.
        before: earlier noise draws and regression to reuse.
    """
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
    pose = pose_residual(signals.phi, signals.theta, shared, bases, arms, signals.base)
    return reduction(np.concatenate([pose, force], axis=1))


def gauss_newton(
    linear: Sequence[TrialLinear], whitening: Sequence[Whitening], known: Array | None = None
) -> tuple[Shared, list[Bases]]:
    """Take one Gauss-Newton step of all unknowns, without causes.

    Args:
        linear, whitening: of every trial.
        known: prior information (inverse variance) of the shared unknowns, shape (6 (N - 1) + 10,).
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
    """Draw sensor noise and return its residual rows (D, n, C) and reduced signals (D, n, N, 21)."""
    out: list[tuple[Array, Array]] = []
    errors = noise.draws(trial.signals, rng, NOISE_DRAWS)
    while some := list(islice(errors, draws_at_a_time(trial))):  # in batches, to limit memory
        phi, theta, tau = (np.array([getattr(e, kind) for e in some]) for kind in ("phi", "theta", "tau"))
        out.append(trial.of_all_signals(phi, theta, tau))
    rows, signals = (np.concatenate(part) for part in zip(*out, strict=True))
    if trial.signals.base is not None:
        rows = rows + np.moveaxis(trial.of_bases(drifts(trial.signals, rng, len(rows))), -1, 0)
    return rows, signals

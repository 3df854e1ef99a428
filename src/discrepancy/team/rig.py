"""A team of Omnids as a rig: rows from recordings, candidates from the catalogue."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from discrepancy.rig import Candidate, Channel, Parameter, Rows
from discrepancy.team.causes import CAUSES
from discrepancy.team.causes.base import Context
from discrepancy.team.linear import TrialLinear, linearise, noise_rows, start_bases
from discrepancy.team.noise import Noise
from discrepancy.team.reduction import Reduction
from discrepancy.team.resimulate import errors_of_rerun
from discrepancy.team.residual import Bases, Shared, balance, grasp_data, pose_residual
from discrepancy.team.signals import Signals, with_rates
from discrepancy.whitening import Whitening
from estimator.design import OmnidDesign
from estimator.errors import InputError
from estimator.payload_estimate import PayloadEstimate
from estimator.principal import inertia_parameters
from estimator.recording import Recording
from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.catalogue import make_effect
from mocobot_sim.models import omnid_design

Array = NDArray[np.float64]

# What the integrator does to the closed loop at 1 ms (docs/diagnosis.md).
PHI_FLOOR_RAD, THETA_FLOOR_RAD, TAU_FLOOR_NM = 2.5e-5, 1e-5, 6e-4


@dataclass(frozen=True, eq=False)
class TeamRig:
    """Recordings of one payload, linearised around the best unknowns without any cause.

    Attributes:
        recordings: the trials.
        estimate: what the estimator makes of them.
        noise: resolution of the sensors.
        linear: linearised trials.
        whitening: of every trial.
        tolerances: standard deviations by cause and parameter.
        excluded: causes left out of the catalogue.
    """

    recordings: tuple[Recording, ...]
    estimate: PayloadEstimate
    noise: Noise
    linear: tuple[TrialLinear, ...]
    whitening: tuple[Whitening, ...]
    tolerances: Mapping[str, Mapping[str, float]]
    excluded: frozenset[str]

    @classmethod
    def of(
        cls,
        recordings: Sequence[Recording],
        estimate: PayloadEstimate,
        tolerances: Mapping[str, Mapping[str, float]],
        excluded: Sequence[str] = (),
        jobs: int = 1,
    ) -> TeamRig:
        """Linearise recordings around their estimate.

        Raises:
            InputError: the recordings do not determine the grasps, the mass and the centre of mass, or a cause to
                be excluded does not exist.
        """
        unknown = sorted(set(excluded) - set(CAUSES))
        if unknown:
            raise InputError(f"cause {unknown[0]!r} does not exist; the causes are {', '.join(CAUSES)}")
        shared = start_shared(estimate)
        design = recordings[0].metadata.design
        signals = [Signals.of(recording) for recording in recordings]
        noise = Noise.of(signals)
        reductions = [Reduction.of(s) for s in signals]
        for recording, reduction in zip(recordings, reductions, strict=True):
            if len(reduction.time) < 4:
                raise InputError(f"{recording.name}: too short to diagnose")
        bases = [start_bases(s, shared, design) for s in signals]
        run = Parallel(n_jobs=jobs, prefer="processes" if jobs > 1 else "threads")
        tasks = [(s, b, r, k) for k, (s, b, r) in enumerate(zip(signals, bases, reductions, strict=True))]
        linear, whitening = zip(
            *run(delayed(_linear)(s, shared, b, design, r, noise, k) for s, b, r, k in tasks), strict=True
        )
        for _ in range(2):
            shared, bases = _gauss_newton(linear, whitening)
            linear = tuple(
                replace(t, shared=shared, bases=b, residual=_exact(t.signals, shared, b, design, t.reduction))
                for t, b in zip(linear, bases, strict=True)
            )
        return cls(
            tuple(recordings),
            estimate,
            noise,
            tuple(linear),
            tuple(whitening),
            tolerances,
            frozenset(excluded),
        )

    @property
    def trials(self) -> Sequence[str]:
        """Names of the trials."""
        return [recording.name for recording in self.recordings]

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return self.linear[0].robots

    @property
    def local_unknowns(self) -> int:
        """Number of unknowns that every trial has of its own."""
        return self.linear[0].by_bases.shape[2]

    @property
    def channels(self) -> Sequence[Channel]:
        """Names of the residual's channels, in order."""
        out = []
        for i in range(2, self.robots + 1):
            out += [Channel(f"grasp {i} rotation {a}", "kinematic", i, "rad") for a in "xyz"]
            out += [Channel(f"grasp {i} position {a}", "kinematic", i, "m") for a in "xyz"]
        out += [Channel(f"force {a}", "balance", None, "N") for a in "xyz"]
        return out + [Channel(f"moment {a}", "balance", None, "N m") for a in "xyz"]

    def candidates(self) -> list[Candidate]:
        """Every cause of the catalogue at every place; transients come from ``transients``."""
        out = []
        for cause in CAUSES.values():
            if cause.name in self.excluded or cause.name == "push":
                continue
            joints = range(1, 4) if cause.per == "joint" else (None,)
            robots = (None,) if cause.per == "payload" else range(1, self.robots + 1)
            for robot in robots:
                for joint in joints:
                    out += self._split(cause, robot, joint)
        return out

    def _split(self, cause: Any, robot: int | None, joint: int | None) -> list[Candidate]:
        given = self.tolerances.get(cause.name, {})
        scales = cause.scales or tuple(given[name] or 1.0 for name in cause.parameters)
        parameters = tuple(
            Parameter(name, given.get(name, 0.0), scale)
            for name, scale in zip(cause.parameters, scales, strict=True)
        )
        return [Candidate(cause.name, cause.family, robot, joint, parameters, dict(cause.shapes[0]))]

    def columns(self, candidate: Candidate) -> list[Array]:
        """Whitened columns of one candidate, one array (n, C, k) per trial."""
        return [self._columns(t, candidate) for t in range(len(self.linear))]

    def _columns(self, trial: int, candidate: Candidate) -> Array:
        linear = self.linear[trial]
        if candidate.detail and candidate.detail["trial"] != trial:
            return np.zeros((*linear.residual.shape, len(candidate.parameters)))
        cause = CAUSES[candidate.cause]
        robot, joint = (candidate.robot or 1) - 1, (candidate.joint or 1) - 1
        return self.whitening[trial](cause.columns(linear, robot, joint, candidate.shape))

    def effect_parameters(
        self, candidate: Candidate, values: Array, covariance: Array
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Parameters of the simulator's effect, and their standard errors."""
        pi = self.linear[0].shared.pi
        context = Context(
            pi[1:4] / pi[0],
            self.linear[0].design.home_height_m,
            candidate.shape,
            int(candidate.detail["trial"]) + 1 if candidate.detail else None,
        )
        return CAUSES[candidate.cause].report(values, covariance, context)

    def effect(self, candidate: Candidate, values: Array) -> Effect | None:
        """The simulator's effect, or None where the values are none that it can have (a negative friction)."""
        k = len(values)
        parameters = self.effect_parameters(candidate, values, np.zeros((k, k)))[0]
        for name in ("coulomb_Nm", "viscous_Nms_per_rad"):
            if name in parameters:
                parameters[name] = max(parameters[name], 0.0)
        try:
            return make_effect(candidate.cause, parameters, candidate.robot, candidate.joint)
        except InputError:
            return None

    def can_run_again(self) -> str | None:
        """Why the recordings cannot be simulated again, or None."""
        for recording in self.recordings:
            if recording.ref is None:
                return f"{recording.name} has no commands (ref_x, ref_y, ref_z)"
            if not recording.metadata.control or "feed_forward_N" not in recording.metadata.control:
                return f"{recording.name} has no control gains and feed-forward in its metadata"
            if recording.metadata.design != omnid_design():
                return f"{recording.name} is of another design than the simulated Omnid"
        return None

    def run_again(
        self, trial: int, shared: Array, local: Array, active: Sequence[tuple[Candidate, Array]]
    ) -> dict[str, Array] | None:
        """Recorded minus simulated response of one trial to its own commands, by channel.

        Args:
            trial: index of the trial.
            shared, local: displacements of the unknowns.
            active: causes in the simulation, with values.

        Returns:
            ``phi``, ``theta`` [rad] and ``tau`` [N m], shape (Q, N, 3), or None if it cannot be simulated.
        """
        linear = self.linear[trial]
        effects = [self.effect(candidate, values) for candidate, values in active]
        if any(effect is None for effect in effects):
            return None
        return errors_of_rerun(
            self.recordings[trial],
            linear.shared.moved(shared),
            linear.bases.moved(local),
            [effect for effect in effects if effect is not None],
            trial + 1,
            linear.signals.keep,
        )

    def response_scale(self, trial: int) -> dict[str, tuple[Array, Array]]:
        """Standard deviation of the noise and of the motion, by channel, shape (N, 3) each."""
        linear, floor = self.linear[trial], {"phi": PHI_FLOOR_RAD, "theta": THETA_FLOOR_RAD, "tau": TAU_FLOOR_NM}
        out = {}
        for k, name in enumerate(("phi", "theta", "tau")):
            noise = np.sqrt(self.noise.sigma[k] ** 2 + self.noise.step[k] ** 2 / 12.0 + floor[name] ** 2)
            out[name] = noise, np.std(getattr(linear.signals, name)[linear.signals.keep], axis=0)
        return out

    def unknowns(self, candidate: Candidate) -> list[Array]:
        """What a cause leaves open in every trial, whitened columns, shape (n, C, k) each."""
        out = []
        robot, joint = (candidate.robot or 1) - 1, (candidate.joint or 1) - 1
        for linear, white in zip(self.linear, self.whitening, strict=True):
            columns = CAUSES[candidate.cause].unknowns(linear, robot, joint, candidate.shape)
            empty = np.zeros((*linear.residual.shape, 0))
            out.append(white(np.stack(columns, axis=-1)) if columns else empty)
        return out

    def rows(self, candidates: Sequence[Candidate]) -> list[Rows]:
        """Whitened rows of every trial."""
        return [
            Rows(
                self.recordings[t].name,
                self.whitening[t](linear.residual),
                self.whitening[t](linear.by_bases),
                self.whitening[t](linear.by_shared),
                [self._columns(t, candidate) for candidate in candidates],
                linear.reduction.time,
            )
            for t, linear in enumerate(self.linear)
        ]

    def residual(
        self, shared: Array, local: Sequence[Array], active: Sequence[tuple[Candidate, Array]]
    ) -> list[Array]:
        """Exact whitened residual of every trial with unknowns moved and causes taken out."""
        out = []
        for t, (linear, x) in enumerate(zip(self.linear, local, strict=True)):
            signals, modelled = linear.signals, np.zeros_like(linear.residual)
            for candidate, values in active:
                if candidate.detail and candidate.detail["trial"] != t:
                    continue
                cause = CAUSES[candidate.cause]
                robot, joint = (candidate.robot or 1) - 1, (candidate.joint or 1) - 1
                corrected = cause.undo(signals, linear, robot, joint, values, candidate.shape)
                if corrected is None:
                    modelled += cause.columns(linear, robot, joint, candidate.shape) @ values
                else:
                    signals = corrected
            residual = _exact(
                signals, linear.shared.moved(shared), linear.bases.moved(x), linear.design, linear.reduction
            )
            out.append(self.whitening[t](residual - modelled))
        return out

    def refinements(self, candidate: Candidate) -> list[Candidate]:
        """The candidate with every other shape of its cause; a transient with its interval moved."""
        if candidate.detail:
            return [
                self.push(int(candidate.detail["trial"]), start, duration)
                for start, duration in _intervals_near(
                    candidate.shape["start_s"], candidate.shape["duration_s"]
                )
            ]
        shapes = CAUSES[candidate.cause].shapes
        return [replace(candidate, shape=dict(shape)) for shape in shapes if dict(shape) != candidate.shape]

    def push(self, trial: int, start_s: float, duration_s: float) -> Candidate:
        """A push in one trial."""
        cause = CAUSES["push"]
        parameters = tuple(Parameter(n, 0.0, s) for n, s in zip(cause.parameters, cause.scales, strict=True))
        interval = {"start_s": start_s, "duration_s": duration_s}
        return Candidate("push", "push", None, None, parameters, interval, {"trial": trial, **interval})

    def transients(self, remaining: Sequence[Array]) -> list[Candidate]:
        """Pushes at the intervals where the wrench balance is worst.

        Args:
            remaining: whitened residual of every trial, shape (n, C).
        """
        if "push" in self.excluded:
            return []
        out = []
        for t, z in enumerate(remaining):
            moving = self.linear[t].reduction.moving
            time, square = self.linear[t].reduction.time[:moving], np.sum(z[:moving, -6:] ** 2, axis=1)
            if not len(time):
                continue
            total = np.concatenate([[0.0], np.cumsum(square - np.median(square))])
            best = []
            for duration in (0.4, 0.8, 1.6, 3.2, 6.4):
                width = max(2, round(duration * len(time) / max(time[-1] - time[0], 1e-9)))
                if width >= len(time):
                    continue
                sums = (total[width:] - total[:-width]) / np.sqrt(width)
                at = int(np.argmax(sums))
                best.append((sums[at], time[at], duration))
            out += [self.push(t, start, duration) for _, start, duration in sorted(best)[-2:]]
        return out


def _intervals_near(start_s: float, duration_s: float) -> list[tuple[float, float]]:
    end = start_s + duration_s
    steps = np.array([-0.4, -0.2, -0.1, -0.05, 0.0, 0.05, 0.1, 0.2, 0.4]) * duration_s
    return [
        (start_s + a, end + b - start_s - a)
        for a in steps
        for b in steps
        if (a or b) and end + b - start_s - a > 0.1
    ]


def start_shared(estimate: PayloadEstimate) -> Shared:
    """Unknowns from the estimate.

    Raises:
        InputError: grasps, mass or centre of mass are missing.
    """
    missing = [
        name
        for name, value in (
            ("grasps", estimate.grasps),
            ("mass", estimate.mass),
            ("centre of mass", estimate.p_1c),
        )
        if value is None
    ]
    if missing:
        raise InputError(
            f"these recordings do not determine the {missing[0]}, so there is nothing to hold the data against; "
            "add a recording with motion in all axes"
        )
    mass, c = estimate.mass.mass, estimate.p_1c
    inertia = estimate.inertia.inertia if estimate.inertia else np.zeros((3, 3))
    about_1 = inertia + mass * (c @ c * np.eye(3) - np.outer(c, c))
    return Shared(estimate.grasps, np.concatenate([[mass], mass * c, inertia_parameters(about_1)]))


def _linear(
    signals: Signals,
    shared: Shared,
    bases: Bases,
    design: OmnidDesign,
    reduction: Reduction,
    noise: Noise,
    k: int,
) -> tuple[TrialLinear, Whitening]:
    linear = linearise(signals, shared, bases, design, reduction, full=True)
    draws = noise_rows(linear, noise, np.random.default_rng([20250, k]))
    return linear, Whitening.of(draws, reduction.moving)


def _exact(
    signals: Signals, shared: Shared, bases: Bases, design: OmnidDesign, reduction: Reduction
) -> Array:
    rate = signals.rate_hz
    Q, N = signals.phi.shape[:2]
    parts = with_rates(signals.phi, rate), with_rates(signals.theta, rate), with_rates(signals.tau, rate)[:1]
    s = np.concatenate(parts).transpose(1, 2, 0, 3).reshape(Q, N, -1)
    force = balance(grasp_data(s, design, rate), shared)[0]
    pose = pose_residual(signals.phi, signals.theta, shared, bases, design)
    return reduction(np.concatenate([pose, force], axis=1))


def _gauss_newton(
    linear: Sequence[TrialLinear], whitening: Sequence[Whitening]
) -> tuple[Shared, list[Bases]]:
    """One step of all unknowns, with no cause in the model."""
    own = linear[0].by_bases.shape[2]
    shared_columns = linear[0].by_shared.shape[2]
    total = shared_columns + own * len(linear)
    gram, right = np.zeros((total, total)), np.zeros(total)
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

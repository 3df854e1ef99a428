"""A team of Omnids: its recordings as whitened rows, the columns of every cause, and its simulation."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Self

import numpy as np

from discrepancy.candidate import Candidate
from discrepancy.cause_names import excluded_from
from discrepancy.result.traces import Channel
from discrepancy.team.candidates import beyond, every_candidate, indices, origin_of, places_of
from discrepancy.team.causes import CAUSES
from discrepancy.team.causes.base import Context
from discrepancy.team.closed_loop import (
    effect_of,
    impossible,
    resimulation_errors,
    scale_of_response,
    why_not,
)
from discrepancy.team.linear.rest import HEALTHY, limits_of
from discrepancy.team.linear.rows import Patches, Reduction, Whitening, whitened
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.start import (
    Sensed,
    as_loud,
    exact_residual,
    is_filed,
    linearised_trials,
    noise_of,
    rested,
    start_shared,
    trial_at,
    without_bases,
)
from discrepancy.team.linear.trial_linear import TrialLinear, with_derivatives
from discrepancy.team.long import LaterPart
from estimator.arm.motion import PHI, TAU, THETA
from estimator.arm.unit import ArmUnit
from estimator.arrays import Array
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording
from estimator.rigid_team import Shared
from mocobot_sim.effects.base import Effect
from mocobot_sim.scene.pymjcf import why_not_composed


@dataclass(frozen=True, eq=False)
class AsFound:
    """Robots, payload and causes as a search found them.

    Attributes:
        units: the robots.
        shared: grasps and payload.
        causes: causes that act in all trials and are not parameters of the robots, with their values.
    """

    units: ArmUnit
    shared: Shared
    causes: list[tuple[Candidate, Array]]

    @classmethod
    def of(cls, units: ArmUnit, shared: Shared, causes: Iterable[tuple[Candidate, Array]]) -> AsFound:
        """Build it from the causes found, without those that ``units`` holds or that act in some trials only."""
        return cls(units, shared, [(c, v) for c, v in causes if places_of(c) is None and not c.of_trials])


@dataclass(frozen=True, eq=False)
class TeamRig:
    """Recordings of one payload, linearised around the best unknowns without any cause, and their simulator.

    Attributes:
        recordings: the trials.
        sensed: effect of sensor noise on the rows.
        linear: linearised trials.
        tolerances: standard deviations by cause and parameter.
        excluded: causes left out of the catalogue.
        origin: linearisation point of the robots, minus their assumed parameters; None for zero.
        resting: for each cause that acts as noise at rest, its spread over its tolerance.
        jobs: parallel processes.
        laws: when to search for unlisted laws: ``auto`` (if the noise is excessive), ``always`` or ``never``.
        kept: cache of the causes' latent states.
    """

    recordings: tuple[Recording, ...]
    sensed: Sensed
    linear: tuple[TrialLinear, ...]
    tolerances: Mapping[str, Mapping[str, float]]
    excluded: frozenset[str]
    origin: ArmUnit | None = None
    resting: Mapping[str, float] = field(default_factory=dict)
    jobs: int = 1
    laws: str = "auto"
    kept: dict[tuple[Any, ...], Any] = field(default_factory=dict, repr=False)

    @classmethod
    def of(
        cls,
        recordings: Sequence[Recording],
        estimate: PayloadEstimate,
        tolerances: Mapping[str, Mapping[str, float]],
        excluded: Sequence[str] = (),
        jobs: int = 1,
    ) -> Self:
        """Linearise recordings around their estimate.

        Raises:
            InputError: the recordings do not determine grasps, mass and centre of mass, or an excluded cause does not
                exist.
        """
        left_out, limits = excluded_from(CAUSES, excluded), limits_of(tolerances, HEALTHY)
        linear, sensed = linearised_trials(recordings, start_shared(estimate), limits, jobs)
        return cls(tuple(recordings), sensed, linear, tolerances, left_out, None, HEALTHY, jobs)

    @property
    def whitening(self) -> tuple[Whitening, ...]:
        """Whitening of each trial."""
        return self.sensed.whitening

    @property
    def trials(self) -> Sequence[str]:
        return [recording.name for recording in self.recordings]

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return self.linear[0].robots

    @property
    def local_unknowns(self) -> int:
        return self.linear[0].by_bases.shape[2]

    @property
    def channels(self) -> Sequence[Channel]:
        """The 6 N channels: pose of each further robot relative to the first, then the wrench balance."""
        out = []
        for i in range(2, self.robots + 1):
            out += [Channel(f"grasp {i} rotation {a}", "kinematic", i, "rad") for a in "xyz"]
            out += [Channel(f"grasp {i} position {a}", "kinematic", i, "m") for a in "xyz"]
        out += [Channel(f"force {a}", "balance", None, "N") for a in "xyz"]
        return out + [Channel(f"moment {a}", "balance", None, "N m") for a in "xyz"]

    def candidates(self) -> list[Candidate]:
        """Every cause of the catalogue at every place, without transients."""
        found = every_candidate(self.robots, self.tolerances, self.excluded)
        return [candidate for candidate in found if not (self.aligned and CAUSES[candidate.cause].by_clocks)]

    @property
    def aligned(self) -> bool:
        """Whether the motion aligned the robots' clocks in every trial."""
        return all(any(s.aligned for s in linear.signals.sampling or ()) for linear in self.linear)

    def columns(self, candidate: Candidate) -> Sequence[Array]:
        return [self._columns(t, candidate) for t in range(len(self.linear))]

    def _columns(self, trial: int, candidate: Candidate) -> Array:
        linear = self.linear[trial]
        if not candidate.acts_in(trial):
            return np.broadcast_to(0.0, (*linear.residual.shape, len(candidate.parameters)))
        columns = whitened(self.whitening[trial], self._unwhitened(trial, candidate))
        rested(linear)
        return columns

    def _unwhitened(self, trial: int, candidate: Candidate) -> Array:
        """Residual per unit of each parameter in a trial, before whitening, shape (n, C, k)."""
        return CAUSES[candidate.cause].columns(self.linear[trial], *indices(candidate), candidate.shape)

    def _without(
        self, trial: int, active: Sequence[tuple[Candidate, Array]], noise: Signals | None = None
    ) -> tuple[Signals, list[tuple[Candidate, Array]]]:
        """Remove signal errors from a trial's signals.

        Args:
            trial: index from 0.
            active: causes with their values.
            noise: sensor noise, which causes that are functions of the readings must not see.

        Returns:
            The corrected signals, and the causes that are not errors of the signals.
        """
        signals, others = self.linear[trial].signals, []
        for candidate, values in active:
            x = noise if noise and CAUSES[candidate.cause].adjusted else None
            seen = signals.minus(x.phi, x.theta, x.tau) if x else signals
            place, own = indices(candidate), self.beyond(candidate, values)
            undo = CAUSES[candidate.cause].undo
            true = undo(seen, self.linear[trial], *place, own, candidate.shape)
            if true is None:
                others.append((candidate, values))
            else:
                signals = signals.minus(seen.phi - true.phi, seen.theta - true.theta, seen.tau - true.tau)
        return signals, others

    def unknowns(self, candidate: Candidate) -> Sequence[Patches]:
        if (key := ("open", *candidate.trace)) in self.kept:
            return self.kept[key]
        of, place = CAUSES[candidate.cause].unknowns, (*indices(candidate), candidate.shape)
        own = [w.of_patches(of(t, *place)).fewer() for w, t in zip(self.whitening, self.linear, strict=True)]
        if not is_filed(self.linear[0]):  # those of long recordings would fill the memory
            self.kept[key] = own
        return own

    def beyond(self, candidate: Candidate, values: Array) -> Array:
        """Values minus those that the linearisation point of the robots already includes."""
        return beyond(candidate, values, self.origin)

    def residual_there(
        self, shared: Array, local: Sequence[Array], active: Sequence[tuple[Candidate, Array]]
    ) -> list[Array]:
        """Exact whitened residual at given values of unknowns and causes, shape (n, C) a trial.

        Args:
            shared: displacement of the shared unknowns.
            local: displacement of each trial's own unknowns.
            active: causes with their values.
        """
        out = []
        for t, (linear, x) in enumerate(zip(self.linear, local, strict=True)):
            acting = [(candidate, values) for candidate, values in active if candidate.acts_in(t)]
            unknowns = linear.shared.moved(shared), linear.bases.moved(x)
            signals, modelled = self._without(t, acting)
            if any(CAUSES[candidate.cause].adjusted for candidate, _ in acting):
                noise = noise_of(signals, *unknowns, linear, self.sensed.signals[t])
                signals, _ = self._without(t, acting, noise)
            residual = exact_residual(signals, *unknowns, linear.arms, linear.reduction)
            residual += as_loud(signals, *unknowns, linear, self.sensed.signals[t])
            for candidate, values in modelled:
                residual -= self._unwhitened(t, candidate) @ self.beyond(candidate, values)
            out.append(self.whitening[t](residual))
            rested(linear)
        return out

    # --- its simulator

    def _context(self, candidate: Candidate) -> Context:
        pi, at = self.linear[0].shared.pi, candidate.transient
        height, trial = self.linear[0].design.home_height_m, None if at is None else at.trial + 1
        return Context(pi[1:4] / pi[0], height, candidate.shape, trial)

    def effects(self, candidate: Candidate, values: Array) -> list[Effect] | None:
        """The simulator's effects, or None if they cannot have such values (a negative play).

        Args:
            candidate: a cause.
            values: of its parameters, counted from the design.
        """
        effect = effect_of(candidate, self.beyond(candidate, values), self._context(candidate))
        return None if effect is None else [effect]

    def can_resimulate(self) -> str | None:
        return next(filter(None, map(why_not, self.recordings)), None) or why_not_composed()

    @property
    def resimulated(self) -> Sequence[int]:
        return [t for t, recording in enumerate(self.recordings) if not isinstance(recording, LaterPart)]

    def carried(self, candidate: Candidate) -> bool:
        return origin_of(candidate, self.origin) is not None

    def robots_of(self, trial: int, healthy: Sequence[tuple[Candidate, Array]]) -> Recording:
        """A trial's recording, with the estimated deviations of its healthy robots in the metadata."""
        recording = self.recordings[trial]
        units = recording.metadata.units
        if not healthy or units is None:
            return recording
        x = units.x.copy()
        for candidate, values in healthy:
            place = places_of(candidate)
            if place is not None:
                x[place] += self.beyond(candidate, values)
        known = replace(recording.metadata, units=ArmUnit(units.design, x))
        return replace(recording, metadata=known)

    def of_healthy(
        self, trial: int, causes: Sequence[Candidate], healthy: Sequence[tuple[Candidate, Array]]
    ) -> list[Effect]:
        """Effects of healthy parts, except for causes and for what ``robots_of`` already includes."""
        there = {candidate.key for candidate in causes}
        as_designed = self.recordings[trial].metadata.units is None
        effects: list[Effect] = []
        for candidate, values in healthy:
            if (as_designed or places_of(candidate) is None) and candidate.key not in there:
                # Skip unphysical values.
                effects += self.effects(candidate, values) or []
        return effects

    def simulation(
        self, trial: int, shared: Array, local: Array, active: Sequence[tuple[Candidate, Array]],
        healthy: Sequence[tuple[Candidate, Array]] = (), laws: Sequence[Effect] = (),
    ) -> Callable[[], dict[str, Array] | None]:  # fmt: skip
        """Make a function that simulates one trial's commands with displaced unknowns and with causes.

        The function returns recorded minus simulated ``phi``, ``theta`` [rad] and ``tau`` [N m], shape (Q, N, 3), or
        None if the simulation is impossible. It only holds the recording and numbers, so that it can run in another
        process.
        """
        linear = self.linear[trial]
        effects = [*laws]
        for candidate, values in active:
            own = self.effects(candidate, values)
            if own is None:
                return impossible
            effects += own
        effects += self.of_healthy(trial, [candidate for candidate, _ in active], healthy)
        return partial(
            resimulation_errors,
            self.robots_of(trial, healthy),
            linear.shared.moved(shared),
            linear.bases.moved(local),
            effects,
            trial + 1,
            linear.signals.keep,
        )

    def left_in(self, recording: Recording, found: AsFound) -> tuple[Reduction, Array]:
        """Residual rows of another recording of the team, shape (n, C), with its bases fitted.

        Args:
            recording: of the same payload, with the assumed robots in its metadata.
            found: robots, payload, and causes that act in every trial.
        """
        units, shared = found.units, found.shared
        known = replace(recording, metadata=replace(recording.metadata, units=units))
        trial = trial_at(known, shared, self.sensed.noise)
        own = replace(self, recordings=(known,), linear=(trial,), kept={})
        signals, others = own._without(0, found.causes)
        rows = trial.residual
        if signals is not trial.signals:
            rows = exact_residual(signals, shared, trial.bases, units, trial.reduction)
        if others:
            own = replace(own, linear=(with_derivatives(trial),))
            rows = rows - sum(own._unwhitened(0, candidate) @ values for candidate, values in others)
        return trial.reduction, without_bases(trial, rows)

    def response_scale(self, trial: int) -> dict[str, tuple[Array, Array]]:
        """Standard deviation of the noise and of the motion, by channel, shape (N, 3) each."""
        return scale_of_response(self.sensed.noise, self.linear[trial].signals)

    def quantities(self, trial: int) -> dict[str, Array]:
        """RMS over robots and axes of grasp velocity [m/s], displacement [m] and torque [N m], shape (n,) each."""
        linear = self.linear[trial]
        at = linear.reduction.sample
        velocity, h = linear.data.twist[at, :, 3:], linear.data.p_bi[at]
        each = {"speed": velocity, "position": h - h.mean(axis=0), "load": linear.s[at, :, TAU]}
        return {name: np.sqrt(np.mean(x**2, axis=(1, 2))) for name, x in each.items()}

    def row_rate_hz(self, trial: int) -> float:
        return self.linear[trial].signals.rate_hz / self.linear[trial].reduction.step

    def directions(self, trial: int) -> dict[str, Array]:
        """Unit directions of every spring torque and angle in the whitened rows, shape (n, C, 1) each."""
        out, linear, white = {}, self.linear[trial], self.whitening[trial].rows_only
        for robot in range(self.robots):
            J = linear.J.at(robot, slice(None), linear.reduction.sample)
            for k in range(3):
                for kind, name in ((TAU, f"torque channel {k + 1}"), (PHI, f"driven angle {k + 1}"),
                                   (THETA, f"gimbal angle {'zyx'[k]}")):  # fmt: skip
                    x = white(J[:, :, kind][..., k])
                    size = np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300)
                    out[f"robot {robot + 1}'s {name}"] = (x / size)[..., None]
        return out

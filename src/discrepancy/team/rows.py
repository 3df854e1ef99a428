"""A team of Omnids, seen by its rows: from recordings to a whitened residual and the columns of every cause."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.causes.excluded import excluded_from
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.least_squares.patches import Patches
from discrepancy.least_squares.stored import stored
from discrepancy.least_squares.whitening import Whitening, whitened
from discrepancy.rig import Channel, Rig, Rows
from discrepancy.team.candidates import (
    every_candidate,
    explained_by,
    further_shapes,
    indices,
    is_adjusted,
    is_kept,
    other_shapes,
    shape_steps,
    worst_events,
)
from discrepancy.team.causes import CAUSES
from discrepancy.team.channels import channels_of, groups_of
from discrepancy.team.imitators import wrong_torques
from discrepancy.team.linear.adjust import as_loud, noise_of
from discrepancy.team.linear.elsewhere import HEALTHY, found_at, resting_of
from discrepancy.team.linear.filed import OneByOne, is_filed, rested
from discrepancy.team.linear.origin import beyond, origin_of
from discrepancy.team.linear.rest import limits_of
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.start import Sensed, exact_residual, linearised_trials, sensed_in, start_shared
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arm.unit import ArmUnit
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording
from estimator.rigid_team.residual import Shared


@dataclass(frozen=True, eq=False)
class TeamRows(Rig):
    """Recordings of one payload, linearised around the best unknowns without any cause.

    Attributes:
        recordings: the trials.
        sensed: what noise leaves in the rows.
        linear: linearised trials.
        tolerances: standard deviations by cause and parameter.
        excluded: causes left out of the catalogue.
        origin: how far from the robots as they were believed to be all is linear; None for not at all.
        resting: spread over its tolerance of each kind that leaves something open, such as friction at rest: noise.
        jobs: parallel processes.
        missed, beside, rewhitened: as of ``Rig``.
        laws: whether to look for what no table lists: where noise is loud (``auto``), ``always`` or ``never``.
        kept: whitened columns that are asked for again and again.
    """

    recordings: tuple[Recording, ...]
    sensed: Sensed
    linear: tuple[TrialLinear, ...]
    tolerances: Mapping[str, Mapping[str, float]]
    excluded: frozenset[str]
    origin: ArmUnit | None = None
    resting: Mapping[str, float] = field(default_factory=dict)
    jobs: int = 1
    missed: float = 0.0
    beside: bool = False
    rewhitened: bool = False
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
            InputError: the recordings do not determine the grasps, the mass and the centre of mass, or a cause to
                be excluded does not exist.
        """
        left_out = excluded_from(CAUSES, excluded)
        return cls._at(recordings, start_shared(estimate), tolerances, left_out, None, HEALTHY, jobs)

    @classmethod
    def _at(
        cls,
        recordings: Sequence[Recording],
        shared: Shared,
        tolerances: Mapping[str, Mapping[str, float]],
        excluded: frozenset[str],
        origin: ArmUnit | None,
        resting: Mapping[str, float],
        jobs: int,
        sensed: Sensed | None = None,
        explained: Callable[[int, TrialLinear], Array] | None = None,
    ) -> Self:
        limits = limits_of(tolerances, resting)
        linear, known = linearised_trials(recordings, shared, limits, jobs, sensed, explained)
        return cls(tuple(recordings), known, linear, tolerances, excluded, origin, resting, jobs)

    @property
    def whitening(self) -> tuple[Whitening, ...]:
        """Of every trial."""
        return self.sensed.whitening

    def relinearised(self, found: Hypothesis) -> Self | None:
        """The rig at the robots as a fit finds them, with its causes, where straight columns do not reach that far."""
        try:
            there = found_at(self.linear, self.whitening, found, self.origin)
        except InputError:  # no such robots: what acts on these is something else
            return None
        resting = resting_of(found)
        same = all(0.5 < resting[kind] / self.resting[kind] < 2.0 for kind in resting)
        near = rules.STRAIGHT_BESIDE_CHI2_PER_N if found.free else rules.STRAIGHT_CHI2_PER_N
        straight = there.curvature < near
        if straight and same:
            return None
        sensed, limits = self.sensed, limits_of(self.tolerances, resting)
        if not same:  # what noise leaves where what rests scatters so; the sensors are the same
            sensed = sensed_in(self.linear, self.sensed.noise, limits, self.jobs, sensed)
        resting = self.resting if same else resting
        if straight:  # robots and unknowns stay
            return replace(
                self, sensed=sensed, resting=resting, kept={}, missed=there.curvature, rewhitened=True
            )
        moved = [replace(r, metadata=replace(r.metadata, units=there.units)) for r in self.recordings]
        known = there.origin, resting, self.jobs, sensed, explained_by(found.fit.active, there.origin)
        rig = self._at(moved, there.shared, self.tolerances, self.excluded, *known)
        return replace(rig, missed=there.curvature, beside=bool(found.free), rewhitened=not same)

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
        return channels_of(self.robots)

    def candidates(self) -> list[Candidate]:
        """Every cause of the catalogue at every place; transients come from ``transients``."""
        found = every_candidate(self.robots, self.tolerances, self.excluded)
        return [candidate for candidate in found if not (self.aligned and CAUSES[candidate.cause].by_clocks)]

    @property
    def aligned(self) -> bool:
        """Whether the motion has set the robots' clocks in every trial."""
        return all(any(s.aligned for s in linear.signals.sampling or ()) for linear in self.linear)

    def columns(self, candidate: Candidate) -> Sequence[Array]:
        return self._each(lambda t: self._columns(t, candidate), len(self.linear))

    def _each(self, of: Callable[[int], Array], count: int) -> Sequence[Array]:
        """Arrays by their number; of long recordings each whenever it is asked for."""
        return OneByOne(of, count) if is_filed(self.linear[0]) else list(map(of, range(count)))

    def _columns(self, trial: int, candidate: Candidate) -> Array:
        linear = self.linear[trial]
        if not candidate.acts_in(trial):
            return np.broadcast_to(0.0, (*linear.residual.shape, len(candidate.parameters)))
        if (key := (trial, *candidate.trace)) in self.kept:
            return self.kept[key]
        columns = whitened(self.whitening[trial], self._unwhitened(trial, candidate))
        rested(linear)
        if candidate.transient is None and is_kept(candidate):
            self.kept[key] = stored(columns) if is_filed(linear) else columns
        return columns

    def _unwhitened(self, trial: int, candidate: Candidate) -> Array:
        """What one unit of each parameter adds to a trial's residual, shape (n, C, k)."""
        return CAUSES[candidate.cause].columns(self.linear[trial], *indices(candidate), candidate.shape)

    def _is_adjusted(self, candidate: Candidate) -> bool:
        return is_adjusted(candidate)

    def _undo(self, trial: int, candidate: Candidate, values: Array, signals: Signals) -> Signals | None:
        """A trial's signals as they would be without a cause, or None where it is not an error of the signals."""
        place, own = indices(candidate), self.beyond(candidate, values)
        return CAUSES[candidate.cause].undo(signals, self.linear[trial], *place, own, candidate.shape)

    def _without(
        self, trial: int, active: Sequence[tuple[Candidate, Array]], noise: Signals | None = None
    ) -> tuple[Signals, list[tuple[Candidate, Array]]]:
        """A trial's signals without causes that are errors of them, functions of them without noise; and others."""
        signals, others = self.linear[trial].signals, []
        for candidate, values in active:
            x = noise if noise and self._is_adjusted(candidate) else None
            seen = signals.minus(x.phi, x.theta, x.tau) if x else signals
            true = self._undo(trial, candidate, values, seen)
            if true is None:
                others.append((candidate, values))
            else:
                signals = signals.minus(seen.phi - true.phi, seen.theta - true.theta, seen.tau - true.tau)
        return signals, others

    def possible(self, candidate: Candidate, values: Array, covariance: Array) -> bool:
        """Whether such values can be: no negative stiffness or friction, no mass that swings outside the payload."""
        se = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        return CAUSES[candidate.cause].possible(values, se, candidate.shape)

    def unknowns(self, candidate: Candidate) -> Sequence[Patches]:
        if (key := ("open", *candidate.trace)) in self.kept:
            return self.kept[key]
        of, place = CAUSES[candidate.cause].unknowns, (*indices(candidate), candidate.shape)
        own = [w.of_patches(of(t, *place)).fewer() for w, t in zip(self.whitening, self.linear, strict=True)]
        if not is_filed(self.linear[0]):  # of long recordings they would fill the memory
            self.kept[key] = own
        return own

    def rows(self, candidates: Sequence[Candidate]) -> Iterator[Rows]:
        for t, linear in enumerate(self.linear):
            causes = self._each(lambda k, t=t: self._columns(t, candidates[k]), len(candidates))
            residual = self.whitening[t](linear.residual)
            for k, candidate in enumerate(candidates):
                there = origin_of(candidate, self.origin)
                residual += 0.0 if there is None else causes[k] @ there
            local = np.concatenate([linear.by_bases, linear.by_clocks], axis=2)
            yield Rows(
                self.recordings[t].name, residual, self.whitening[t](local), self.whitening[t](linear.by_shared),
                causes, linear.reduction.time, linear.reduction.moving, groups_of(self.robots),
            )  # fmt: skip

    def _at_origin(self, trial: int, candidate: Candidate) -> Array | float:
        """What the robots, as they were found, have of it: out of the residual, for values count from the design."""
        there = origin_of(candidate, self.origin)
        return 0.0 if there is None else self._columns(trial, candidate) @ there

    def _all_at_origin(self, trial: int) -> Array:
        """The same of all candidates, shape (n, C)."""
        key = (trial, "origin")
        if key not in self.kept:
            self.kept[key] = np.zeros(self.linear[trial].residual.shape)
            self.kept[key] += sum(self._at_origin(trial, c) for c in self.candidates())
        return self.kept[key]

    def beyond(self, candidate: Candidate, values: Array) -> Array:
        """Values beyond what the robots, as they were found, have already."""
        return beyond(candidate, values, self.origin)

    def residual(
        self, shared: Array, local: Sequence[Array], active: Sequence[tuple[Candidate, Array]]
    ) -> list[Array]:
        there = {candidate.key for candidate, _ in active}
        left = self.residual_there(shared, local, active)
        return [
            x
            + self._all_at_origin(t)
            - sum(self._at_origin(t, c) for c in self.candidates() if c.key in there)
            for t, x in enumerate(left)
        ]

    def residual_there(
        self, shared: Array, local: Sequence[Array], active: Sequence[tuple[Candidate, Array]]
    ) -> list[Array]:
        """The exact whitened residual where all is linear: what the robots are off by is in none of it."""
        out = []
        for t, (linear, x) in enumerate(zip(self.linear, local, strict=True)):
            acting = [(candidate, values) for candidate, values in active if candidate.acts_in(t)]
            unknowns = linear.shared.moved(shared), linear.bases.moved(x)
            signals, modelled = self._without(t, acting)
            if any(self._is_adjusted(candidate) for candidate, _ in acting):
                noise = noise_of(signals, *unknowns, linear, self.sensed.signals[t])
                signals, _ = self._without(t, acting, noise)
            residual = exact_residual(signals, *unknowns, linear.arms, linear.reduction)
            residual += as_loud(signals, *unknowns, linear, self.sensed.signals[t])
            for candidate, values in modelled:
                residual -= self._unwhitened(t, candidate) @ self.beyond(candidate, values)
            out.append(self.whitening[t](residual))
            rested(linear)
        return out

    def refinements(self, candidate: Candidate, *, finer: bool = False) -> list[Candidate]:
        """The candidate with every other shape of its cause; any interval of a transient is found by its steps."""
        return other_shapes(candidate, len(self.linear), finer=finer)

    def further(self, candidate: Candidate) -> list[Candidate]:
        return further_shapes(candidate, len(self.linear))

    def transients(self, remaining: Sequence[Array]) -> list[Candidate]:
        """Pushes at the intervals where the wrench balance is worst."""
        reductions = [linear.reduction for linear in self.linear]
        return worst_events(reductions, remaining, self.tolerances, self.excluded)

    def imitators(self, candidate: Candidate) -> Iterable[list[Array]]:
        """One joint's torque wrong by a constant for as long as a push lasts, every joint in turn."""
        return wrong_torques(self.linear, self.whitening, candidate)

    def steps(self, candidate: Candidate) -> list[tuple[Candidate, Candidate, float]]:
        return shape_steps(candidate)

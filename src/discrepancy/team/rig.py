"""A team of Omnids as a rig: its rows, and how to simulate it again."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.engine.explanation import Explanation
from discrepancy.engine.gain import fit_to_simulate
from discrepancy.laws.candidate import LawCandidate
from discrepancy.team.candidates import in_shapes, law_errors
from discrepancy.team.causes import CAUSES
from discrepancy.team.causes.base import Context
from discrepancy.team.causes.sliding import KEPT
from discrepancy.team.closed_loop import (
    effect_of,
    impossible,
    named_effects,
    posture,
    resimulation_errors,
    scale_of_response,
    team_of,
    why_not,
)
from discrepancy.team.dependence import directions_of, quantities_of
from discrepancy.team.laws.effects import effects_of
from discrepancy.team.laws.rows import LawfulRows
from discrepancy.team.linear.elsewhere import found_at
from discrepancy.team.linear.origin import origin_of, places_of
from discrepancy.team.linear.reduction import Reduction
from discrepancy.team.linear.start import exact_residual
from discrepancy.team.linear.unsearched import trial_at, without_bases
from discrepancy.team.long.parts import LaterPart
from discrepancy.team.undecidable import statements
from estimator.arm.unit import ArmUnit
from estimator.arrays import Array
from estimator.recording.model import Recording
from estimator.rigid_team.residual import Shared
from mocobot_sim.effects.base import Effect
from mocobot_sim.extended.extended import write_extended
from mocobot_sim.scene.pymjcf import why_not_composed


@dataclass(frozen=True, eq=False)
class AsFound:
    """What a search found.

    Attributes:
        units: the robots.
        shared: grasps and payload.
        causes: the others with their values.
    """

    units: ArmUnit
    shared: Shared
    causes: list[tuple[Candidate, Array]]

    @classmethod
    def of(cls, units: ArmUnit, shared: Shared, causes: Iterable[tuple[Candidate, Array]]) -> AsFound:
        """With those causes that are not the robots' own and not of some trials alone."""
        return cls(units, shared, [(c, v) for c, v in causes if places_of(c) is None and not c.of_trials])


class TeamRig(LawfulRows):
    """Recordings of one payload, linearised around the best unknowns without any cause, and their simulator."""

    reshaped = ("sea_hysteresis", "grasp_flex")
    coarse = ("tether", "payload_tether")
    plain_first = ("slosh",)
    more_share: ClassVar = {"base_creep": rules.CREEP_START_SHARE}
    behind = ("grasp_play",)
    whole = True
    apart = (KEPT,)

    def effect_parameters(
        self, candidate: Candidate, values: Array, covariance: Array
    ) -> tuple[dict[str, float], dict[str, float]]:
        if isinstance(candidate, LawCandidate):
            return super().effect_parameters(candidate, values, covariance)
        return CAUSES[candidate.cause].report(values, covariance, self._context(candidate))

    def grown(self, candidate: Candidate) -> list[Candidate]:
        if candidate.transient or candidate.cause not in CAUSES:
            return []
        return in_shapes(candidate, CAUSES[candidate.cause].grown(candidate.shape), len(self.linear))

    def recentred(self, candidate: Candidate, values: Array) -> Candidate:
        if candidate.transient or candidate.cause not in CAUSES:
            return candidate
        return replace(candidate, shape=dict(CAUSES[candidate.cause].recentred(values, candidate.shape)))

    def law_error(self, candidate: Candidate, values: Array) -> Array:
        if isinstance(candidate, LawCandidate):
            return super().law_error(candidate, values)
        return law_errors(candidate, values)

    def _context(self, candidate: Candidate) -> Context:
        pi, at = self.linear[0].shared.pi, candidate.transient
        height, trial = self.linear[0].design.home_height_m, None if at is None else at.trial + 1
        return Context(pi[1:4] / pi[0], height, candidate.shape, trial)

    def effects(self, candidate: Candidate, values: Array) -> list[Effect] | None:
        """The simulator's effects, or None where the values are none that they can have (a negative play).

        Args:
            candidate: a cause, which is one effect, or a law, which has one for each component of its place.
            values: of its parameters, counted from the design.
        """
        if isinstance(candidate, LawCandidate):
            return effects_of(candidate, values)
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
        """The recording of a trial with its robots off by as much as they are found beside the causes."""
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
        """What healthy parts are as effects, beside causes: those that ``robots_of`` does not have."""
        there = {candidate.key for candidate in causes}
        as_designed = self.recordings[trial].metadata.units is None
        effects: list[Effect] = []
        for candidate, values in healthy:
            if (as_designed or places_of(candidate) is None) and candidate.key not in there:
                # Of what is found to be less than nothing there is nothing.
                effects += self.effects(candidate, values) or []
        return effects

    def simulation(
        self, trial: int, shared: Array, local: Array, active: Sequence[tuple[Candidate, Array]],
        healthy: Sequence[tuple[Candidate, Array]] = (), laws: Sequence[Effect] = (),
    ) -> Callable[[], dict[str, Array] | None]:  # fmt: skip
        """What resimulates one trial's commands, with the unknowns moved and causes in the simulation.

        It returns recorded minus simulated ``phi``, ``theta`` [rad] and ``tau`` [N m], shape (Q, N, 3), or None if
        that cannot be simulated. It carries the recording and numbers only, so that processes can take it.
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

    def as_found(self, explanation: Explanation) -> AsFound:
        """Robots, payload and causes as they were found.

        Raises:
            InputError: there are no such robots.
        """
        there = found_at(self.linear, self.whitening, explanation.hypothesis, self.origin)
        causes = ((found.candidate, found.values) for found in explanation.found)
        return AsFound.of(there.units, there.shared, causes)

    def left_in(self, recording: Recording, found: AsFound) -> tuple[Reduction, Array]:
        """Rows that another recording of the team leaves, shape (n, C), its bases where they leave the least.

        Args:
            recording: of the same payload, its units as they were believed to be.
            found: robots, payload, and causes that are not of one trial alone.
        """
        units, shared = found.units, found.shared
        known = replace(recording, metadata=replace(recording.metadata, units=units))
        trial = trial_at(known, shared, self.sensed.noise, full=False)
        own = replace(self, recordings=(known,), linear=(trial,), kept={})
        signals, others = own._without(0, found.causes)
        rows = exact_residual(signals, shared, trial.bases, units, trial.reduction)
        if others:
            own = replace(own, linear=(trial_at(known, shared, self.sensed.noise, full=True),))
            rows -= sum(own._unwhitened(0, candidate) @ values for candidate, values in others)
        return trial.reduction, without_bases(trial, rows)

    def response_scale(self, trial: int) -> dict[str, tuple[Array, Array]]:
        """Standard deviation of the noise and of the motion, by channel, shape (N, 3) each."""
        return scale_of_response(self.sensed.noise, self.linear[trial].signals)

    def write_extended(self, explanation: Explanation, folder: Path) -> None:
        """Write the estimated team with the named causes in it; ``mocobot simulate --model`` takes it.

        Raises:
            InputError: the folder cannot be written, or a cause has values that no effect can have.
        """
        self._write(explanation, folder, whole=False)

    def write_as_found(self, explanation: Explanation, folder: Path) -> None:
        """Write the same with every healthy part as it is found, within its tolerance, too.

        Raises:
            InputError: as ``write_extended``.
        """
        self._write(explanation, folder, whole=True)

    def _write(self, explanation: Explanation, folder: Path, *, whole: bool) -> None:
        effects: list[Effect] = []
        for found in explanation.found:
            effects += named_effects(found.candidate, self.effects(found.candidate, found.values))
        fit, healthy = fit_to_simulate(self, explanation.problem, explanation.fit.free, whole=whole)
        causes = [found.candidate for found in explanation.found]
        parts = self.of_healthy(0, causes, healthy) if whole else []
        shared = self.linear[0].shared.moved(-fit.shared)
        bases = self.linear[0].bases.moved(-fit.local(0)[: self.local_unknowns])
        scene = team_of(shared, bases, [*effects, *parts], *posture(self.robots_of(0, healthy)))
        told = {"recordings": list(self.trials), "causes": [cause.label for cause in causes]}
        write_extended(scene, effects, folder, told, parts)

    def undecidable(self) -> list[dict[str, Any]]:
        """What recordings of a parked team with a rigid payload cannot decide."""
        return statements(self.robots, aligned=self.aligned)

    def quantities(self, trial: int) -> dict[str, Array]:
        """Speed of the payload [m/s], its distance from where it started [m], load [N m]: shape (n,) each."""
        return quantities_of(self.linear[trial])

    def row_rate_hz(self, trial: int) -> float:
        return self.linear[trial].signals.rate_hz / self.linear[trial].reduction.step

    def directions(self, trial: int) -> dict[str, Array]:
        """Directions of every spring torque and every gimbal axis, from the linearisation."""
        return directions_of(self.linear[trial], self.whitening[trial])

"""Test causes in closed loop: simulate the recorded commands again, which is evidence beyond the residual rows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from discrepancy.candidate import Candidate
from discrepancy.evidence.parts import Parts
from discrepancy.evidence.posterior import Group
from discrepancy.evidence.probability import Odds, Rival
from discrepancy.evidence.search import Chosen, Key, Search, State
from discrepancy.formulas.law import Law
from discrepancy.numbers import three_digits
from discrepancy.result.remains import VISIBLE_CHI2_PER_N
from discrepancy.team.closed_loop import (
    MARGIN_SHARE,
    Gain,
    Response,
    is_worse,
    mean_chi2,
    named_effects,
    posture,
    team_of,
)
from discrepancy.team.diagnose import TeamOutcome, found_in, robots_at
from discrepancy.team.linear.rows import Reduction
from discrepancy.team.problem import TeamProblem
from discrepancy.team.rig import AsFound, TeamRig
from discrepancy.team.verdict import parts_of
from estimator.arrays import Array
from estimator.files import ends_with_this
from estimator.recording.model import Recording
from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.law import Law as LawEffect
from mocobot_sim.extended.extended import write_extended

TOLD_NATS = 5.0
"""Log odds for the cause with a better simulated response, if it is better by the margin. Chosen."""
CONTRADICTED = 0.5
"""Factor on the probability of causes that make the response worse. Chosen: as likely wrong as right."""
Active = list[tuple[Candidate, Array]]
"""Candidates and the values of their parameters."""


@dataclass(frozen=True, eq=False)
class Told:
    """Values for the simulation of a trial, fitted to other trials.

    Attributes:
        shared, local: displacements of the unknowns that all trials share, and of this trial's own.
        active: causes.
        healthy: other parts, with their deviations.
        laws: effects of unlisted laws.
    """

    shared: Array
    local: Array
    active: Active
    healthy: Active
    laws: Sequence[Effect]


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of causes in a linear problem.

    Attributes:
        problem: with the columns of the set.
        state: the set.
        whole: whether a simulation includes the deviations of all healthy parts, within their tolerances. Otherwise it
            includes only parts that deviate from the design at the linearisation point.
    """

    problem: TeamProblem
    state: State
    whole: bool = False

    @property
    def rig(self) -> TeamRig:
        """The recordings."""
        return self.problem.rig

    @cached_property
    def causes(self) -> list[tuple[Candidate, Group]]:
        """The listed causes of the set."""
        known = self.problem.candidates
        groups = [c.group for c in self.state.chosen if c.group.identity in known]
        return [(known[g.identity], g) for g in groups]

    @cached_property
    def laws(self) -> list[tuple[Group, Law]]:
        """The unlisted laws of the set, with formulas fitted to all trials."""
        out, p = [], self.state.posterior
        for group in (c.group for c in self.state.chosen if c.group.late):
            k = list(group.columns)
            fit = p.mean[k], p.covariance[np.ix_(k, k)], p.prior[k]
            out.append((group, self.problem.laws_of.told(group, *fit)))
        return out

    @property
    def of_trials(self) -> bool:
        """Whether a cause acts in some trials only, so that the other trials cannot predict it."""
        return any(candidate.of_trials for candidate, _ in self.causes)

    @cached_property
    def carried(self) -> dict[int, list[int]]:
        """Columns of each healthy part that a simulation includes, by the identity of its candidate."""
        there = {candidate.key for candidate, _ in self.causes}
        out: dict[int, list[int]] = {}
        for k, label in enumerate(self.problem.labels):
            if label and label[0].key not in there and (self.whole or self.rig.carried(label[0])):
                out.setdefault(id(label[0]), []).append(k)
        return out

    @cached_property
    def parts(self) -> Parts:
        """Normal equations of every trial."""
        return parts_of(self.problem, self.state)

    def _is(self, columns: Iterable[int]) -> NDArray[np.bool_]:
        """Mask of the active columns that are among some, shape (K,)."""
        return np.isin(self.parts.active, list(columns))

    def told(self, trial: int | None) -> Told:
        """Fit the values for the simulation of a trial to the other trials, and its own unknowns to itself.

        With a single trial, or if a cause acts in some trials only, all trials enter the fit.

        Args:
            trial: index of the trial; None fits to all trials.
        """
        p, parts = self.problem, self.parts
        others = parts.others(None if self.of_trials else trial)
        prior, x = self.state.posterior.prior[parts.active], np.zeros(len(parts.active))
        # Fit healthy parts and laws together with everything else.
        beside = [*self.carried.values(), *(group.columns for group, _ in self.laws)]
        if beside:
            x = np.where(self._is(k for own in beside for k in own), parts.step(x, prior, others), 0.0)
        # Then fit causes and unknowns with these fixed and all other parts as designed.
        causes = (group.columns for _, group in self.causes)
        alone = self._is(k for own in (p.shared, *p.local, *causes) for k in own)
        x = parts.step(x, np.where(alone, prior, 0.0), others)
        if trial is not None:
            local = self._is(p.local[trial])
            x = parts.step(np.where(local, 0.0, x), np.where(local, prior, 0.0), [trial])
        every = np.zeros(p.cells.count)
        every[parts.active] = x
        active = [(candidate, p.values_of(group, every)) for candidate, group in self.causes]
        laws = [
            LawEffect(**piece)
            for group, law in self.laws
            for piece in p.laws_of.pieces(group, law, every[list(group.columns)])
        ]
        local_values = -every[p.local[trial or 0]][: self.rig.local_unknowns]
        return Told(-every[p.shared], local_values, active, self._healthy(every), laws)

    def _healthy(self, x: Array) -> Active:
        out = []
        for columns in self.carried.values():
            labels = [label for label in (self.problem.labels[k] for k in columns) if label]
            values = np.zeros(len(labels[0][0].parameters))
            values[[n for _, n in labels]] = x[columns]
            out.append((labels[0][0], values))
        return out


def responses(
    hypotheses: Sequence[Hypothesis], jobs: int = 1, simulated: Callable[[int], object] | None = None
) -> list[tuple[Response | None, ...]]:
    """Simulate every trial under every hypothesis, with unknowns and causes fitted to the other trials.

    Args:
        hypotheses: about the same recordings.
        jobs: parallel processes.
        simulated: called with 1 for every simulated trial.
    """
    tasks = [(h.rig, t, h.told(t)) for h in hypotheses for t in h.rig.resimulated]
    run = Parallel(n_jobs=jobs, return_as="generator", **ends_with_this())
    simulations = (
        delayed(rig.simulation(t, told.shared, told.local, told.active, told.healthy, told.laws))()
        for rig, t, told in tasks
    )
    done = []
    for errors, (rig, t, _) in zip(run(simulations), tasks, strict=True):
        done.append(None if errors is None else Response.of(errors, rig.response_scale(t)))
        if simulated:
            simulated(1)
    each = iter(done)
    return [tuple(next(each) for _ in h.rig.resimulated) for h in hypotheses]


@dataclass(frozen=True, eq=False)
class Confirmed:
    """Result of the closed-loop test of a set of causes.

    Attributes:
        outcome: the search result; a rival replaces a cause if it responds better.
        odds: of the causes, updated by the closed loop.
        gain: responses without and with the causes.
        tried: mean chi-square per number with a rival in a cause's place, by the keys of cause and rival.
        contradicted: whether the causes make the response worse.
        notes: sentences about a replaced or contradicted cause.
    """

    outcome: TeamOutcome
    odds: tuple[Odds, ...]
    gain: Gain
    tried: Mapping[tuple[Key, Key], float]
    contradicted: bool
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Swap:
    """A rival in the place of a cause.

    Attributes:
        odds: of the cause.
        rival: the group that replaces it.
    """

    odds: Odds
    rival: Group

    @property
    def own(self) -> Group:
        """The cause."""
        return self.odds.chosen.group

    def state(self, search: Search, near: State) -> State:
        """The set with the rival instead of the cause; missing columns are added to the problem."""
        rest = [c for c in near.chosen if c is not self.odds.chosen]
        return search.with_one(rest, Chosen(self.rival, self.odds.chosen.scale), near.posterior)


def confirm(
    outcome: TeamOutcome,
    odds: Sequence[Odds],
    jobs: int = 1,
    simulated: Callable[[int], object] | None = None,
) -> Confirmed:
    """Simulate without causes, with them, and with each rival that the rows cannot distinguish from a cause.

    Args:
        outcome: of a search; its rig can simulate.
        odds: of the named causes; other causes of the set are not simulated.
        jobs: parallel processes.
        simulated: called with 1 for every simulated trial.
    """
    search, problem = outcome.search, outcome.problem
    others = tuple(o for o in odds if o.chosen.group.identity not in problem.candidates)
    odds = [o for o in odds if o not in others]
    unlisted = [o.chosen for o in others]
    chosen = [*(o.chosen for o in odds), *unlisted]
    plain = outcome.nothing[0].problem
    assert isinstance(plain, TeamProblem)
    nothing = Hypothesis(plain, outcome.nothing[1])
    trials = len(problem.local)
    if not chosen:
        (before,) = responses([nothing], jobs, simulated)
        gain = _with_all_as_found(Gain(before, before, trials > 1), nothing, jobs, simulated)
        return Confirmed(outcome, others, gain, {}, contradicted=False, notes=())
    state, count, swaps = _only(outcome, chosen), problem.cells.count, list(_swaps(outcome, odds))
    named = Hypothesis(problem, state)
    swapped = [Hypothesis(problem, swap.state(search, state)) for swap in swaps]
    before, after, *each = responses([nothing, named, *swapped], jobs, simulated)
    problem.cells.truncate(count)
    values = {(swap.own.key, swap.rival.key): mean_chi2(r) for swap, r in zip(swaps, each, strict=True)}
    first, tried, notes = mean_chi2(after), dict(values), []
    winner = min(swaps, key=lambda swap: values[swap.own.key, swap.rival.key], default=None)
    best = first if winner is None else values[winner.own.key, winner.rival.key]
    if winner and best < first * (1.0 - MARGIN_SHARE):
        cause, rival = (problem.candidates[g.identity].label for g in (winner.own, winner.rival))
        notes.append(
            f"The rows alone could not tell {cause} from {rival}; in closed loop the latter does better "
            f"(chi2/n {three_digits(best)} against {three_digits(first)})."
        )
        after = each[swaps.index(winner)]
        outcome, odds = _exchanged(outcome, odds, winner)
        now = winner.rival.key
        tried = {(now if a == winner.own.key else a, b): x for (a, b), x in values.items() if b != now}
        tried[now, winner.own.key] = first
        state = _only(outcome, [*(o.chosen for o in odds), *unlisted])
    else:
        best = first
    none = mean_chi2(before)
    contradicted = is_worse(best, none)
    if contradicted:
        loop = (
            f"makes the response to the commands worse (chi2/n {three_digits(none)} to {three_digits(best)})"
            if np.isfinite(best)
            else "cannot be simulated with the recorded commands"
        )
        known = problem.candidates
        labels = ", ".join(
            known[c.group.identity].label if c.group.identity in known else c.group.name for c in chosen
        )
        notes.append(f"{labels[:1].upper()}{labels[1:]}: {loop}, which speaks against it.")
    worse = {pair for pair, x in tried.items() if x > best * (1.0 + MARGIN_SHARE)}
    odds = [_revised(o, worse, CONTRADICTED if contradicted else 1.0) for o in odds]
    final = Hypothesis(problem, state)
    gain = Gain(before, after, trials > 1 and not final.of_trials)
    gain = _with_all_as_found(gain, final, jobs, simulated)
    return Confirmed(outcome, (*odds, *others), gain, tried, contradicted, tuple(notes))


def _only(outcome: TeamOutcome, chosen: Sequence[Chosen]) -> State:
    """Reduce the set to some of its causes."""
    state = outcome.state
    return state if len(chosen) == len(state.chosen) else outcome.search.value(chosen, state.posterior)


def _swaps(outcome: TeamOutcome, odds: Sequence[Odds]) -> Iterator[_Swap]:
    """Rivals that the rows cannot distinguish from a cause, except for events, which belong to a single trial."""
    there = {o.chosen.group.key for o in odds}
    for o in odds:
        for group in o.told():
            if (
                group
                and group.identity in outcome.problem.candidates
                and not group.event
                and group.key not in there
            ):
                yield _Swap(o, group)


def _exchanged(outcome: TeamOutcome, odds: Sequence[Odds], swap: _Swap) -> tuple[TeamOutcome, list[Odds]]:
    """Replace a cause by its rival in outcome and odds; the rival inherits most of their joint probability."""
    search = outcome.search
    state = search.settled(search.formed(swap.state(search, outcome.state)))
    out = []
    for o in odds:
        own = next(
            c for c in state.chosen if c.group.key == (swap.rival if o is swap.odds else o.chosen.group).key
        )
        if o is swap.odds:
            rivals = tuple(r for r in o.rivals if r.group is None or r.group.key != swap.rival.key)
            least = math.exp(-TOLD_NATS)
            both = 1.0 - sum(r.probability for r in rivals)
            rivals += (Rival(swap.own, both * least / (1.0 + least)),)
            rivals = tuple(sorted(rivals, key=lambda r: -r.probability))
            o = replace(o, probability=both / (1.0 + least), rivals=rivals)
        out.append(replace(o, chosen=own))
    return replace(outcome, state=state), out


def _revised(odds: Odds, worse: set[tuple[Key, Key]], weight: float) -> Odds:
    """Lower the odds of rivals that respond worse, and give their probability to the cause."""
    most, rivals = math.exp(-TOLD_NATS) * odds.probability, []
    for r in odds.rivals:
        out = r.group is not None and (odds.chosen.group.key, r.group.key) in worse
        rivals.append(replace(r, probability=min(r.probability, most)) if out else r)
    freed = sum(r.probability for r in odds.rivals) - sum(r.probability for r in rivals)
    rivals.sort(key=lambda r: -r.probability)
    return replace(odds, probability=weight * (odds.probability + freed), rivals=tuple(rivals))


def _with_all_as_found(
    gain: Gain, found: Hypothesis, jobs: int, simulated: Callable[[int], object] | None
) -> Gain:
    """Add responses with the deviations of healthy parts, if more than noise remains without them."""
    left = [b.chi2_per_n for _, b in gain.pairs]
    if not left or np.mean(left) <= VISIBLE_CHI2_PER_N:
        return gain
    return replace(gain, as_found=responses([replace(found, whole=True)], jobs, simulated)[0])


def left_by(outcome: TeamOutcome) -> Callable[[Recording], tuple[Reduction, Array]]:
    """Make a function that computes the residual rows of a recording under a search result.

    Raises:
        InputError: no such robots can exist.
    """
    rig, found = outcome.problem.rig, found_in(outcome.problem, outcome.state)
    units, _, shared = robots_at(rig, found)
    return partial(rig.left_in, found=AsFound.of(units, shared, found.active))


def write_model(outcome: TeamOutcome, chosen: Sequence[Chosen], folder: Path, *, whole: bool = False) -> None:
    """Write the estimated team with causes as an extended model for ``mocobot simulate --model``.

    Args:
        outcome: of a search.
        chosen: its named causes.
        folder: to be written.
        whole: whether to include the deviations of all healthy parts, within their tolerances.

    Raises:
        InputError: the folder cannot be written, or no effect can have the values of a cause.
    """
    found = Hypothesis(outcome.problem, _only(outcome, chosen), whole)
    rig, told = found.rig, found.told(None)
    effects, causes = list(told.laws), [cause for cause, _ in found.causes]
    for cause, group in found.causes:  # with their estimated sizes, next to the healthy parts
        values = outcome.problem.values_of(group, found.state.posterior.mean)
        effects += named_effects(cause, rig.effects(cause, values))
    parts = rig.of_healthy(0, causes, told.healthy) if whole else []
    shared, bases = rig.linear[0].shared.moved(told.shared), rig.linear[0].bases.moved(told.local)
    scene = team_of(shared, bases, [*effects, *parts], *posture(rig.robots_of(0, told.healthy)))
    labels = [
        *(f"something unlisted at {group.place}" for group, _ in found.laws),
        *(cause.label for cause in causes),
    ]
    extra = {"recordings": list(rig.trials), "causes": labels}
    write_extended(scene, effects, folder, extra, parts)

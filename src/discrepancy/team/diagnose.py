"""Search for the likeliest causes in a team's recordings, and linearise the problem around them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from discrepancy.candidate import Candidate
from discrepancy.evidence.search import Chosen, Search, State, Until
from discrepancy.evidence.settings import SETTINGS, Settings
from discrepancy.team.candidates import beyond, explained_by, places_of
from discrepancy.team.linear.rest import HEALTHY, limits_of
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.start import exact_residual, linearised_trials, sensed_in
from discrepancy.team.linear.trial_linear import TrialLinear
from discrepancy.team.problem import TeamProblem, team_problem
from discrepancy.team.rig import TeamRig
from estimator.arm.unit import COUNT, ArmUnit, true_joints
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.rigid_team import Shared

STRAIGHT_CHI2_PER_N = 1e-3
"""Error of the linearisation in mean squared whitened residual, above which the problem is linearised again. Chosen."""

NORMAL_MEDIAN = 0.6745
"""Median of the absolute value of a standard normal variable. Derived."""


@dataclass(frozen=True, eq=False)
class Found:
    """Values of all parameters of a problem.

    Attributes:
        shared: displacement of the unknowns that all trials share, shape (s,).
        local: displacement of each trial's own unknowns, shape (l,).
        values: every candidate with columns, and its values in their own units, shape (k,).
        active: chosen causes with their values.
    """

    shared: Array
    local: tuple[Array, ...]
    values: tuple[tuple[Candidate, Array], ...]
    active: tuple[tuple[Candidate, Array], ...]


def found_in(problem: TeamProblem, state: State) -> Found:
    """Collect the posterior means of a state."""
    x, own = state.posterior.mean, problem.rig.local_unknowns
    values: dict[int, tuple[Candidate, Array]] = {}
    for k, label in enumerate(problem.labels):
        if label is not None:
            candidate, parameter = label
            values.setdefault(id(candidate), (candidate, np.zeros(len(candidate.parameters))))[1][
                parameter
            ] = x[k]
    listed = [c.group for c in state.chosen if not c.group.late]
    active = tuple((problem.candidates[g.identity], problem.values_of(g, x)) for g in listed)
    local = tuple(-x[columns][:own] for columns in problem.local)
    return Found(-x[problem.shared], local, tuple(values.values()), active)


def robots_at(rig: TeamRig, found: Found) -> tuple[ArmUnit, ArmUnit, Shared]:
    """Return the robots as found, their deviation from the assumed robots, and the payload.

    Raises:
        InputError: no such robots can exist.
    """
    first = rig.linear[0]
    at = first.arms.x if isinstance(first.arms, ArmUnit) else np.zeros((first.robots, COUNT))
    step = np.zeros_like(at)
    for candidate, values in found.values:
        place = places_of(candidate)
        if place is not None:
            step[place] = beyond(candidate, values, rig.origin)
    before = np.zeros_like(step) if rig.origin is None else rig.origin.x
    units = ArmUnit(first.design, at + step)
    return units, ArmUnit(units.design, before + step), first.shared.moved(found.shared)


def _as_read(trial: TrialLinear) -> tuple[Array, Array, Array]:
    """phi, theta, tau as the sensors read them, shape (Q, N, 3) each."""
    s = trial.signals
    if not isinstance(trial.arms, ArmUnit):
        return s.phi, s.theta, s.tau
    arms = trial.arms
    tau = s.tau / (1.0 + arms.of("stiffness_ratio")) + arms.of("tau_zero")
    return s.phi + arms.of("phi_zero"), s.theta + arms.of("theta_zero"), tau


def curvature(problem: TeamProblem, state: State, found: Found, units: ArmUnit, shared: Shared) -> float:
    """Mean square error of the linearisation in robots and unknowns, in units of the noise variance."""
    x = np.zeros(len(state.posterior.mean))
    moved = [k for k, label in enumerate(problem.labels) if label and places_of(label[0]) is not None]
    moved += [*problem.shared, *(k for own in problem.local for k in own)]
    x[moved] = state.posterior.mean[moved]
    exact = []
    for trial, white, local in zip(problem.rig.linear, problem.rig.whitening, found.local, strict=True):
        signals = Signals(trial.signals.time, *true_joints(units, *_as_read(trial)), trial.signals.rate_hz,
                          trial.signals.sampling)  # fmt: skip
        exact.append(white(exact_residual(signals, shared, trial.bases.moved(local), units, trial.reduction)))
    exact, total = problem.rows_of(exact), 0.0
    for c, channel in enumerate(problem.cells.channels):
        straight = channel.y - channel.X @ x[channel.columns]
        there = problem.bands.spectrum([r[:, 3 * c : 3 * c + 3] for r in exact])[problem.cells.order]
        total += float(np.sum((there - straight) ** 2))
    return total / sum(len(channel.y) for channel in problem.cells.channels)


def resting_of(found: Found) -> dict[str, float]:
    """Spread over tolerance, at least 1, of each cause that acts as noise at rest."""
    sizes: dict[str, list[float]] = {kind: [] for kind in HEALTHY}
    for candidate, values in found.values:
        if candidate.cause in sizes and candidate.parameters[0].tolerance:
            sizes[candidate.cause].append(abs(float(values[0])) / candidate.parameters[0].tolerance)
    # The median is robust against a single faulty part.
    return {kind: max(1.0, float(np.median(x)) / NORMAL_MEDIAN) if x else 1.0 for kind, x in sizes.items()}


def bent(problem: TeamProblem, state: State) -> bool:
    """Whether the linearisation is too inaccurate where a state finds robots and unknowns.

    Raises:
        InputError: no such robots can exist.
    """
    found = found_in(problem, state)
    units, _, shared = robots_at(problem.rig, found)
    return curvature(problem, state, found, units, shared) >= STRAIGHT_CHI2_PER_N


def around(problem: TeamProblem, state: State) -> TeamProblem | None:
    """Linearise the problem around the robots that a state finds; None if the linearisation is accurate enough.

    Raises:
        InputError: no such robots can exist.
    """
    rig, found = problem.rig, found_in(problem, state)
    units, origin, shared = robots_at(rig, found)
    resting = resting_of(found)
    same = all(0.5 < resting[kind] / rig.resting.get(kind, 1.0) < 2.0 for kind in resting)
    straight = not bent(problem, state)
    if straight and same:
        return None
    sensed, limits = rig.sensed, limits_of(rig.tolerances, resting)
    if not same:
        sensed = sensed_in(rig.linear, rig.sensed.noise, limits, rig.jobs, sensed)
    resting = rig.resting if same else resting
    if straight:
        moved = replace(rig, sensed=sensed, resting=resting, kept={})
    else:
        recordings = [replace(r, metadata=replace(r.metadata, units=units)) for r in rig.recordings]
        explained = explained_by(found.active, origin)
        linear, sensed = linearised_trials(recordings, shared, limits, rig.jobs, sensed, explained)
        moved = replace(rig, recordings=tuple(recordings), sensed=sensed, linear=linear, origin=origin,
                        resting=resting, kept={})  # fmt: skip
    return team_problem(moved, problem.opened, problem.catalogue if same else None)


def exact(problem: TeamProblem, state: State) -> tuple[TeamProblem, float]:
    """Replace the residual with the exact one at a state's unknowns and causes.

    Returns:
        The problem, and the mean square change of the residual in units of the noise variance.
    """
    found, cells = found_in(problem, state), problem.cells
    left = problem.rows_of(problem.rig.residual_there(found.shared, found.local, found.active))
    moved = [*problem.shared, *(k for own in problem.local for k in own)]
    moved += [k for c in state.chosen if not c.group.late for k in c.group.columns]
    x = np.append(problem.there, np.zeros(len(state.posterior.mean) - len(problem.there)))
    x[moved] = state.posterior.mean[moved]
    new = cells.around([r.reshape(len(r), -1, 3) for r in left], x)
    miss = sum(float(np.sum((a.y - b.y) ** 2)) for a, b in zip(new.channels, cells.channels, strict=True))
    return replace(problem, cells=new), miss / sum(len(c.y) for c in cells.channels)


def latent_whitening(problem: TeamProblem, state: State) -> list[Array] | None:
    """Whitening against the latent states of the chosen causes, shape (n, C, C) a trial; None if they have none."""
    rig, covariance = problem.rig, None
    for candidate, values in found_in(problem, state).active:
        if candidate.transient is not None:
            continue
        for t, patches in enumerate(rig.unknowns(candidate)):
            if patches.width:
                if covariance is None:
                    covariance = [np.zeros((*r.residual.shape, r.residual.shape[1])) for r in rig.linear]
                for patch in patches.each:
                    P = patch.values * abs(float(values[0]))
                    covariance[t][patch.where, patch.first :, patch.first :] += P @ np.swapaxes(P, 1, 2)
    if covariance is None:
        return None
    out = []
    for S in covariance:
        w, V = np.linalg.eigh(S)
        out.append(V / np.sqrt(1.0 + np.maximum(w, 0.0))[:, None, :] @ np.swapaxes(V, 1, 2))
    return out


def placed(problem: TeamProblem, other: TeamProblem, chosen: Sequence[Chosen]) -> list[Chosen]:
    """Transfer chosen causes from another problem to this one."""
    out = []
    for c in chosen:
        if not c.group.late:
            problem.candidates[c.group.identity] = other.candidates[c.group.identity]
        own = next((g for g in problem.groups if g.identity == c.group.identity), None)
        out.append(Chosen(own or problem.place(c.group), c.scale))
    return out


LEAVE_OPEN = ("joint_friction", "gimbal_friction", "sea_hysteresis", "grasp_play", "encoder_play")
"""Causes that change the noise of the rows. The search must continue with that noise."""


@dataclass(frozen=True, eq=False)
class TeamOutcome:
    """Result of a search.

    Attributes:
        problem: linearised around the result.
        search: on that problem.
        state: the likeliest set of causes.
        nothing: search and state without causes, linearised around the robots found without them.
        finished: whether the search completed.
    """

    problem: TeamProblem
    search: Search
    state: State
    nothing: tuple[Search, State]
    finished: bool = True

    @property
    def rig(self) -> TeamRig:
        """The recordings, linearised around the result, and their simulator."""
        return self.problem.rig


def search_team(
    rig: TeamRig, settings: Settings = SETTINGS, say: Callable[[str], object] = lambda _: None,
    until: Until | None = None,
) -> TeamOutcome:  # fmt: skip
    """Search for the likeliest causes of the residual that a team's model leaves.

    Args:
        rig: the linearised recordings.
        settings: of the search.
        say: takes the name of each stage.
        until: when to stop early; None for never.
    """
    until = until or Until()
    problem = team_problem(rig)
    search = Search(problem, problem.sensors, settings, say, until)
    state = search.fixed(())
    for _ in range(settings.rounds):
        moved = _moved(problem, state)
        if moved is None:
            break
        say("linear around the robots as they are found")
        there = replace(search, problem=moved)
        found = there.fixed(())
        if found.evidence < state.evidence:
            break  # a cause distorts the robots' estimate: their true values only show together with it
        problem, search, state = moved, there, found
    nothing = search, state
    state = until.run(search, state, partial(_beyond, problem))
    for _ in range(2 * settings.rounds):
        if not state.chosen or until():
            break
        before = state.keys
        problem, search, state, same = _beside(problem, search, state)
        if same:
            break
        state = until.run(search, state, partial(_beyond, problem))
        if state.keys == before and not _beyond(problem, state, frozenset()):
            break
    return TeamOutcome(problem, search, state, nothing, not until.broken)


def _beyond(problem: TeamProblem, state: State, new: frozenset[str]) -> bool:
    """Whether the search needs a new problem, because the noise changed or the linearisation is inaccurate."""
    try:
        return not new.isdisjoint(LEAVE_OPEN) or bent(problem, state)
    except InputError:  # impossible robots: a cause that acts on them is still missing
        return False


def _moved(problem: TeamProblem, state: State) -> TeamProblem | None:
    try:
        return around(problem, state)
    except InputError:  # impossible robots: another cause acts on them
        return None


def _beside(old: TeamProblem, search: Search, state: State) -> tuple[TeamProblem, Search, State, bool]:
    """Linearise around a set of causes; also return whether that hardly changed the problem."""
    opened, moved = latent_whitening(old, state), _moved(old, state)
    problem, same = old, True
    if opened is not None or moved is not None or old.opened is not None:
        near = moved or old
        problem, same = team_problem(near.rig, opened, near.catalogue), False
        search = replace(search, problem=problem, best=None)
        state = search.fixed(placed(problem, old, state.chosen))
    for _ in range(search.settings.rounds):
        problem, miss = exact(problem, state)
        search = replace(search, problem=problem, best=None)
        state = search.settled(search.value(state.chosen, state.posterior))
        if miss < STRAIGHT_CHI2_PER_N:
            break
        same = False
    return problem, search, state, same

"""From logs of a robot's joints to the likeliest causes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from discrepancy.evidence.posterior import Posterior
from discrepancy.evidence.search import Chosen, Search, State, floor_of
from discrepancy.evidence.settings import SETTINGS, Settings
from discrepancy.evidence.until import Until
from discrepancy.joints.given import Given
from discrepancy.joints.model import SerialModel
from discrepancy.joints.problem import JointProblem, joint_problem
from discrepancy.joints.signals import Signals
from discrepancy.joints.trials import Trials, trials_of
from estimator.arrays import Array
from mocobot_logs.joints.joint_log import JointLog

MOVED = (" zero", " mass share", " com ", " inertia share", " length ", " tilt ", " delay_s", " scale", " payload ",
         " armature_kgm2", " coulomb_Nm", " viscous_Nms_per_rad")  # fmt: skip
"""Columns around whose values the problem is made linear again."""
CURVED = ("gravity_direction", "joint_zero", "link_length", "torque_delay")
"""Causes that change torques as a curve: what else there is shows only around their values."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a search found.

    Attributes:
        problem: linear around what was found.
        search: on it.
        state: the likeliest set.
        nothing: the search on the problem that is linear around the model as it is; None: this one is.
        finished: whether the search came to its end.
    """

    problem: JointProblem
    search: Search
    state: State
    nothing: Search | None = None
    finished: bool = True


def diagnose(
    model: SerialModel, logs: Sequence[JointLog] | Trials, settings: Settings = SETTINGS,
    say: Callable[[str], object] = lambda _: None, given: Given | None = None, until: Until | None = None,
) -> Outcome:  # fmt: skip
    """The likeliest causes of what a model leaves of its robot's torques.

    The problem is made linear again around what was found until the set stays. A set takes another's place only
    where it is likelier with each linear around itself.

    Args:
        model: the robot as described.
        logs: of its joints, with torques, or trials of them.
        settings: numbers of the engine.
        say: takes a line about each step.
        given: what the problem takes besides.
        until: when to end with the best so far.
    """
    until = until or Until()
    trials = logs if isinstance(logs, Trials) else trials_of(model, logs)
    smooth, given = trials.runs, replace(given or Given(), noise=trials.noise, kept=trials.kept)
    problem = joint_problem(model, smooth, None, given)
    search = Search(problem, floor_of(problem, problem.slabs(), settings), settings, say, until)

    def bent(state: State, new: frozenset[str]) -> bool:
        return given.changed is None and not new.isdisjoint(CURVED)

    first = Outcome(problem, search, until.run(search, search.fixed(()), bent), finished=not until.broken)
    if given.changed is not None or until():
        return first  # what is wrong in all logs has no values of its own to be linear around
    again = partial(_around, smooth=smooth, given=given)
    around = again(first, floor=None)
    for _ in range(settings.rounds):
        found = Outcome(around.problem, around.search, until.run(around.search, around.state))
        if until():
            around = found
            break
        around = found if found.state.keys == around.state.keys else around
        other = again(found, floor=around.search.floor)
        if other.state.evidence < around.state.evidence + settings.need_nats:
            break  # linear around itself, the set is no likelier
        around = other
    return replace(around, nothing=search, finished=not until.broken)


def _around(found: Outcome, *, smooth: Sequence[Signals], given: Given, floor: Array | None) -> Outcome:
    """The same set, linear around its own values; noise about a floor, or about one of its own."""
    x = found.state.posterior.mean
    values = {
        label: float(x[i])
        for i, label in enumerate(found.problem.labels)
        if x[i] and any(word in f" {label}" for word in MOVED) and "{" not in label
    }
    problem, before = joint_problem(found.problem.model, smooth, values, given), found.search
    if floor is None:
        floor = floor_of(problem, problem.slabs(), before.settings)
    search = replace(before, problem=problem, floor=floor, best=None)
    chosen = []
    for c in found.state.chosen:
        if c.group.event:
            chosen.append(Chosen(problem.place(c.group), c.scale))
        else:
            chosen += [
                Chosen(g, c.scale)
                for g in problem.groups
                if g.key == c.group.key and g.shape == c.group.shape
            ]
    return Outcome(problem, search, search.fixed(chosen))


def labels_of(outcome: Outcome) -> dict[str, tuple[float, float]]:
    """Values and standard errors of the chosen causes' columns, by label, fitted with priors that shrink nothing."""
    state = outcome.state
    prior = state.posterior.prior.copy()
    for c in state.chosen:
        k = list(c.group.columns)
        prior[k] = np.maximum(prior[k], (SETTINGS.plain * np.array(c.group.slab)) ** 2)
    p = Posterior(outcome.problem.cells, prior, state.posterior.variance)
    se = np.sqrt(p.variances)
    return {
        outcome.problem.labels[k] if k < len(outcome.problem.labels) else f"{c.group.place} {n}": (
            float(p.mean[k]),
            float(se[k]),
        )
        for c in state.chosen
        for n, k in enumerate(c.group.columns)
    }

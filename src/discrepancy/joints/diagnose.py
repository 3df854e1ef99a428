"""From logs of a robot's joints to the likeliest causes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from discrepancy.evidence.posterior import Posterior
from discrepancy.evidence.search import Chosen, Search, State, floor_of
from discrepancy.evidence.settings import SETTINGS, Settings
from discrepancy.joints.problem import JointProblem, joint_problem, smoothed
from discrepancy.serial.model import SerialModel
from discrepancy.serial.recording.joint_log import JointLog
from discrepancy.serial.rows.signals import Signals
from estimator.arrays import Array

PLAIN = 3.0
"""Values are fitted with so many times their prior standard deviation, so that it shrinks nothing."""
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
    """

    problem: JointProblem
    search: Search
    state: State


def diagnose(
    model: SerialModel, logs: Sequence[JointLog], settings: Settings = SETTINGS,
    say: Callable[[str], object] = lambda _: None,
) -> Outcome:  # fmt: skip
    """The likeliest causes of what a model leaves of its robot's torques.

    The problem is made linear again around what was found until the set stays. A set takes another's place only
    where it is likelier with each linear around itself.

    Args:
        model: the robot as described.
        logs: of its joints, with torques.
        settings: numbers of the engine.
        say: takes a line about each step.
    """
    smooth = smoothed(model, logs)
    problem = joint_problem(model, smooth)
    search = Search(problem, floor_of(problem, problem.slabs(), settings), settings, say)
    first = Outcome(problem, search, search.run(search.fixed(()), CURVED))
    around = _around(first, model, smooth, settings, say, None)
    for _ in range(settings.rounds):
        found = Outcome(around.problem, around.search, around.search.run(around.state))
        if found.state.keys == around.state.keys:
            return found
        other = _around(found, model, smooth, settings, say, around.search.floor)
        if other.state.evidence < around.state.evidence + settings.need_nats:
            break  # linear around itself, the new set is no likelier
        around = other
    return around


def _around(
    found: Outcome, model: SerialModel, smooth: Sequence[Signals], settings: Settings, say: Callable[[str], object],
    floor: Array | None,
) -> Outcome:  # fmt: skip
    """The same set, linear around its own values; noise about a floor, or about one of its own."""
    x = found.state.posterior.mean
    values = {
        label: float(x[i])
        for i, label in enumerate(found.problem.labels)
        if x[i] and any(word in f" {label}" for word in MOVED) and "{" not in label
    }
    problem = joint_problem(model, smooth, values)
    if floor is None:
        floor = floor_of(problem, problem.slabs(), settings)
    search = Search(problem, floor, settings, say)
    chosen = []
    for c in found.state.chosen:
        if c.group.event:
            group, series = problem.event(c.group)
            chosen.append(Chosen(replace(group, columns=tuple(problem.cells.add(series))), c.scale))
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
        prior[k] = np.maximum(prior[k], (PLAIN * np.array(c.group.slab)) ** 2)
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

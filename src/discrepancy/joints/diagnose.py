"""From logs of a robot's joints to the likeliest causes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy.evidence.search import Chosen, Search, State, floor_of
from discrepancy.evidence.settings import SETTINGS, Settings
from discrepancy.joints.problem import JointProblem, joint_problem, smoothed
from discrepancy.serial.model import SerialModel
from discrepancy.serial.recording.joint_log import JointLog

MOVED = (" zero", " mass share", " com ", " inertia share", " length ", "tilt ", " delay_s", " scale", "payload ",
         " armature_kgm2", " coulomb_Nm", " viscous_Nms_per_rad")  # fmt: skip
"""Columns around whose values the problem is made linear again."""


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
    """The likeliest causes; the problem is made linear again around what was found until the set stays."""
    smooth = smoothed(model, logs)
    values: dict[str, float] = {}
    before: set[tuple[str, str]] | None = None
    start: list[tuple[tuple[str, str], tuple[tuple[str, float], ...], float]] = []
    for _ in range(settings.rounds):
        problem = joint_problem(model, smooth, values)
        search = Search(problem, floor_of(problem, problem.slabs(), settings.start_steps), settings, say)
        again = [
            Chosen(g, scale) for key, shape, scale in start for g in problem.groups
            if g.key == key and g.shape == shape
        ]  # fmt: skip
        state = search.run(again)
        if state.keys == before:
            break
        before = state.keys
        start = [(c.group.key, c.group.shape, c.scale) for c in state.chosen]
        x = state.posterior.mean
        values = {
            label: float(x[i]) for i, label in enumerate(problem.labels)
            if x[i] and any(word in label or label.startswith(word.strip()) for word in MOVED) and "{" not in label
        }  # fmt: skip
    return Outcome(problem, search, state)


def labels_of(outcome: Outcome) -> dict[str, tuple[float, float]]:
    """Values and standard errors of the chosen causes' columns, by label."""
    p = outcome.state.posterior
    se = np.sqrt(np.diag(p.covariance))
    return {
        outcome.problem.labels[k]: (float(p.mean[k]), float(se[k]))
        for c in outcome.state.chosen for k in c.group.columns
    }  # fmt: skip

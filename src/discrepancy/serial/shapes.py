"""Other shapes of a candidate: those of its cause, finer ones near its own, intervals of a push."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from discrepancy.candidate import Candidate
from discrepancy.causes.intervals import intervals_near, worst_intervals
from discrepancy.rules import serial as rules
from discrepancy.serial.causes import CAUSES
from discrepancy.serial.causes.base import Hints
from discrepancy.serial.mechanics.tree import Tree
from estimator.arrays import Array


def pushes(
    tree: Tree, names: Sequence[str], times: Sequence[Array], remaining: Sequence[Array]
) -> list[Candidate]:
    """Pushes at the intervals where the torques are worst.

    Args:
        tree: the nominal one.
        names: of its joints.
        times: of the rows of every block [s], shape (n,).
        remaining: whitened residuals, rows (n, C) of every block.
    """
    push = CAUSES["push"]
    out = []
    for t, (time, z) in enumerate(zip(times, remaining, strict=True)):
        for when in worst_intervals(t, time, np.sum(z**2, axis=1), rules.PUSH_S, two_sided=False):
            out.append(replace(push.at(tree, names, -1, when.shape), transient=when))
    return out


def others(candidate: Candidate, hints: Hints, *, finer: bool) -> list[Candidate]:
    """The candidate with every other shape of its cause, or finer ones near its own; a push with its interval moved."""
    cause, when = CAUSES[candidate.cause], candidate.transient
    if when:
        near = intervals_near(when, rules.SHORTEST_PUSH_S)
        return [replace(candidate, shape=dict(other.shape), transient=other) for other in near]
    at = -1 if candidate.joint is None else candidate.joint - 1
    found = cause.finer(candidate.shape) if finer else cause.shapes(hints, at)
    return [replace(candidate, shape=dict(shape)) for shape in found if dict(shape) != candidate.shape]


def steps(candidate: Candidate) -> list[tuple[Candidate, Candidate, float]]:
    """For every number of its shape that the data determine: a little less, a little more, and the difference."""
    shape = dict(candidate.shape)
    return [
        (
            replace(candidate, shape=shape | {name: shape[name] - step / 2}),
            replace(candidate, shape=shape | {name: shape[name] + step / 2}),
            step,
        )
        for name, step in CAUSES[candidate.cause].steps(shape).items()
    ]

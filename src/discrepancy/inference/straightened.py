"""Where a rig is linear beside causes: with these in the model machines are found elsewhere than without any."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.base import without_any
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.refit import exact
from discrepancy.inference.shape.reshape import settled_shape
from discrepancy.least_squares.problem import Key
from discrepancy.rig import Rig


@dataclass(frozen=True, eq=False)
class Beside:
    """Where all is linear beside causes.

    Attributes:
        rig: linear there.
        nothing: that nothing is there.
        found: the causes.
        opened: these in the shapes in which they leave open what they do, by their key, which may have settled since.
    """

    rig: Rig
    nothing: Hypothesis
    found: Hypothesis
    opened: Mapping[Key, Candidate]

    @classmethod
    def of(cls, rig: Rig, nothing: Hypothesis, found: Hypothesis) -> Beside:
        """Where they have just been found."""
        # Of a kind that only scatters it is left open, too; of a fault beside its kind the fault's.
        every = {c.key: c for c in (*found.problem.candidates, *found.causes)}
        return cls(rig, nothing, found, {key: every[key] for key in found.problem.opened})


def straightened(here: Beside, say: Callable[[str], object]) -> Beside | None:
    """One step nearer to where machines are found beside causes; None where it does not help, or need not be.

    It need not where columns reach as far as that. It does not where they flatter the causes: what is missing besides
    may look like machines that are elsewhere, and is less likely there.

    Args:
        here: where all is linear.
        say: called with what is being done.
    """
    rig = here.rig.relinearised(here.found)
    if rig is None:
        return None
    say("linearise")
    nothing = without_any(rig, here.nothing.problem.odds, say)
    found = _settled(rig, exact(rig, _carried(rig, nothing, here), nothing), nothing)
    # With another noise scores do not compare.
    if not rig.rewhitened and found.score < here.found.score - rules.EXCHANGED_NATS:
        return None
    return Beside(rig, nothing, found, here.opened)


def _carried(rig: Rig, nothing: Hypothesis, here: Beside) -> Hypothesis:
    """The same causes and kinds, in their shapes and with what they leave open, where the rig is linear by now."""
    found = here.found
    old, problem = found.problem, nothing.problem
    spread, at = problem.spread.copy(), dict[int, int]()
    for index, candidate in enumerate(old.candidates):
        if index < len(nothing.problem.candidates):
            at[index] = index
            if candidate != problem.candidates[index]:
                problem = problem.with_columns(index, candidate, rig.columns(candidate))
        elif index in found.free or old.tolerant[old.columns_of(index)].all():
            at[index] = len(problem.candidates)
            problem = problem.extended(candidate, rig.columns(candidate))
            spread = np.append(spread, np.ones(len(candidate.parameters)))
        else:
            continue
        spread[problem.columns_of(at[index])] = old.spread[old.columns_of(index)]
    for key, own in old.opened.items():
        problem = problem.with_unknowns(key, rig.unknowns(here.opened[key]), own[0].size)
    problem = problem.with_noise(old.power, spread)
    return Hypothesis.of(
        problem, [at[i] for i in found.free], {at[i]: nats for i, nats in found.allowed.items() if i in at}
    )


def _settled(rig: Rig, found: Hypothesis, nothing: Hypothesis) -> Hypothesis:
    """Every cause in the shape that suits best from there: numbers that are counted from the payload have moved."""
    shaped = found
    for index in found.free:
        shaped = settled_shape(rig, shaped, index)
    return found if shaped is found else exact(rig, shaped, nothing)

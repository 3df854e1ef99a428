"""Where a rig is linear before any cause is known, and the hypothesis that nothing is there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from discrepancy import rules
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.refit import exact
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Rig


def based(rig: Rig, odds: float, say: Callable[[str], object]) -> tuple[Rig, Hypothesis, bool]:
    """The rig linear around where it is, that nothing is there, and whether columns are straight as far as that.

    They are not where a strong fault drives machines that may be off by much: they go farther than columns reach, and
    no step halves what these miss. All stays linear where it was before that.

    Args:
        rig: the rig.
        odds: of any cause being there before the data are seen.
        say: called with what is being done.
    """
    nothing, missed = without_any(rig, odds, say), np.inf
    for _ in range(rules.BASE_ROUNDS - 1):
        moved = rig.relinearised(nothing)
        if moved is None:
            missed = 0.0
            break
        if moved.missed > max(rules.STRAIGHTER * missed, rules.BENT_CHI2_PER_N):
            missed = np.inf
            break
        say("linearise")
        rig, missed = moved, moved.missed
        del nothing, moved  # for the sake of memory
        nothing = without_any(rig, odds, say)
    straight = missed <= rules.BENT_CHI2_PER_N
    return rig, exact(rig, nothing, nothing) if rig.curved else nothing, straight


def without_any(rig: Rig, odds: float, say: Callable[[str], object]) -> Hypothesis:
    """The hypothesis that nothing is there beyond its kind's spread; arguments as of ``based``."""
    say("columns")
    candidates = rig.candidates()
    nothing = Hypothesis.of(Problem.of(rig.rows(candidates), candidates), ())
    return replace(nothing, learnt=replace(nothing.learnt, problem=replace(nothing.problem, odds=odds)))

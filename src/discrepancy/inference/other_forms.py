"""What causes leave whose law is not quite that of the catalogue: no sign of another cause."""

from dataclasses import replace

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.scan import log_bayes_factor
from discrepancy.least_squares.fit import Fit
from discrepancy.rig import Rig


def beside_other_forms(
    rig: Rig, hypothesis: Hypothesis, index: int, base: Hypothesis, rival: Candidate | None = None
) -> Hypothesis:
    """The hypothesis without the credit that one of its causes has for what other forms of the others would explain.

    These are random columns of unit variance (``Rig.other_forms``), so that what a cause gains beside them is less, by
    as much as they can do what it does (Kennedy and O'Hagan, "Bayesian calibration of computer models", 2001).

    Args:
        rig: for columns.
        hypothesis: with the cause.
        index: which.
        base: without it.
        rival: only what other forms matter for this one, too, as where the two are held against each other; None for
            all.
    """
    problem, candidate = hypothesis.problem, hypothesis.problem.candidates[index]
    fit, others = hypothesis.fit, [i for i in hypothesis.free if i != index]
    # What is as far off as a fault counts as one, though its kind scatter.
    before = base.fit
    off = [
        i
        for i in range(len(base.problem.candidates))
        if i not in (index, *others) and i not in base.free and base.problem.has_tolerance(i)
        if np.abs(before.part(i)[0]).max() > rules.LEAST_SLAB
    ]
    there = [(problem.candidates[i], fit.part(i)[0] * problem.candidates[i].units) for i in others]
    there += [(base.problem.candidates[i], before.part(i)[0] * base.problem.candidates[i].units) for i in off]
    forms = rig.other_forms(candidate, fit.part(index)[0] * candidate.units, there, rival)
    if forms is None:  # it is charged for other things, if at all
        return hypothesis
    if not forms:
        return replace(hypothesis, allowed={i: x for i, x in hypothesis.allowed.items() if i != index})
    k = len(candidate.parameters)
    spike = 0.0
    if problem.has_tolerance(index):
        spike = min(float(problem.spread[problem.columns_of(index)][0]), 1.0)
    without = Fit.of(problem, others, fixed=(index, np.zeros(k)))
    own = [columns * candidate.units for columns in rig.columns(candidate)]
    information, score = without.told_by(
        [np.concatenate(both, axis=2) for both in zip(own, forms, strict=True)]
    )
    alone = log_bayes_factor(information[:k, :k], score[:k], spike)
    taken = np.linalg.solve(
        information[k:, k:] + np.eye(len(score) - k), np.c_[information[k:, :k], score[k:]]
    )
    cross = information[:k, k:]
    beside = log_bayes_factor(
        information[:k, :k] - cross @ taken[:, :k], score[:k] - cross @ taken[:, k], spike
    )
    # As a share, since in the hypotheses its kind may scatter, too.
    share = float(np.clip(1.0 - beside / alone, 0.0, 1.0)) if np.isfinite(alone) and alone > 0 else 0.0
    lost = share * max(hypothesis.learnt.log_evidence - base.learnt.log_evidence, 0.0)
    return replace(hypothesis, allowed={**hypothesis.allowed, index: lost})

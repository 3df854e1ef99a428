"""Exact residuals for a hypothesis: columns are slopes, and what is there may be far from nought."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy import rules
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.renewed import renewed
from discrepancy.rig import Rig
from estimator.arrays import Array
from estimator.errors import InputError


@dataclass(frozen=True)
class _Point:
    """Where residuals are exact.

    Attributes:
        shared: beyond where they are linear, shape (s,).
        local: the same of every trial, shape (l,) each.
        values: of what is moved, in units.
    """

    shared: Array
    local: Sequence[Array]
    values: Sequence[Array]

    @property
    def origin(self) -> _Point:
        """Where all is linear."""
        return _Point(0.0 * self.shared, [0.0 * x for x in self.local], [0.0 * x for x in self.values])

    def towards(self, to: _Point, share: float) -> _Point:
        """A share of the way to another."""
        if share == 1.0:
            return to
        between = lambda a, b: a + share * (b - a)  # noqa: E731
        return _Point(
            between(self.shared, to.shared),
            [between(a, b) for a, b in zip(self.local, to.local, strict=True)],
            [between(a, b) for a, b in zip(self.values, to.values, strict=True)],
        )


def exact(rig: Rig, hypothesis: Hypothesis, nothing: Hypothesis) -> Hypothesis:
    """The hypothesis with exact residuals: Gauss-Newton on causes and unknowns until the values have settled.

    Unknowns are moved as far as the causes move them, from where they are without any, or from where all is linear if
    that is beside causes. What they share with tolerances stays linear on both sides: moved alone, without the
    tolerances that make up for it, they would be far from where the data are. What is within its
    tolerance is moved along where the rig says so (``Rig.curved``). Slopes are the model's as long as steps with them
    help, and then, where little more than noise is left, those of the machine as it is found (``Rig.slopes``).

    Args:
        rig: the rig.
        hypothesis: what is there.
        nothing: the hypothesis that nothing is.
    """
    own, trials = rig.local_unknowns, hypothesis.problem.trials
    far = 0.0 if rig.beside else 1.0
    begin = far * nothing.fit.shared, [far * nothing.fit.local(t)[:own] for t in trials]
    linear, last, share, at = hypothesis, np.inf, 1.0, None
    anew, rounds = False, rules.REFIT_ROUNDS
    for tried in range(rules.SHORT_ROUNDS):
        if share == 1.0 and tried >= rounds:
            if anew or last < 1.0 or not near(rig, hypothesis):
                break
            anew, last, rounds = True, np.inf, tried + rules.REFIT_ROUNDS  # it settles, but slowly
        fit = hypothesis.fit
        there = [
            i for i in range(len(fit.problem.candidates)) if i in fit.free or (rig.curved and fit.uses(i))
        ]
        to = _Point(
            fit.shared - begin[0],
            [fit.local(t)[:own] - start for t, start in zip(trials, begin[1], strict=True)],
            [fit.part(i)[0] for i in there],
        )
        here = (to.origin if at is None else at).towards(to, share)
        try:
            new, bends = _evaluated(rig, hypothesis, there, here, anew=anew)
        except InputError:  # no such machine: the linear answer is the better one
            return linear
        lost = hypothesis.learnt.log_evidence - new.learnt.log_evidence
        most = rules.BENT_NATS if (bends or anew) and hypothesis is linear else rules.DIVERGED_NATS
        diverges = lost > most
        # Where nothing else is moved along, straight columns reach far: only what loses too much is shortened there.
        shortens = share < 1.0 or (anew or at is not None if rig.curved else diverges)
        way = np.inf if diverges else _way(fit, new.fit)
        if diverges or (way > max(last, 1.0) and not (anew and lost < 0.0)):
            if not anew and near(rig, hypothesis):
                # Slopes there are others than where all is linear.
                anew, last, rounds = True, np.inf, tried + 1 + rules.REFIT_ROUNDS
                continue
            if shortens and share > rules.LEAST_STEP:
                share *= 0.5
                continue
            if diverges:
                break  # what was there before is the better one
            return linear  # steps grow: columns take up whatever a value that runs away leaves
        hypothesis, last, at = new, way, here
        if way < rules.SETTLED_SE:
            break
    return hypothesis if hypothesis is linear else _from_nought(rig, hypothesis)


def _way(old: Fit, new: Fit) -> float:
    """By how many standard errors the values moved at most; what nothing tells stays where it is."""
    se = np.sqrt(np.diag(new.covariance))
    step = np.abs(new.solution - old.solution)[se > 0] / se[se > 0]
    return float(step.max(initial=0.0))


def _evaluated(
    rig: Rig, hypothesis: Hypothesis, there: Sequence[int], here: _Point, *, anew: bool
) -> tuple[Hypothesis, bool]:
    """The hypothesis with residuals exact at a point, and whether a cause there is no multiple of its values.

    Args:
        rig: the rig.
        hypothesis: whose causes, spreads and powers these are.
        there: candidates that have values at the point.
        here: the point.
        anew: whether slopes are those there.

    Raises:
        InputError: there is no such machine.
    """
    old, own = hypothesis.problem, rig.local_unknowns
    active = [
        (old.candidates[i], x * old.candidates[i].units) for i, x in zip(there, here.values, strict=True)
    ]
    residual = rig.residual(-here.shared, [-x for x in here.local], active)
    problem, bends = old, False
    for i, (cause, values) in zip(there, active, strict=True):
        if (bent := rig.bent(cause, values)) is not None:
            problem, bends = problem.with_columns(i, cause, bent[0]), True
    if anew:
        slopes = zip(there, rig.slopes(active), strict=True)
        problem = renewed(problem, {i: columns for i, columns in slopes if columns is not None})
    # The problem counts total values, so what its columns stand for is added back.
    values = np.zeros(old.width)
    values[: old.shared] = here.shared
    for i, x in zip(there, here.values, strict=True):
        values[old.spans[i]] = x
    back = [
        total + old.local[t][..., :own] @ here.local[t] + problem.raw_times(t, values)
        for t, total in zip(old.trials, residual, strict=True)
    ]
    return Hypothesis.of(problem.with_residual(back), hypothesis.free, hypothesis.allowed), bends


def near(rig: Rig, hypothesis: Hypothesis) -> bool:
    """Whether slopes are worth making anew; where much more than noise is left, what is missing counts for more.

    A model without friction and rotors has links then that no machine has, and slopes of these.
    """
    return rig.slopes_vary and hypothesis.fit.chi2 < rules.NEAR_CHI2 * hypothesis.problem.samples


def _from_nought(rig: Rig, hypothesis: Hypothesis) -> Hypothesis:
    """The same with columns that say what causes do that are no multiple of their values, from nought on to there."""
    fit, problem = hypothesis.fit, hypothesis.problem
    last = np.zeros(problem.width)
    last[-1] = 1.0
    residual: list[Array] | None = None
    for i in hypothesis.free:
        cause = problem.candidates[i]
        values = fit.part(i)[0] * cause.units
        bent = rig.bent(cause, values)
        if bent is None:
            continue
        if residual is None:
            residual = [problem.raw_times(t, last) for t in problem.trials]
        here = np.zeros(problem.width)
        here[problem.spans[i]] = fit.part(i)[0]
        slopes = [problem.raw_times(t, here) for t in problem.trials]
        residual = [r - old + new @ values for r, old, new in zip(residual, slopes, bent[1], strict=True)]
        problem = problem.with_columns(i, cause, bent[1])
    if residual is None:
        return hypothesis
    return Hypothesis.of(problem.with_residual(residual), hypothesis.free, hypothesis.allowed)

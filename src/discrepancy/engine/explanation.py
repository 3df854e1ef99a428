"""What a search found: causes with their values and probabilities, and the misfit without and with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.engine.held_out import Foretold, foretold, predictive_nats, shares
from discrepancy.inference.exchange import Rival
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.learn import worth_spreads
from discrepancy.inference.probability import probability, told_nats
from discrepancy.inference.remainder import is_noise, share_left, unlisted_nats
from discrepancy.inference.search import Searched
from discrepancy.inference.shape.best_shape import covariance_with_shape
from discrepancy.law_doubt import LawDoubt
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Rig
from estimator.arrays import Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Found:
    """A cause that is there, and why.

    Attributes:
        index: which candidate of the problem.
        candidate: what and where, with its best shape.
        probability: that it is what and where it is said to be.
        told_nats: gap from which a rival can be told from it.
        probability_alike: that it is this or one of the rivals that cannot be told from it.
        over_nothing: by how much it is likelier than nothing in its place [nats].
        share_left: see ``remainder.share_left``.
        doubt: about its law.
        rivals: what else could be in its place, the likeliest first, and by how much it is less likely [nats].
        values: its parameters, in their own units, shape (k,).
        covariance: of the values and of what is determined of its shape (see ``best_shape``), in their own units.
        folds: see ``held_out.predictive_nats``.
        contradicted: whether one of these speaks against it as much as a cause has to be spoken for, and what is left
            is no noise: then what imitates it may be there instead.
        in_sample, held_out: share of the nominal model's misfit that it removes beyond the causes before it (see
            ``held_out.shares``).
    """

    index: int
    candidate: Candidate
    probability: float
    told_nats: float
    probability_alike: float
    over_nothing: float
    share_left: float
    doubt: LawDoubt
    rivals: tuple[tuple[Candidate, float], ...]
    values: Array
    covariance: Array
    folds: tuple[float, ...]
    contradicted: bool
    in_sample: float
    held_out: float | None

    @property
    def weight(self) -> float:
        """What its probability is worth on data that were not used."""
        return rules.CONTRADICTED if self.contradicted else 1.0


@dataclass(frozen=True)
class Scatter:
    """A kind of which healthy ones, too, are off by more than its tolerance, at all places alike.

    Attributes:
        candidate: one of the kind, for its words and units.
        factor: their spread over the tolerance.
        places: how many there are.
        nats: by how much that is likelier than the tolerance.
        each: every place, how far off it is and the standard errors, shape (k,) each; the farthest first.
    """

    candidate: Candidate
    factor: float
    places: int
    nats: float
    each: tuple[tuple[Candidate, Array, Array], ...] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class Explanation:
    """What the search found.

    Attributes:
        found: causes in the order of discovery.
        suspected: causes that were found with a probability too small to name them.
        scatter: kinds that are off everywhere, the farthest first.
        foretold: where some are, what it is worth to know by how much every place is; None for a single trial.
        hypothesis: all causes that were found, and the noise and spreads beside them.
        nothing: the same with no cause.
        nominal: misfit of the nominal model, nothing off.
        before, after: misfit with tolerances alone, and with the causes as well.
        plain: misfit with the causes and no tolerances.
        unlisted_nats: see ``remainder.unlisted_nats``.
        shared, local: displacements of the unknowns with the causes in the model.
    """

    found: tuple[Found, ...]
    suspected: tuple[Found, ...]
    scatter: tuple[Scatter, ...]
    foretold: Foretold | None
    hypothesis: Hypothesis
    nothing: Hypothesis
    nominal: float
    before: float
    after: float
    plain: float
    unlisted_nats: float
    shared: Array
    local: tuple[Array, ...]

    @property
    def problem(self) -> Problem:
        """The problem with the causes' shapes and residual, and with the noise and spreads beside them."""
        return self.hypothesis.problem

    @property
    def fit(self) -> Fit:
        """The fit with all causes that were found."""
        return self.hypothesis.fit

    @property
    def samples(self) -> int:
        """Number of residuals."""
        return self.problem.samples

    @property
    def explained(self) -> float:
        """Share of the nominal model's misfit above clean data that the causes alone remove."""
        floor = min(self.plain, rules.CLEAN_CHI2_PER_N * self.samples)
        return float(np.clip((self.nominal - self.plain) / max(self.nominal - floor, 1e-9), 0.0, 1.0))

    @property
    def clean(self) -> bool:
        """Whether what is left is noise."""
        return is_noise(self.after, self.samples, self.unlisted_nats)


def explain(searched: Searched) -> Explanation:
    """Values, probabilities and worth of what a search found."""
    rig, best, nothing = searched.rig, searched.best, searched.nothing
    rivals = dict(zip(best.free, searched.rivals, strict=True))
    noise = is_noise(best.fit.chi2, best.problem.samples, unlisted_nats(best))
    found = [_found(rig, best, index, rivals[index], noise) for index in best.free]
    suspected = [item for item in found if item.probability_alike < rules.LEAST_PROBABILITY]
    for item in suspected:
        # What is less likely than not takes no part in what is said of the others.
        best = best.without(item.index)
    found = [replace(item, **_values(rig, best, item.index)) for item in found if item not in suspected]
    problem = best.problem.as_whitened
    removed = shares(problem, best.free)
    found = [
        replace(item, in_sample=in_sample, held_out=held_out)
        for item, (in_sample, held_out) in zip(found, removed, strict=True)
    ]
    scatter = scatter_of(best)
    return Explanation(
        found=tuple(found),
        suspected=tuple(suspected),
        scatter=scatter,
        foretold=foretold(_with_unit_power(best.problem), best.free) if scatter else None,
        hypothesis=best,
        nothing=nothing,
        nominal=Fit.of(nothing.problem.as_whitened, background=False).misfit,
        before=nothing.fit.chi2,
        after=best.fit.chi2,
        plain=Fit.of(problem, best.free, background=False).misfit,
        unlisted_nats=unlisted_nats(best),
        shared=-best.fit.shared,
        local=tuple(-best.fit.local(t)[: rig.local_unknowns] for t in best.problem.trials),
    )


def _with_unit_power(problem: Problem) -> Problem:
    """With noise as whitened, and kinds that scatter as they were learnt to."""
    return problem.with_noise([np.ones_like(p) for p in problem.power], problem.spread)


def _found(rig: Rig, best: Hypothesis, index: int, rivals: Sequence[Rival], noise: bool) -> Found:
    candidate = best.problem.candidates[index]
    left = share_left(best, index)
    nothing = next((rival.gap for rival in rivals if rival.candidate is None), np.inf)
    others = [(rival.candidate, rival.gap) for rival in rivals if rival.candidate is not None]
    # The same event in another interval is no other cause.
    others = [(c, gap) for c, gap in others if c.transient is None or c.cause != candidate.cause]
    gaps = [gap for _, gap in others]
    about = left, rig.law_doubt(candidate), nothing
    told = told_nats(gaps, *about)
    folds = tuple(predictive_nats(best.problem, [i for i in best.free if i != index], index))
    item = Found(
        index=index,
        candidate=candidate,
        probability=probability(gaps, *about),
        told_nats=told,
        probability_alike=probability([g for g in gaps if g >= told], *about),
        over_nothing=float(nothing),
        share_left=left,
        doubt=rig.law_doubt(candidate),
        rivals=tuple(others),
        **_values(rig, best, index),
        folds=folds,
        contradicted=not noise and min(folds, default=0.0) < -rules.NAMED_NATS,
        in_sample=0.0,
        held_out=None,
    )
    return replace(
        item,
        probability=item.weight * item.probability,
        probability_alike=item.weight * item.probability_alike,
    )


def _values(rig: Rig, best: Hypothesis, index: int) -> dict[str, Array]:
    """Values of a cause, and their covariance with what its law may put them off."""
    candidate = best.problem.candidates[index]
    values = best.fit.part(index)[0] * candidate.units
    covariance = covariance_with_shape(rig, best.fit, index)
    told = np.diag(covariance) > 0.0  # what a shape lacks has no error
    law = np.where(told, rig.law_error(candidate, values), 0.0)
    covariance = covariance + np.diag(law**2)
    return {"values": values, "covariance": covariance}


def scatter_of(hypothesis: Hypothesis) -> tuple[Scatter, ...]:
    """Kinds whose spread the data want beyond their tolerance."""
    problem, out, kinds = hypothesis.problem, [], dict[str, int]()
    for index, candidate in enumerate(problem.candidates):
        if index not in hypothesis.free and problem.has_tolerance(index):
            kinds.setdefault(candidate.cause, index)
    factors = {kind: float(problem.spread[problem.columns_of(index)][0]) for kind, index in kinds.items()}
    wanted = [kind for kind, factor in factors.items() if factor >= rules.SCATTER_FACTOR]
    for kind, nats in worth_spreads(hypothesis.learnt, wanted).items():
        candidate, factor = problem.candidates[kinds[kind]], factors[kind]
        places = sum(c.cause == kind for c in problem.candidates)
        if nats > rules.NAMED_NATS and places > 1:  # the spread of one alone is its family's
            # Numbers that a healthy one has none of, as its shape says nothing of them, are not said to scatter.
            shown = np.diag(problem.grams.sum(axis=0))[problem.spans[kinds[kind]]] > 0.0
            numbers = tuple(p for p, shows in zip(candidate.parameters, shown, strict=True) if shows)
            each = _each(hypothesis, kind, shown)
            out.append(Scatter(replace(candidate, parameters=numbers), factor, places, nats, each))
    return tuple(sorted(out, key=lambda item: -item.factor))


def _each(
    hypothesis: Hypothesis, kind: str, shown: NDArray[np.bool_]
) -> tuple[tuple[Candidate, Array, Array], ...]:
    """Places of a kind that scatters, with the numbers that show and their errors, the farthest off first."""
    out: list[tuple[float, tuple[Candidate, Array, Array]]] = []
    for index, candidate in enumerate(hypothesis.problem.candidates):
        if candidate.cause == kind and index not in hypothesis.free and hypothesis.fit.uses(index):
            values, covariance = hypothesis.fit.part(index)
            se = np.sqrt(np.maximum(np.diag(covariance), 0.0))
            item = candidate, (values * candidate.units)[shown], (se * candidate.units)[shown]
            out.append((float(np.abs(values[shown]).max(initial=0.0)), item))  # over the tolerance
    return tuple(item for _, item in sorted(out, key=lambda pair: -pair[0]))

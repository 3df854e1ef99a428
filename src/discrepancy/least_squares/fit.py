"""A solution of the linear problem, and what it says about every candidate."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.least_squares.asked import Asked
from discrepancy.least_squares.columns import portions
from discrepancy.least_squares.gram import flat_inverse, gram_of
from discrepancy.least_squares.opened import best_of
from discrepancy.least_squares.problem import Problem
from discrepancy.least_squares.stored import given_back
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Fit:
    """A solution of the problem.

    Attributes:
        problem: what it solves.
        free: candidates without a prior.
        used: columns in the model, indices.
        solution: their values, in units.
        covariance: of the solution.
        misfit: chi-square, the priors' part included.
        gram: the Gram matrix it was fitted to.
    """

    problem: Problem
    free: tuple[int, ...]
    used: NDArray[np.intp]
    solution: Array
    covariance: Array
    misfit: float
    gram: Array

    @classmethod
    def of(
        cls,
        problem: Problem,
        free: Sequence[int] = (),
        trials: Sequence[int] | None = None,
        *,
        background: bool = True,
        fixed: tuple[int, Array] | None = None,
    ) -> Fit:
        """Least squares with tolerances as priors, except for the candidates in ``free``.

        Args:
            problem: what to solve.
            free: indices of candidates whose parameters may leave their tolerance.
            trials: which trials count; None for all.
            background: whether the other candidates are in the model, within their tolerances.
            fixed: a candidate held at given values (in units) instead.
        """
        grams = problem.grams if trials is None else problem.grams[list(trials)]
        gram, held = grams.sum(axis=0), ()
        if fixed is not None:
            index, values = fixed
            held, residual = (index,), np.eye(len(gram))
            residual[problem.spans[index], -1] = -values  # without what the fixed values explain
            gram = residual.T @ gram @ residual
        return cls.of_gram(problem, gram, free, background=background, held=held)

    @classmethod
    def of_gram(
        cls,
        problem: Problem,
        gram: Array,
        free: Sequence[int],
        *,
        background: bool = True,
        held: Sequence[int] = (),
    ) -> Fit:
        """The same for the Gram matrix of any of the problem's rows; candidates in ``held`` are not in the model."""
        prior = np.concatenate([np.zeros(problem.shared), problem.tolerant / problem.spread**2])
        used = np.concatenate([np.ones(problem.shared, dtype=bool), problem.tolerant & background])
        for index in held:
            used[problem.spans[index]] = False
        for index in free:
            prior[problem.spans[index]] = 0.0
            used[problem.spans[index]] = True
        at = np.flatnonzero(used)
        covariance = flat_inverse(gram[np.ix_(at, at)] + np.diag(prior[at]))
        b = gram[at, -1]
        solution = covariance @ b
        misfit = float(gram[-1, -1] - b @ solution)
        return cls(problem, tuple(free), at, solution, covariance, misfit, gram)

    @property
    def coefficients(self) -> Array:
        """One value per column of the problem, zero for unused ones."""
        full = np.zeros(self.gram.shape[0] - 1)
        full[self.used] = self.solution
        return full

    @property
    def shared(self) -> Array:
        """Values of the shared unknowns, shape (s,)."""
        return self.coefficients[: self.problem.shared]

    @property
    def active(self) -> list[tuple[Candidate, Array]]:
        """Candidates without a prior, and their values in their own units."""
        candidates = self.problem.candidates
        return [(candidates[i], self.part(i)[0] * candidates[i].units) for i in self.free]

    @property
    def chi2(self) -> float:
        """Chi-square of all trials with the noise as whitened, and of the tolerances in use."""
        x = np.append(-self.coefficients, 1.0)
        left = sum(float(grams.squares(x).sum()) for grams in self.problem.cell_grams)
        return left + self.used_of_tolerances

    def at(self, index: int) -> NDArray[np.intp]:
        """Where one candidate's parameters are in the solution, shape (k,); it must be in the model."""
        span = self.problem.spans[index]
        return np.searchsorted(self.used, np.arange(span.start, span.stop))

    def uses(self, index: int) -> bool:
        """Whether a candidate is in the model."""
        return self.problem.spans[index].start in self.used

    def part(self, index: int) -> tuple[Array, Array]:
        """Values and covariance of one candidate's parameters, in units; it must be in the model."""
        at = self.at(index)
        return self.solution[at], self.covariance[np.ix_(at, at)]

    @property
    def used_of_tolerances(self) -> float:
        """Chi-square of the tolerances in use, over their spreads."""
        prior = np.zeros(self.gram.shape[0] - 1, dtype=bool)
        prior[self.problem.shared :] = self.problem.tolerant
        for index in self.free:
            prior[self.problem.spans[index]] = False
        at = prior[self.used]
        spread = np.concatenate([np.ones(self.problem.shared), self.problem.spread])[self.used][at]
        return float(np.sum((self.solution[at] / spread) ** 2))

    def held_out(self, trial: int) -> float:
        """Chi-square of one trial under this solution, without the priors' part."""
        return self.chi2_of(self.problem.grams[trial])

    def chi2_of(self, gram: Array) -> float:
        """The same of any rows, by their Gram matrix."""
        x = np.append(-self.coefficients, 1.0)
        return float(x @ gram @ x)

    def local(self, trial: int) -> Array:
        """Values of a trial's own unknowns that go with the solution, shape (l,)."""
        own = self.problem.local[trial]
        left = self.problem.raw_times(trial, np.append(-self.coefficients, 1.0))
        both = np.concatenate([own, left[..., None]], axis=2)
        opened = [each[trial] for each in self.problem.opened.values()]
        # What causes leave open has unit size: so many rows more, and each column with its own best beside it.
        both, best = best_of(opened, both) if opened else (both, np.zeros((0, both.shape[2])))
        flat = np.vstack([both.reshape(left.size, -1), best])
        values = np.linalg.lstsq(flat[:, :-1], flat[:, -1], rcond=None)[0]
        return np.asarray(values, dtype=np.float64)

    def remaining(self, trial: int) -> Array:
        """Whitened residual that the solution leaves in one trial, shape (n, C)."""
        left = self.problem.raw_times(trial, np.append(-self.coefficients, 1.0))
        return self.problem.without_own(trial, left[..., None])[..., 0]

    def solution_with(self, columns: Sequence[Array]) -> tuple[Array, Array]:
        """Values (k,) and covariance (k, k) of further columns, shape (n, C, k) per trial, beside all in the model."""
        information, score = self.told_by(columns)
        covariance = flat_inverse(information)
        return covariance @ score, covariance

    def told_by(self, columns: Sequence[Array]) -> tuple[Array, Array]:
        """Information about the values of further columns given all in the model, and their score vector."""
        return self.told_by_each([columns])[0]

    def told_by_each(
        self, sets: Sequence[Sequence[Array]], units: Sequence[Array] | None = None
    ) -> list[tuple[Array, Array]]:
        """The same of several sets of columns, each alone beside the model; together they take less time.

        Args:
            sets: columns of every trial, shape (n, C, k) each; they may be made as they are asked for.
            units: of their values, shape (k,) each; None for 1.
        """
        units = [np.ones(columns[0].shape[2]) for columns in sets] if units is None else units
        ends = np.cumsum([0, *map(len, units)])
        spans = [slice(*pair) for pair in pairwise(ends)]
        own_grams = [np.zeros((len(unit),) * 2) for unit in units]
        edge = np.zeros((self.gram.shape[0], ends[-1]))
        for t in self.problem.trials:
            here: list[int] = []  # of which there are columns, as a transient is in one trial only
            again: list[tuple[int, Asked]] = []
            for some in portions(_there(self.problem, sets, units, t, here, again), rules.TOLD_BYTES):
                own = self.problem.spectrum(t, some)
                weighted, at = own * self.problem.weights[t], 0
                products = self.problem.products(t, weighted)
                for k in here:
                    its = slice(at, at + len(own_grams[k]))
                    own_grams[k] += gram_of(weighted[..., its], own[..., its])
                    edge[:, spans[k]] += products[:, its]
                    at = its.stop
                here.clear()
            for k, asked in again:
                weights = 1.0 / self.problem.power[t]
                own_grams[k] += units[k][:, None] * asked.own(weights) * units[k]
                edge[:, spans[k]] += asked.beside(self.problem.columns[t], weights) * units[k]
        crosses = [edge[self.used, span].T for span in spans]
        return [
            (gram - cross @ self.covariance @ cross.T, edge[-1, span] - cross @ self.solution)
            for gram, cross, span in zip(own_grams, crosses, spans, strict=True)
        ]

    def told(self, index: int) -> tuple[Array, Array]:
        """Information about a candidate given all else in the model, and its score vector."""
        if self.problem.has_tolerance(index):
            values, covariance = self.part(index)
            inverse = np.linalg.inv(covariance)
            own = np.diag(self.problem.spread[self.problem.columns_of(index)] ** -2.0)
            return inverse - own, inverse @ values
        return self.told_besides(index)

    def told_besides(self, index: int) -> tuple[Array, Array]:
        """The same of a candidate that is not in the model."""
        span = self.problem.spans[index]
        cross = self.gram[span][:, self.used]
        information = self.gram[span, span] - cross @ self.covariance @ cross.T
        return information, self.gram[span, -1] - cross @ self.solution


def _there(
    problem: Problem, sets: Sequence[Sequence[Array]], units: Sequence[Array], trial: int, here: list[int],
    again: list[tuple[int, Asked]],
) -> Iterator[Array]:  # fmt: skip
    """Columns of a trial that are not nought, one set after the other, each of which is noted in ``here``.

    Those that were asked about before are noted in ``again`` instead.
    """
    kept = not problem.opened and not problem.columns[trial].is_single
    for k, (columns, unit) in enumerate(zip(sets, units, strict=True)):
        own = columns[trial]
        if own[len(own) // 2 :][:1].any() or own.any():  # of most one row tells, in less time
            asked = problem.again[trial].of(own, partial(problem.spectrum, trial)) if kept else None
            if asked is not None:
                again.append((k, asked))
            else:
                here.append(k)
                yield own * unit
        given_back(own)

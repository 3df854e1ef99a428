"""A solution of the linear problem, and what it says about every candidate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from discrepancy import rules
from discrepancy.least_squares.gram import flat_inverse, gram_of, project

if TYPE_CHECKING:
    from discrepancy.least_squares.problem import Problem

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the data say about one candidate.

    Attributes:
        index: which candidate.
        gain: how much chi-square falls when its parameters leave their tolerance.
        fall: how much it falls when they are free in place of nought (the same where there is no tolerance).
        parameters: how many of them (or of their combinations) the data can see.
        log10_p: of such a gain on clean data.
        score: gain less the penalty for parameters.
        values: parameters in units, MAP with their own prior removed, shape (k,).
        covariance: of the values, shape (k, k).
    """

    index: int
    gain: float
    fall: float
    parameters: int
    log10_p: float
    score: float
    values: Array
    covariance: Array


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
        gram: Array,
        free: tuple[int, ...],
        *,
        background: bool = True,
        held: tuple[int, ...] = (),
    ) -> Fit:
        """Solve; see ``Problem.fit``."""
        columns = gram.shape[0] - 1
        prior = np.concatenate([np.zeros(problem.shared), problem.tolerant.astype(float)])
        used = np.concatenate([np.ones(problem.shared, dtype=bool), problem.tolerant & background])
        for index in held:
            used[problem.spans[index]] = False
        for index in free:
            prior[problem.spans[index]] = 0.0
            used[problem.spans[index]] = True
        at = np.flatnonzero(used)
        H = gram[np.ix_(at, at)] + np.diag(prior[at])
        covariance = flat_inverse(H)
        b = gram[at, columns]
        solution = covariance @ b
        return cls(problem, free, at, solution, covariance, float(gram[-1, -1] - b @ solution), gram)

    @property
    def coefficients(self) -> Array:
        """One value per column of the problem, zero for unused ones."""
        full = np.zeros(self.gram.shape[0] - 1)
        full[self.used] = self.solution
        return full

    def part(self, index: int) -> tuple[Array, Array]:
        """Values and covariance of one candidate's parameters, in units; it must be in the model."""
        at = np.searchsorted(self.used, np.arange(*self.problem.spans[index].indices(1 << 30)))
        return self.solution[at], self.covariance[np.ix_(at, at)]

    @property
    def strain(self) -> tuple[float, float, float]:
        """How hard the tolerances are used: their chi-square, its degrees of freedom, log10 p of as much."""
        prior = np.zeros(self.gram.shape[0] - 1, dtype=bool)
        prior[self.problem.shared :] = self.problem.tolerant
        for index in self.free:
            prior[self.problem.spans[index]] = False
        at = prior[self.used]
        value = float(np.sum(self.solution[at] ** 2))
        freedom = float(np.sum(1.0 - np.minimum(np.diag(self.covariance)[at], 1.0)))
        return value, freedom, float(chi2.logsf(value, max(freedom, 1e-9)) / np.log(10.0))

    def held_out(self, trial: int) -> float:
        """Chi-square of one trial under this solution, without the priors' part."""
        x = np.append(-self.coefficients, 1.0)
        return float(x @ self.problem.grams[trial] @ x)

    def local(self, trial: int) -> Array:
        """Values of a trial's own unknowns that go with the solution, shape (l,)."""
        columns = self.problem.local[trial]
        left = self.problem.raw[trial] @ np.append(-self.coefficients, 1.0)
        flat = columns.reshape(left.size, columns.shape[2])
        return np.asarray(np.linalg.lstsq(flat, left.ravel(), rcond=None)[0], dtype=np.float64)

    def remaining(self, trial: int) -> Array:
        """Whitened residual that the solution leaves in one trial, shape (n, C)."""
        return self.problem.rows[trial] @ np.append(-self.coefficients, 1.0)

    def evidence(self, inflation: float = 1.0) -> list[Evidence]:
        """Evidence of every candidate that is not free yet, undecidable ones left out.

        Args:
            inflation: of the noise's variance, at least 1; divides the gain before it is judged.
        """
        found = [self.evidence_of(index, inflation) for index in range(len(self.problem.spans))]
        return sorted((e for e in found if e is not None), key=lambda e: -e.score)

    def evidence_of(self, index: int, inflation: float = 1.0) -> Evidence | None:
        """Evidence of one candidate; None if it is free already or undecidable."""
        if index in self.free:
            return None
        information, score, tolerant = self._information(self.problem.spans[index])
        return self._judged(index, information, score, inflation, tolerant=tolerant)

    def evidence_with(self, index: int, columns: Sequence[Array], inflation: float = 1.0) -> Evidence | None:
        """Evidence of a candidate that is not in the model, if its columns were others, shape (n, C, k) per trial.

        The same as that of ``Problem.with_columns``, without changing the problem.
        """
        units = self.problem.candidates[index].units
        information, score = self._told_by([new * units for new in columns])
        return self._judged(index, information, score, inflation, tolerant=self._tolerant(index))

    def fall_with(self, columns: Sequence[Array]) -> float:
        """How much chi-square falls with further columns, shape (n, C, k) per trial, whose values are free."""
        information, score = self._told_by(columns)
        eigenvalues, vectors = np.linalg.eigh(information)
        keep = eigenvalues > rules.LEAST_INFORMATION
        return float(np.sum((vectors[:, keep].T @ score) ** 2 / eigenvalues[keep]))

    def solution_with(self, columns: Sequence[Array]) -> tuple[Array, Array]:
        """Values (k,) and covariance (k, k) of further columns, shape (n, C, k) per trial, beside all in the model."""
        information, score = self._told_by(columns)
        covariance = flat_inverse(information)
        return covariance @ score, covariance

    def _told_by(self, columns: Sequence[Array]) -> tuple[Array, Array]:
        """Information about the values of further columns given all in the model, and their score vector."""
        k = columns[0].shape[2]
        information, edge = np.zeros((k, k)), np.zeros((self.gram.shape[0], k))
        for rows, explicable, new in zip(self.problem.rows, self.problem.explicable, columns, strict=True):
            if new.any():  # a transient is in one trial only
                own = project(new, explicable)
                information += gram_of(own, own)
                edge += gram_of(rows, own)
        cross = edge[self.used].T
        return information - cross @ self.covariance @ cross.T, edge[-1] - cross @ self.solution

    def _judged(
        self, index: int, information: Array, score: Array, inflation: float, *, tolerant: bool
    ) -> Evidence | None:
        eigenvalues, vectors = np.linalg.eigh(information)
        keep = eigenvalues > rules.LEAST_INFORMATION
        if not keep.any():
            return None
        lam, V = eigenvalues[keep], vectors[:, keep]
        z = V.T @ score
        fall = float(np.sum(z**2 / lam))
        gain = (float(np.sum(z**2 / (lam * (1.0 + lam)))) if tolerant else fall) / inflation
        k = len(lam)
        return Evidence(
            index,
            gain,
            fall,
            k,
            float(chi2.logsf(gain, k) / np.log(10.0)),
            gain - rules.COMPLEXITY * k * np.log(self.problem.samples),
            V @ (z / lam),
            (V / lam) @ V.T,
        )

    def _tolerant(self, index: int) -> bool:
        span, start = self.problem.spans[index], self.problem.shared
        return bool(self.problem.tolerant[span.start - start : span.stop - start].all())

    def limits(self, gain: float) -> list[Array]:
        """Size of every candidate's parameters, each alone, that raises the evidence by ``gain``; infinite if none.

        In the parameters' own units; one array (k,) per candidate.
        """
        out = []
        for candidate, span in zip(self.problem.candidates, self.problem.spans, strict=True):
            information, _, tolerant = self._information(span)
            lam, V = np.linalg.eigh(information)
            keep = lam > rules.LEAST_INFORMATION
            weight = lam[keep] / (1.0 + lam[keep]) if tolerant else lam[keep]
            power = np.einsum("ik,k,ik->i", V[:, keep], weight, V[:, keep])
            size = np.sqrt(gain / np.maximum(power, 1e-300))
            out.append(np.where(power > 0, candidate.units * size, np.inf))
        return out

    def _information(self, span: slice) -> tuple[Array, Array, bool]:
        """Information about a candidate given all else in the model, its score vector, and whether it has a prior."""
        start = self.problem.shared
        if self.problem.tolerant[span.start - start : span.stop - start].all():
            at = np.searchsorted(self.used, np.arange(span.start, span.stop))
            inverse = np.linalg.inv(self.covariance[np.ix_(at, at)])
            return inverse - np.eye(len(at)), inverse @ self.solution[at], True
        cross = self.gram[span][:, self.used]
        information = self.gram[span, span] - cross @ self.covariance @ cross.T
        return information, self.gram[span, -1] - cross @ self.solution, False

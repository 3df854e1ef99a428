"""All trials as one linear problem: Gram matrices, tolerances as priors, evidence of every candidate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from discrepancy.rig import Candidate, Rows

Array = NDArray[np.float64]

LEAST_INFORMATION = 1e-3
"""A direction about which the data say less than this (inverse variance in tolerances) is undecidable."""
COMPLEXITY = 1.6
"""Penalty per parameter and ln n, on the scale of chi-square."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the data say about one candidate.

    Attributes:
        index: which candidate.
        gain: how much chi-square falls when its parameters leave their tolerance.
        parameters: how many of them (or of their combinations) the data can see.
        log10_p: of such a gain on clean data.
        score: gain less the penalty for parameters.
        values: parameters in units, MAP with their own prior removed, shape (k,).
        covariance: of the values, shape (k, k).
    """

    index: int
    gain: float
    parameters: int
    log10_p: float
    score: float
    values: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """Rows of all trials, with the trial's own unknowns projected out and without.

    Columns are [shared | every candidate, in units of its tolerance | residual].

    Attributes:
        candidates: the candidates of the columns.
        raw: rows per trial, shape (n, C, columns).
        rows: the same without what the trial's own unknowns can explain.
        local: columns of the trial's own unknowns, shape (n, C, l).
        grams: Gram matrices of ``rows``, shape (trials, columns, columns).
        shared: number of shared unknowns.
        spans: columns of every candidate.
        tolerant: which candidate columns have a tolerance, shape (all candidate columns,).
    """

    candidates: tuple[Candidate, ...]
    raw: tuple[Array, ...]
    rows: tuple[Array, ...]
    local: tuple[Array, ...]
    grams: Array
    shared: int
    spans: tuple[slice, ...]
    tolerant: NDArray[np.bool_]

    @classmethod
    def of(cls, trials: Sequence[Rows], candidates: Sequence[Candidate]) -> Problem:
        """Assemble the problem; columns become unit parameters by the candidates' units."""
        units = [c.units for c in candidates]
        raw = []
        for trial in trials:
            parts = [trial.shared, *(a * u for a, u in zip(trial.causes, units, strict=True))]
            raw.append(np.concatenate([*parts, trial.residual[..., None]], axis=2))
        return cls._from(candidates, raw, [trial.local for trial in trials], trials[0].shared.shape[2])

    @classmethod
    def _from(
        cls, candidates: Sequence[Candidate], raw: Sequence[Array], local: Sequence[Array], shared: int
    ) -> Problem:
        spans, at = [], shared
        for candidate in candidates:
            spans.append(slice(at, at + len(candidate.parameters)))
            at += len(candidate.parameters)
        tolerant = np.array([p.tolerance > 0 for c in candidates for p in c.parameters], dtype=bool)
        rows = [_project(x, own) for x, own in zip(raw, local, strict=True)]
        grams = np.array([_gram(r, r) for r in rows])
        return cls(
            tuple(candidates), tuple(raw), tuple(rows), tuple(local), grams, shared, tuple(spans), tolerant
        )

    @property
    def samples(self) -> int:
        """Number of whitened residuals in all trials."""
        return sum(r.shape[0] * r.shape[1] for r in self.rows)

    def index_of(self, candidate: Candidate) -> int | None:
        """Where a candidate of the same cause and place (and interval) is, or None."""
        for index, other in enumerate(self.candidates):
            if other.key == candidate.key and dict(other.detail) == dict(candidate.detail):
                return index
        return None

    def with_residual(self, residuals: Sequence[Array]) -> Problem:
        """The same columns with another residual, shape (n, C) per trial."""
        return self._with(
            len(self.tolerant) + self.shared, [r[..., None] for r in residuals], self.candidates
        )

    def with_columns(self, index: int, candidate: Candidate, columns: Sequence[Array]) -> Problem:
        """One candidate replaced by another of as many parameters."""
        candidates = (*self.candidates[:index], candidate, *self.candidates[index + 1 :])
        return self._with(self.spans[index].start, [c * candidate.units for c in columns], candidates)

    def _with(self, start: int, columns: Sequence[Array], candidates: tuple[Candidate, ...]) -> Problem:
        raw, rows, grams = [], [], self.grams.copy()
        for t, new in enumerate(columns):
            at = slice(start, start + new.shape[2])
            raw.append(self.raw[t].copy())
            rows.append(self.rows[t].copy())
            raw[t][..., at], rows[t][..., at] = new, _project(new, self.local[t])
            edge = _gram(rows[t], rows[t][..., at])
            grams[t][:, at], grams[t][at] = edge, edge.T
        return Problem(
            candidates, tuple(raw), tuple(rows), self.local, grams, self.shared, self.spans, self.tolerant
        )

    def with_unknowns(self, unknowns: Sequence[Array]) -> Problem:
        """The problem with further unknowns of every trial, shape (n, C, k) each."""
        if not any(u.shape[2] for u in unknowns):
            return self
        local = [np.concatenate([a, b], axis=2) for a, b in zip(self.local, unknowns, strict=True)]
        return Problem._from(self.candidates, self.raw, local, self.shared)

    def extended(self, candidate: Candidate, columns: Sequence[Array]) -> Problem:
        """The problem with one candidate more."""
        raw, rows, grams = [], [], []
        for t, new in enumerate(columns):
            scaled = new * candidate.units
            own = _project(scaled, self.local[t])
            raw.append(np.concatenate([self.raw[t][..., :-1], scaled, self.raw[t][..., -1:]], axis=2))
            rows.append(np.concatenate([self.rows[t][..., :-1], own, self.rows[t][..., -1:]], axis=2))
            edge, corner = _gram(self.rows[t], own), _gram(own, own)
            old = self.grams[t]
            grams.append(
                np.block(
                    [
                        [old[:-1, :-1], edge[:-1], old[:-1, -1:]],
                        [edge[:-1].T, corner, edge[-1:].T],
                        [old[-1:, :-1], edge[-1:], old[-1:, -1:]],
                    ]
                )
            )
        start = self.spans[-1].stop if self.spans else self.shared
        span = slice(start, start + len(candidate.parameters))
        tolerant = np.append(self.tolerant, [p.tolerance > 0 for p in candidate.parameters]).astype(bool)
        return Problem(
            (*self.candidates, candidate), tuple(raw), tuple(rows), self.local, np.array(grams), self.shared,
            (*self.spans, span), tolerant,
        )  # fmt: skip

    def fit(
        self,
        free: Sequence[int] = (),
        trials: Sequence[int] | None = None,
        *,
        background: bool = True,
        fixed: tuple[int, Array] | None = None,
    ) -> Fit:
        """Least squares with tolerances as priors, except for the candidates in ``free``.

        Args:
            free: indices of candidates whose parameters may leave their tolerance.
            trials: which trials count; None for all.
            background: whether the other candidates are in the model, within their tolerances.
            fixed: a candidate held at given values (in units) instead.
        """
        gram = self.grams.sum(axis=0) if trials is None else self.grams[list(trials)].sum(axis=0)
        held: tuple[int, ...] = ()
        if fixed is not None:
            index, values = fixed
            held, span = (index,), self.spans[index]
            full = np.eye(len(gram))
            full[span, -1] = -values  # the residual without what the fixed values explain
            gram = full.T @ gram @ full
        return Fit.of(self, gram, tuple(free), background=background, held=held)


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
        scale = 1.0 / np.sqrt(np.maximum(np.diag(H), 1e-300))
        # A pseudo-inverse where the data leave a flat direction without a prior.
        values, vectors = np.linalg.eigh(H * np.outer(scale, scale))
        inverse = np.where(values > 1e-11 * values[-1], 1.0 / np.maximum(values, 1e-300), 0.0)
        covariance = (vectors * inverse) @ vectors.T * np.outer(scale, scale)
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
        eigenvalues, vectors = np.linalg.eigh(information)
        keep = eigenvalues > LEAST_INFORMATION
        if not keep.any():
            return None
        lam, V = eigenvalues[keep], vectors[:, keep]
        z = V.T @ score
        gain = float(np.sum(z**2 / (lam * (1.0 + lam) if tolerant else lam))) / inflation
        k = len(lam)
        return Evidence(
            index,
            gain,
            k,
            float(chi2.logsf(gain, k) / np.log(10.0)),
            gain - COMPLEXITY * k * np.log(self.problem.samples),
            V @ (z / lam),
            (V / lam) @ V.T,
        )

    def limits(self, gain: float) -> list[Array]:
        """Size of every candidate's parameters, each alone, that raises the evidence by ``gain``; infinite if none.

        In the parameters' own units; one array (k,) per candidate.
        """
        out = []
        for candidate, span in zip(self.problem.candidates, self.problem.spans, strict=True):
            information, _, tolerant = self._information(span)
            lam, V = np.linalg.eigh(information)
            keep = lam > LEAST_INFORMATION
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


def _gram(a: Array, b: Array) -> Array:
    return a.reshape(-1, a.shape[2]).T @ b.reshape(-1, b.shape[2])


def _project(x: Array, onto: Array) -> Array:
    """Take the columns ``onto`` out of x; shapes (n, C, k), (n, C, l)."""
    if onto.shape[2] == 0:
        return x
    u, d, _ = np.linalg.svd(onto.reshape(-1, onto.shape[2]), full_matrices=False)
    q = u[:, d > 1e-10 * d[0]]
    flat = x.reshape(-1, x.shape[2])
    return (flat - q @ (q.T @ flat)).reshape(x.shape)

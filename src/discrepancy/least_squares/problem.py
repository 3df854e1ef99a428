"""All trials as one linear problem: Gram matrices, tolerances as priors, evidence of every candidate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from discrepancy.least_squares.gram import gram_of, orthonormal, project
from discrepancy.rig import Candidate, Rows
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Problem:
    """Rows of all trials, with the trial's own unknowns projected out and without.

    Columns are [shared | every candidate, in units of its tolerance | residual].

    Attributes:
        candidates: the candidates of the columns.
        raw: rows per trial, shape (n, C, columns).
        rows: the same without what the trial's own unknowns can explain.
        local: columns of the trial's own unknowns, shape (n, C, l).
        explicable: orthonormal columns that span the same.
        grams: Gram matrices of ``rows``, shape (trials, columns, columns).
        shared: number of shared unknowns.
        spans: columns of every candidate.
        tolerant: which candidate columns have a tolerance, shape (all candidate columns,).
    """

    candidates: tuple[Candidate, ...]
    raw: tuple[Array, ...]
    rows: tuple[Array, ...]
    local: tuple[Array, ...]
    explicable: tuple[Array, ...]
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
        explicable = tuple(orthonormal(own) for own in local)
        rows = [project(x, own) for x, own in zip(raw, explicable, strict=True)]
        grams = np.array([gram_of(r, r) for r in rows])
        return cls(
            tuple(candidates), tuple(raw), tuple(rows), tuple(local), explicable, grams, shared, tuple(spans),
            tolerant,
        )  # fmt: skip

    @property
    def samples(self) -> int:
        """Number of whitened residuals in all trials."""
        return sum(r.shape[0] * r.shape[1] for r in self.rows)

    def has_tolerance(self, index: int) -> bool:
        """Whether a candidate has a tolerance; a cause has one for all of its parameters or for none."""
        span = self.spans[index]
        return bool(self.tolerant[span.start - self.shared : span.stop - self.shared].all())

    def index_of(self, candidate: Candidate) -> int | None:
        """Where a candidate of the same cause and place (and interval) is, or None."""
        for index, other in enumerate(self.candidates):
            if other.key == candidate.key and other.transient == candidate.transient:
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
            raw[t][..., at], rows[t][..., at] = new, project(new, self.explicable[t])
            edge = gram_of(rows[t], rows[t][..., at])
            grams[t][:, at], grams[t][at] = edge, edge.T
        return replace(self, candidates=candidates, raw=tuple(raw), rows=tuple(rows), grams=grams)

    def with_unknowns(self, unknowns: Sequence[Array]) -> Problem:
        """The problem with further unknowns of every trial, shape (n, C, k) each."""
        if not any(u.shape[2] for u in unknowns):
            return self
        local = [np.concatenate([a, b], axis=2) for a, b in zip(self.local, unknowns, strict=True)]
        return Problem._from(self.candidates, self.raw, local, self.shared)

    def extended(self, candidate: Candidate, columns: Sequence[Array]) -> Problem:
        """The problem with one candidate more."""
        start, count = self.shared + len(self.tolerant), len(candidate.parameters)
        place = [start] * count  # before the residual
        wider = replace(
            self,
            raw=tuple(np.insert(x, place, 0.0, axis=2) for x in self.raw),
            rows=tuple(np.insert(x, place, 0.0, axis=2) for x in self.rows),
            grams=np.insert(np.insert(self.grams, place, 0.0, axis=1), place, 0.0, axis=2),
            spans=(*self.spans, slice(start, start + count)),
            tolerant=np.append(self.tolerant, [p.tolerance > 0 for p in candidate.parameters]).astype(bool),
        )
        return wider._with(start, [c * candidate.units for c in columns], (*self.candidates, candidate))

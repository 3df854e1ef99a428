"""All trials as one linear problem: Gram matrices by cell of noise, spreads as priors."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.least_squares.cells import Cells
from discrepancy.least_squares.gram import gram_of, orthonormal, project
from discrepancy.least_squares.opened import Opened, through
from discrepancy.rig import Rows
from estimator.arrays import Array

Key = tuple[str, int | None, int | None]


@dataclass(frozen=True, eq=False)
class Problem:
    """Rows of all trials, with the trial's own unknowns projected out and without.

    Columns are [shared | every candidate, in units of its tolerance | residual]. Noise and priors are normal; how
    strong they are is not known beforehand: the noise has a power per cell, tolerances a factor per kind.

    Attributes:
        candidates: the candidates of the columns.
        raw: rows per trial, shape (n, C, columns).
        spectra: the same without what the trial's own unknowns can explain, in the cells' cosine transform.
        local: columns of the trial's own unknowns, shape (n, C, l).
        explicable: orthonormal columns that span the same.
        cells: of every trial.
        cell_grams: Gram matrices of ``spectra`` over every cell of a trial, shape (K, columns, columns) each.
        power: variance of the noise in every cell of a trial, shape (K,) each; 1 as whitened.
        shared: number of shared unknowns.
        spans: columns of every candidate.
        tolerant: which candidate columns have a tolerance and are no event, shape (all candidate columns,).
        spread: standard deviation of the candidates' parameters in units, shape (all candidate columns,).
        opened: what causes leave open in every trial, by cause.
        odds: of any cause being there before the data are seen, at all its places together.
    """

    candidates: tuple[Candidate, ...]
    raw: tuple[Array, ...]
    spectra: tuple[Array, ...]
    local: tuple[Array, ...]
    explicable: tuple[Array, ...]
    cells: tuple[Cells, ...]
    cell_grams: tuple[Array, ...]
    power: tuple[Array, ...]
    shared: int
    spans: tuple[slice, ...]
    tolerant: NDArray[np.bool_]
    spread: Array
    opened: Mapping[Key, tuple[Opened, ...]] = field(default_factory=dict)
    odds: float = rules.PRIOR_ODDS

    @classmethod
    def of(cls, trials: Sequence[Rows], candidates: Sequence[Candidate]) -> Problem:
        """Assemble the problem; columns become unit parameters by the candidates' units."""
        units = [c.units for c in candidates]
        raw, cells = [], []
        for trial in trials:
            parts = [trial.shared, *(a * u for a, u in zip(trial.causes, units, strict=True))]
            raw.append(np.concatenate([*parts, trial.residual[..., None]], axis=2))
            rows, channels = trial.residual.shape
            cells.append(Cells.of(rows, channels, trial.moving, trial.groups))
        shared, spans, at = trials[0].shared.shape[2], [], trials[0].shared.shape[2]
        for candidate in candidates:
            spans.append(slice(at, at + len(candidate.parameters)))
            at += len(candidate.parameters)
        tolerant = np.array([x for c in candidates for x in _tolerant(c)], dtype=bool)
        power = tuple(np.ones(len(c.sizes)) for c in cells)
        spread = np.ones(len(tolerant))
        own = [trial.local for trial in trials]
        return cls._from(candidates, raw, own, cells, power, shared, spans, tolerant, spread)

    @classmethod
    def _from(
        cls, candidates: Sequence[Candidate], raw: Sequence[Array], local: Sequence[Array], cells: Sequence[Cells],
        power: tuple[Array, ...], shared: int, spans: Sequence[slice], tolerant: NDArray[np.bool_], spread: Array,
    ) -> Problem:  # fmt: skip
        explicable = tuple(orthonormal(own) for own in local)
        spectra = tuple(c.spectrum(project(x, own)) for x, own, c in zip(raw, explicable, cells, strict=True))
        grams = tuple(c.grams(x, x) for x, c in zip(spectra, cells, strict=True))
        return cls(
            tuple(candidates), tuple(raw), spectra, tuple(local), explicable, tuple(cells), grams, power, shared,
            tuple(spans), tolerant, spread,
        )  # fmt: skip

    @property
    def samples(self) -> int:
        """Number of whitened residuals in all trials."""
        return sum(r.shape[0] * r.shape[1] for r in self.raw)

    @property
    def trials(self) -> range:
        """Indices of the trials."""
        return range(len(self.raw))

    @cached_property
    def grams(self) -> Array:
        """Gram matrices of every trial, every cell over its power, shape (trials, columns, columns)."""
        pairs = zip(self.power, self.cell_grams, strict=True)
        return np.array([np.tensordot(1.0 / power, grams, 1) for power, grams in pairs])

    @cached_property
    def weights(self) -> list[Array]:
        """One over the power of every number, shape (n, C, 1) per trial."""
        return [(1.0 / p)[c.index][..., None] for p, c in zip(self.power, self.cells, strict=True)]

    def tolerating(self, index: int) -> Problem:
        """With an event in the model that is within its tolerance."""
        tolerant = self.tolerant.copy()
        tolerant[self.columns_of(index)] = True
        return replace(self, tolerant=tolerant)

    @property
    def as_whitened(self) -> Problem:
        """With noise of unit power and tolerances as given."""
        power = tuple(np.ones_like(p) for p in self.power)
        return replace(self, power=power, spread=np.ones_like(self.spread))

    def with_noise(self, power: Sequence[Array], spread: Array) -> Problem:
        """With noise of other powers, and other spreads."""
        return replace(self, power=tuple(power), spread=spread)

    def rows(self, trial: int) -> Array:
        """Rows without what the trial's own unknowns can explain, in time, shape (n, C, columns)."""
        return self.without_own(trial, self.raw[trial])

    def weighted(self, trial: int) -> Array:
        """The same as a fit weighs them: every cell of the noise over its power, shape (n, C, columns)."""
        return self.cells[trial].series(self.spectra[trial] * np.sqrt(self.weights[trial]))

    def without_own(self, trial: int, x: Array) -> Array:
        """Rows without what the trial's own unknowns, and those that causes leave open, can explain, (n, C, k)."""
        return through([each[trial] for each in self.opened.values()], project(x, self.explicable[trial]))

    def spectrum(self, trial: int, columns: Array) -> Array:
        """Further columns, shape (n, C, k), without what the trial's own unknowns can explain, in the transform."""
        return self.cells[trial].spectrum(self.without_own(trial, columns))

    def has_tolerance(self, index: int) -> bool:
        """Whether a candidate has a tolerance; a cause has one for all of its parameters or for none."""
        return bool(self.tolerant[self.columns_of(index)].all())

    def columns_of(self, index: int) -> slice:
        """A candidate's columns among those of all candidates."""
        span = self.spans[index]
        return slice(span.start - self.shared, span.stop - self.shared)

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

    def _with(
        self, start: int, columns: Sequence[Array], candidates: tuple[Candidate, ...], room: int = 0
    ) -> Problem:
        """With other columns from ``start`` on, for which so many of them may be made first."""
        raw, spectra, grams, place = [], [], [], [start] * room
        for t, new in enumerate(columns):
            at = slice(start, start + new.shape[2])
            raw.append(np.insert(self.raw[t], place, 0.0, axis=2))
            spectra.append(np.insert(self.spectra[t], place, 0.0, axis=2))
            grams.append(np.insert(np.insert(self.cell_grams[t], place, 0.0, axis=1), place, 0.0, axis=2))
            raw[t][..., at], spectra[t][..., at] = new, self.spectrum(t, new)
            edge = self.cells[t].grams(spectra[t], spectra[t][..., at])
            grams[t][:, :, at], grams[t][:, at] = edge, np.swapaxes(edge, 1, 2)
        parts: Mapping[str, tuple[Array, ...]] = {
            "raw": tuple(raw), "spectra": tuple(spectra), "cell_grams": tuple(grams)
        }  # fmt: skip
        return replace(self, candidates=candidates, **parts)

    def with_unknowns(self, key: Key, unknowns: Sequence[Array], size: float) -> Problem:
        """The problem with what a cause leaves open in every trial.

        Args:
            key: of the cause.
            unknowns: columns, shape (n, C, k) per trial.
            size: standard deviation of their values.
        """
        if key in self.opened or not any(u.shape[2] for u in unknowns):
            return self
        own = [Opened.of(u, size, self.without_own(t, u)) for t, u in enumerate(unknowns)]
        spectra, grams = [], []
        for one, cells, old, gram in zip(own, self.cells, self.spectra, self.cell_grams, strict=True):
            if not len(one.shrink):
                spectra.append(old)
                grams.append(gram)
                continue
            along = cells.spectrum(one.basis)
            shares = one.shrink[:, None] * gram_of(along, old)  # the transform is orthonormal
            spectra.append(old - along @ shares)
            edge = cells.grams(along, old)
            inside = cells.grams(along, along) @ shares
            cross = np.einsum("ji,kjl->kil", shares, edge - 0.5 * inside, optimize=True)
            grams.append(gram - cross - np.swapaxes(cross, 1, 2))
        return replace(
            self, spectra=tuple(spectra), cell_grams=tuple(grams), opened={**self.opened, key: tuple(own)}
        )

    def without_unknowns(self, keep: Collection[Key]) -> Problem:
        """The problem without what causes other than those to keep leave open."""
        if all(key in keep for key in self.opened):
            return self
        again = Problem._from(
            self.candidates, self.raw, self.local, self.cells, self.power, self.shared, self.spans, self.tolerant,
            self.spread,
        )  # fmt: skip
        again = replace(again, odds=self.odds)
        for key, own in self.opened.items():
            if key in keep:
                again = again.with_unknowns(key, [one.columns for one in own], 1.0)
        return again

    @property
    def price(self) -> float:
        """What all that causes leave open costs [nats]."""
        return sum(one.price for own in self.opened.values() for one in own)

    def extended(self, candidate: Candidate, columns: Sequence[Array]) -> Problem:
        """The problem with one candidate more."""
        start, count = self.shared + len(self.tolerant), len(candidate.parameters)
        # Before the residual.
        wider = self._with(
            start, [c * candidate.units for c in columns], (*self.candidates, candidate), count
        )
        return replace(
            wider,
            spans=(*self.spans, slice(start, start + count)),
            tolerant=np.append(self.tolerant, _tolerant(candidate)).astype(bool),
            spread=np.append(self.spread, np.ones(count)),
        )


def _tolerant(candidate: Candidate) -> list[bool]:
    """Whether each parameter has a tolerance; an event is there or not."""
    return [parameter.tolerance > 0 and candidate.transient is None for parameter in candidate.parameters]

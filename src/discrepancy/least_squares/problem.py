"""All trials as one linear problem: Gram matrices by cell of noise, spreads as priors."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.least_squares.along import Along, Taken, spliced
from discrepancy.least_squares.asked import Again
from discrepancy.least_squares.cell_grams import CellGrams
from discrepancy.least_squares.cells import Cells
from discrepancy.least_squares.columns import Columns, held, portions
from discrepancy.least_squares.gram import orthonormal, project
from discrepancy.least_squares.opened import Opened, through
from discrepancy.least_squares.patches import Patches
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
        columns: of every trial, without what its own unknowns can explain.
        local: columns of the trial's own unknowns, shape (n, C, l).
        explicable: orthonormal columns that span the same.
        cells: of every trial.
        degrees: numbers in every cell that the trial's own unknowns leave, of its size, shape (K,) each.
        cell_grams: Gram matrices over every cell of a trial, K of (columns, columns) each.
        power: variance of the noise in every cell of a trial, shape (K,) each; 1 as whitened.
        shared: number of shared unknowns.
        spans: columns of every candidate.
        tolerant: which candidate columns have a tolerance and are no event, shape (all candidate columns,).
        spread: standard deviation of the candidates' parameters in units, shape (all candidate columns,).
        opened: what causes leave open in every trial, by cause.
        taken: what lies along that of every trial's columns, and is taken out of them; empty where nothing is open.
        odds: of any cause being there before the data are seen, at all its places together.
        by_own: products of the columns with a trial's own unknowns over every cell, (K, columns, l), once asked for.
        again: what further columns were asked about, of every trial.
    """

    candidates: tuple[Candidate, ...]
    columns: tuple[Columns, ...]
    local: tuple[Array, ...]
    explicable: tuple[Array, ...]
    cells: tuple[Cells, ...]
    degrees: tuple[Array, ...]
    cell_grams: tuple[CellGrams, ...]
    power: tuple[Array, ...]
    shared: int
    spans: tuple[slice, ...]
    tolerant: NDArray[np.bool_]
    spread: Array
    opened: Mapping[Key, tuple[Opened, ...]] = field(default_factory=dict)
    taken: tuple[Taken, ...] = ()
    odds: float = rules.PRIOR_ODDS
    by_own: dict[int, Array] = field(default_factory=dict, repr=False)
    again: tuple[Again, ...] = field(default=(), repr=False)

    @classmethod
    def of(cls, trials: Iterable[Rows], candidates: Sequence[Candidate]) -> Problem:
        """Assemble the problem; columns become unit parameters by the candidates' units.

        Args:
            trials: rows, each with the columns of all candidates; they may come one at a time.
            candidates: of these columns.
        """
        units = [c.units for c in candidates]
        columns, local, explicable, cells, degrees, grams, shared = [], [], [], [], [], [], 0
        for trial in trials:
            causes = (a * u for a, u in zip(trial.causes, units, strict=True))
            shared, (rows, channels) = trial.shared.shape[2], trial.residual.shape
            cells.append(Cells.of(rows, channels, trial.moving, trial.groups))
            local.append(trial.local)
            explicable.append(orthonormal(trial.local))
            degrees.append(cells[-1].left_by(explicable[-1]))
            every = chain([trial.shared], causes, [trial.residual[..., None]])
            columns.append(Columns((), np.zeros((explicable[-1].shape[2], 0))))
            for raw in portions(every, rules.PORTION_BYTES):
                columns[-1] = columns[-1].beside(Columns.of(raw, explicable[-1], cells[-1]))
                columns = held(columns, rules.ROWS_BYTES)
            grams.append(CellGrams.of_columns(columns[-1], cells[-1]))
        ends = np.cumsum([shared, *(len(c.parameters) for c in candidates)]).tolist()
        spans = map(slice, ends[:-1], ends[1:])
        tolerant = np.array([x for c in candidates for x in c.tolerant], dtype=bool)
        power = tuple(np.ones_like(own) for own in degrees)
        return cls(
            tuple(candidates), tuple(columns), tuple(local), tuple(explicable), tuple(cells), tuple(degrees),
            tuple(grams), power, shared, tuple(spans), tolerant, np.ones(len(tolerant)),
            again=tuple(map(Again, cells)),
        )  # fmt: skip

    @property
    def width(self) -> int:
        """Number of columns, the residual's included."""
        return self.shared + len(self.tolerant) + 1

    def raw_columns(self, trial: int, span: slice) -> Array:
        """Some columns of a trial as they are, with what its own unknowns can explain, shape (n, C, k)."""
        x, inside = self.columns[trial].take(span), self.columns[trial].inside[:, span]
        return self.cells[trial].series(x) + self.explicable[trial] @ inside

    def raw_times(self, trial: int, values: Array) -> Array:
        """All columns as they are, added up with their values (columns,) or (columns, k): (n, C) or (n, C, k)."""
        own = self.columns[trial]
        return self.cells[trial].series(own.times(values)) + self.explicable[trial] @ (own.inside @ values)

    def spectra_of(self, trial: int, span: slice) -> Array:
        """Some columns without what the trial's own unknowns and those of causes can explain, in the transform."""
        x, taken = self.columns[trial].take(span), self._taken(trial)
        return x - taken.of(span) if taken else x

    def _taken(self, trial: int) -> Taken | None:
        """What lies along what causes leave open in a trial; None where that is nothing."""
        return self.taken[trial] if self.taken and not self.taken[trial].is_nothing else None

    def products(self, trial: int, b: Array) -> Array:
        """Products of all such columns with others in the transform, (n, C, k) -> (columns, k)."""
        out, taken = self.columns[trial].products(b), self._taken(trial)
        return out - taken.products(self.cells[trial].series(b)) if taken else out

    def _grams(self, trial: int, b: Array) -> Array:
        """The same over every cell, shape (n, C, k) -> (K, columns, k)."""
        out, taken = self.columns[trial].grams(self.cells[trial], b), self._taken(trial)
        return out - taken.grams(b) if taken else out

    @property
    def samples(self) -> int:
        """Number of whitened residuals in all trials."""
        return sum(cells.index.size for cells in self.cells)

    @property
    def trials(self) -> range:
        """Indices of the trials."""
        return range(len(self.cells))

    @cached_property
    def grams(self) -> Array:
        """Gram matrices of every trial, every cell over its power, shape (trials, columns, columns)."""
        return np.array([own.weighted(1.0 / p) for p, own in zip(self.power, self.cell_grams, strict=True)])

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
        return self.with_noise([np.ones_like(p) for p in self.power], np.ones_like(self.spread))

    @property
    def calm(self) -> Problem:
        """With noise nowhere louder than as whitened."""
        return self.with_noise([np.minimum(power, 1.0) for power in self.power], self.spread)

    def with_noise(self, power: Sequence[Array], spread: Array) -> Problem:
        """With noise of other powers, and other spreads."""
        return replace(self, power=tuple(power), spread=spread)

    def rows(self, trial: int) -> Array:
        """Rows without what the trial's own unknowns can explain, in time, shape (n, C, columns)."""
        return self.cells[trial].series(self.spectra_of(trial, slice(None)))

    def without_own(self, trial: int, x: Array) -> Array:
        """Rows without what the trial's own unknowns, and those that causes leave open, can explain, (n, C, k)."""
        return through([each[trial] for each in self.opened.values()], project(x, self.explicable[trial]))

    def spectrum(self, trial: int, columns: Array) -> Array:
        """The same in the transform."""
        return self.cells[trial].spectrum(self.without_own(trial, columns))

    def has_tolerance(self, index: int) -> bool:
        """Whether a candidate has a tolerance; a cause has one for all of its parameters or for none."""
        return bool(self.tolerant[self.columns_of(index)].all())

    def columns_of(self, index: int) -> slice:
        """A candidate's columns among those of all candidates."""
        span = self.spans[index]
        return slice(span.start - self.shared, span.stop - self.shared)

    def index_of(self, candidate: Candidate) -> int | None:
        """Where a candidate of the same cause and place (and interval) is, or None; one with its tolerance first."""
        wanted = candidate.key, candidate.transient
        same = [i for i, other in enumerate(self.candidates) if (other.key, other.transient) == wanted]
        return min(same, key=lambda i: self.candidates[i].parameters != candidate.parameters, default=None)

    def with_residual(self, residuals: Sequence[Array]) -> Problem:
        """The same columns with another residual, shape (n, C) per trial."""
        return self._with(self.width - 1, [r[..., None] for r in residuals], self.candidates)

    def with_columns(self, index: int, candidate: Candidate, columns: Sequence[Array]) -> Problem:
        """One candidate replaced by another of as many parameters."""
        candidates = (*self.candidates[:index], candidate, *self.candidates[index + 1 :])
        return self._with(self.spans[index].start, [c * candidate.units for c in columns], candidates)

    def _with(
        self, start: int, columns: Sequence[Array], candidates: tuple[Candidate, ...], room: int = 0
    ) -> Problem:
        """With other columns from ``start`` on, for which so many of them may be made first."""
        made, grams, taken, by_own = [], [], [], dict[int, Array]()
        for t, raw in enumerate(columns):
            stop = start if room else start + raw.shape[2]
            new = Columns.of(raw, self.explicable[t], self.cells[t])
            made.append(self.columns[t].replaced(start, stop, new))
            left = project(raw, self.explicable[t])
            if self.taken:
                now, left = self.taken[t].replaced(start, stop, left)
                taken.append(now)
            left = self.cells[t].spectrum(left)
            edge, inside = self._grams(t, left), self.cells[t].grams(left, left)
            grams.append(self.cell_grams[t].replaced(start, stop, spliced(edge, start, stop, inside)))
            if t in self.by_own:
                beside = self.cells[t].grams(left, self.cells[t].spectrum(self.explicable[t]))
                by_own[t] = spliced(self.by_own[t], start, stop, beside)
        return replace(
            self, candidates=candidates, columns=tuple(made), cell_grams=tuple(grams), taken=tuple(taken),
            by_own=by_own,
        )  # fmt: skip

    def along(self, unknowns: Sequence[Patches]) -> tuple[Along, ...]:
        """All columns along what may be left open in every trial, of whatever size."""
        return tuple(self._along(t, u) for t, u in enumerate(unknowns))

    def _along(self, trial: int, unknowns: Patches) -> Along:
        own, cells = self.explicable[trial], self.cells[trial]
        taken = self.taken[trial] if self.taken else Taken.nothing(cells, own.shape[2], self.width)
        if trial not in self.by_own:
            self.by_own[trial] = self._grams(trial, cells.spectrum(own))
        one = Opened.of(unknowns, 1.0, own, taken.each)
        return Along.of(taken, one, self.columns[trial].channels, self.by_own[trial])

    def with_open(self, key: Key, along: Sequence[Along], size: float) -> Problem:
        """The problem with what a cause leaves open, whose values scatter by ``size``."""
        if key in self.opened or not any(len(one.opened.stretch) for one in along):
            return self
        pairs = zip(along, self.cell_grams, strict=True)
        opened, taken, grams, by_own = zip(*(one.of_size(size, own) for one, own in pairs), strict=True)
        return replace(
            self, cell_grams=grams, opened={**self.opened, key: opened}, taken=taken,
            by_own=dict(enumerate(by_own)),
        )  # fmt: skip

    def with_unknowns(self, key: Key, unknowns: Sequence[Patches], size: float) -> Problem:
        """The same from its columns in every trial."""
        return self if key in self.opened else self.with_open(key, self.along(unknowns), size)

    def without_unknowns(self, keep: Collection[Key]) -> Problem:
        """The problem without what causes other than those to keep leave open."""
        if all(key in keep for key in self.opened):
            return self
        pairs = zip(self.columns, self.cells, strict=True)
        grams = tuple(CellGrams.of_columns(*pair) for pair in pairs)
        again = replace(self, cell_grams=grams, opened={}, taken=(), by_own={})
        for key, own in self.opened.items():
            if key in keep:
                again = again.with_unknowns(key, [one.columns for one in own], own[0].size)
        return again

    @property
    def price(self) -> float:
        """What all that causes leave open costs [nats]."""
        return sum(one.price for own in self.opened.values() for one in own)

    def extended(self, candidate: Candidate, columns: Sequence[Array]) -> Problem:
        """The problem with one candidate more."""
        start, count = self.width - 1, len(candidate.parameters)  # before the residual
        own, candidates = [c * candidate.units for c in columns], (*self.candidates, candidate)
        return replace(
            self._with(start, own, candidates, count),
            spans=(*self.spans, slice(start, start + count)),
            tolerant=np.append(self.tolerant, candidate.tolerant).astype(bool),
            spread=np.append(self.spread, np.ones(count)),
        )

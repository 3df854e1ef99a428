"""Parts of the logs that foretell each other: the columns of a set of causes, part by part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idct

from discrepancy.evidence.cells import Bands, Cells, Channel
from discrepancy.evidence.posterior import Posterior
from discrepancy.joints.diagnose import PLAIN, Outcome
from discrepancy.joints.trials import Trials
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Parts:
    """Rows of each part, with the columns that a found set has in the model.

    Attributes:
        outcome: of the search.
        trials: the logs.
        active: indices of the columns, shape (K,).
        cells: of each part.
        series: rows of each part in time: the residual (n, C), and the columns (n, C, K).
        times: of these rows on the log's clock [s], shape (n,) each.
        unit: by which rows in time are larger in physical units, one a part.
        seen: columns that each channel sees.
    """

    outcome: Outcome
    trials: Trials
    active: NDArray[np.intp]
    cells: tuple[Cells, ...]
    series: tuple[tuple[Array, Array], ...]
    times: tuple[Array, ...]
    unit: tuple[float, ...]
    seen: Sequence[NDArray[np.intp]]

    @classmethod
    def of(cls, outcome: Outcome, trials: Trials) -> Parts:
        """Cut the rows of a search into parts."""
        whole, state = outcome.problem.cells, outcome.state
        active = np.flatnonzero(state.posterior.prior)
        cells, series, times, unit = [], [], [], []
        by_run = _in_time(whole, active)
        place = {int(k): i for i, k in enumerate(active)}
        seen = [
            np.array([place[int(k)] for k in c.columns if int(k) in place], dtype=np.intp)
            for c in whole.channels
        ]
        for k, at in trials.parts:
            residual, columns = by_run[k]
            own = trials.runs[k]
            share = len(residual) / len(own.time)  # fewer samples than the log has
            here = slice(round(at.start * share), max(round(at.stop * share), round(at.start * share) + 2))
            residual, columns = residual[here], columns[here]
            rate = own.rate_hz * share
            series.append((residual, columns))
            times.append(own.time[0] + (np.arange(len(residual)) + here.start + 0.5) / rate)
            unit.append(float(np.sqrt(share)))
            cells.append(
                _cells(residual, columns, seen, Bands([rate], [len(residual)], whole.bands.edges_hz))
            )
        return cls(outcome, trials, active, tuple(cells), tuple(series), tuple(times), tuple(unit), seen)

    @cached_property
    def prior(self) -> Array:
        """Variances of the columns, of causes so wide that they shrink nothing, shape (K,)."""
        state = self.outcome.state
        wide = state.posterior.prior.copy()
        for c in state.chosen:
            k = list(c.group.columns)
            wide[k] = np.maximum(wide[k], (PLAIN * np.array(c.group.slab)) ** 2)
        return self._of(wide)

    def _of(self, x: Array) -> Array:
        return x[self.active]

    def columns_of(self, chosen: Sequence[int]) -> list[int]:
        """Places of a problem's columns among these."""
        return np.searchsorted(self.active, chosen).tolist()

    def but(self, trial: int | None) -> Cells:
        """The rows of all parts but one, where there is another."""
        others = [c for k, c in enumerate(self.cells) if k != trial] or list(self.cells)
        return merged(others)

    def posterior(self, cells: Cells, prior: Array) -> Posterior:
        """Posterior of the columns, with the noise of the search."""
        return Posterior(cells, prior, self.outcome.state.posterior.variance)

    @cached_property
    def local(self) -> NDArray[np.bool_]:
        """Columns that are each trial's own, such as friction at rest, shape (K,)."""
        out = np.zeros(self.outcome.problem.cells.count, dtype=bool)
        for columns, _ in self.outcome.problem.resting:
            out[columns] = True
        for c in self.outcome.state.chosen:
            if c.group.event:
                out[[*c.group.columns, *c.forms]] = True
        return out[self.active]

    def foretold(self, prior: Array) -> list[tuple[Array, Array]]:
        """For each part, what the other parts leave of its torques: rows in time (n, C), and squares over the noise.

        What is each trial's own comes from itself.
        """
        out = []
        variance = self.outcome.state.posterior.variance
        for t, cells in enumerate(self.cells):
            x = self.posterior(self.but(t), np.where(self.local, 0.0, prior)).mean
            residual, columns = self.series[t]
            left = residual - columns @ x
            own = _cells(left, columns, self.seen, cells.bands)
            more = self.posterior(own, np.where(self.local, prior, 0.0)).mean
            squares, _ = own.left(more, np.zeros((len(x), len(x))))
            out.append(((left - columns @ more) * self.unit[t], squares / variance))
        return out


def merged(each: Sequence[Cells]) -> Cells:
    """Rows of several parts together; their Gram matrices only."""
    channels = []
    for own in zip(*(c.channels for c in each), strict=True):
        counts = np.sum([np.diff(c.starts) for c in own], axis=0)
        sums = [np.sum([getattr(c, name) for c in own], axis=0) for name in ("grams", "products", "squares")]
        none = np.zeros(0)
        channels.append(Channel(none, np.append(0, np.cumsum(counts)), own[0].columns, none[:, None], *sums))
    return Cells(each[0].bands, channels, each[0].count)


def _in_time(cells: Cells, active: NDArray[np.intp]) -> list[tuple[Array, Array]]:
    """Rows of each run as series in time: the residual (n, C) and columns (n, C, K); white noise keeps its variance."""
    place = {int(k): i for i, k in enumerate(active)}
    counts = [len(cells.bands.of_trial(t)) for t in range(len(cells.bands.lengths))]
    out = [
        (np.zeros((n, len(cells.channels))), np.zeros((n, len(cells.channels), len(active)))) for n in counts
    ]
    for c, channel in enumerate(cells.channels):
        keep = [i for i, k in enumerate(channel.columns) if int(k) in place]
        at = [place[int(channel.columns[i])] for i in keep]
        y, X = np.empty_like(channel.y), np.empty((len(channel.y), len(keep)))
        y[cells.order], X[cells.order] = channel.y, channel.X[:, keep]
        first = 0
        for (residual, columns), n in zip(out, counts, strict=True):
            residual[:, c] = np.asarray(idct(y[first : first + n], norm="ortho"))
            columns[:, c, at] = np.asarray(idct(X[first : first + n], axis=0, norm="ortho"))
            first += n
    return out


def _cells(residual: Array, columns: Array, seen: Sequence[NDArray[np.intp]], bands: Bands) -> Cells:
    """Gram matrices of one part's rows in time."""
    cells = Cells.of(bands, [residual])
    for c, channel in enumerate(cells.channels):
        X = np.asarray(dct(columns[:, c, seen[c]], axis=0, norm="ortho"))[: len(bands.of_trial(0))][
            cells.order
        ]
        channel.columns, channel.X = seen[c], X
        channel.grams = np.array([X[a:b].T @ X[a:b] for a, b in pairwise(channel.starts)])
        channel.products = np.array([X[a:b].T @ channel.y[a:b] for a, b in pairwise(channel.starts)])
    cells.count = columns.shape[2]
    return cells

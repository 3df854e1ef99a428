"""Parts of the logs of a robot's joints, with their rows in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idct

from discrepancy.evidence.cells import Bands, Cells
from discrepancy.evidence.parts import Parts
from discrepancy.joints.diagnose import Outcome
from discrepancy.joints.trials import Trials
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Series:
    """Rows of one part in time.

    Attributes:
        residual, columns: shapes (n, C) and (n, C, K).
        time: on the log's clock [s], shape (n,).
        rate_hz: of the rows.
        unit: by which they are larger in physical units.
    """

    residual: Array
    columns: Array
    time: Array
    rate_hz: float
    unit: float

    def left(self, x: Array) -> Array:
        """What values leave, in physical units, shape (n, C)."""
        return (self.residual - self.columns @ x) * self.unit


def parts_of(outcome: Outcome, trials: Trials) -> tuple[Parts, tuple[Series, ...]]:
    """The rows of a search, cut into parts."""
    whole, state, problem = outcome.problem.cells, outcome.state, outcome.problem
    active = np.flatnonzero(state.posterior.prior)
    by_run, each, out = _in_time(whole, active), [], []
    place = {int(k): i for i, k in enumerate(active)}
    seen = [
        np.array([place[int(k)] for k in c.columns if int(k) in place], dtype=np.intp) for c in whole.channels
    ]
    for k, at in trials.parts:
        residual, columns = by_run[k]
        own = trials.runs[k]
        share = len(residual) / len(own.time)  # fewer samples than the log has
        here = slice(round(at.start * share), max(round(at.stop * share), round(at.start * share) + 2))
        residual, columns = residual[here], columns[here]
        rate = own.rate_hz * share
        time = own.time[0] + (np.arange(len(residual)) + here.start + 0.5) / rate
        out.append(Series(residual, columns, time, rate, float(np.sqrt(share))))
        cells = _cells(residual, columns, seen, Bands([rate], [len(residual)], whole.bands.edges_hz))
        each.append((*cells.weighted(state.posterior.variance), cells.rows))
    events = [k for c in state.chosen if c.group.event for k in (*c.group.columns, *c.forms)]
    resting = [k for columns, _ in problem.resting for k in columns]
    return Parts.of(state, each, resting, resting, events), tuple(out)


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

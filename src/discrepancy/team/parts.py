"""Trials of a team as parts that foretell each other, and what values leave of their rows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from discrepancy.evidence.parts import Parts
from discrepancy.evidence.search import State
from discrepancy.team.problem import RowBands, TeamProblem
from estimator.arrays import Array


def parts_of(problem: TeamProblem, state: State) -> Parts:
    """The rows of a search by trial; base poses, grips and what acts in some trials only are each trial's own."""
    local = [k for own in problem.local for k in own]
    events = [
        k
        for c in state.chosen
        if c.group.identity in problem.candidates and problem.candidates[c.group.identity].of_trials
        for k in (*c.group.columns, *c.forms)
    ]
    return Parts.of(state, _each(problem, state), [*problem.shared, *local], local, events)


def _each(problem: TeamProblem, state: State) -> Iterator[tuple[Array, Array, float, Array]]:
    """Weighted normal equations of the active columns, and rows by channel and band, of each trial."""
    cells, active = problem.cells, np.flatnonzero(state.posterior.prior)
    place = np.full(cells.count, -1)
    place[active] = np.arange(len(active))
    lengths = cells.bands.lengths
    trial = np.repeat(np.arange(len(lengths)), 3 * np.array(lengths))[cells.order]
    for t in range(len(lengths)):
        own = trial == t
        G, b, yy, rows = np.zeros((len(active),) * 2), np.zeros(len(active)), 0.0, []
        for channel, variance in zip(cells.channels, state.posterior.variance, strict=True):
            band = np.repeat(np.arange(len(variance)), np.diff(channel.starts))[own]
            keep = np.flatnonzero(place[channel.columns] >= 0)
            X, y, at = channel.X[np.ix_(own, keep)], channel.y[own], place[channel.columns[keep]]
            weighted = X / variance[band][:, None]
            G[np.ix_(at, at)] += weighted.T @ X
            b[at] += weighted.T @ y
            yy += float(np.sum(y**2 / variance[band]))
            rows.append(np.bincount(band, minlength=len(variance)))
        yield G, b, yy, np.array(rows, dtype=float)


def left_of(problem: TeamProblem, x: Array) -> list[Array]:
    """Whitened rows that values of the columns leave, shape (n, C) a trial."""
    bands, parts = problem.cells.bands, []
    assert isinstance(bands, RowBands)
    for channel in problem.cells.channels:
        rows = np.empty_like(channel.y)
        known = channel.columns < len(x)
        rows[problem.cells.order] = channel.y - channel.X[:, known] @ x[channel.columns[known]]
        parts.append(bands.rows(rows))
    return [np.concatenate(each, axis=1) for each in zip(*parts, strict=True)]

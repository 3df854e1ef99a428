"""Where something is wrong: at every place the error that explains most, as a function of time, and what it is worth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from discrepancy import rules
from discrepancy.laws.bench import Bench
from discrepancy.laws.place import Place
from discrepancy.laws.told import Beside
from discrepancy.least_squares.fit import Fit
from estimator.arrays import Array

SIZES = 4.0 ** np.arange(-3.0, 2.0)
"""Of an error, over what would just be seen."""


@dataclass(frozen=True, eq=False)
class Located:
    """An error signal at a place.

    Attributes:
        place: where.
        nats: by how much it is likelier than nothing, all values of the signal integrated out.
        errors: the signal of every trial at its knots, shape (knots, components) [unit of the place].
        se: its standard errors, the same shape.
        knots_s: times of the knots in every trial [s].
    """

    place: Place
    nats: float
    errors: tuple[Array, ...]
    se: tuple[Array, ...]
    knots_s: tuple[Array, ...]


def located(
    fit: Fit, bench: Bench, places: Sequence[Place], progress: Callable[[Place], object] = lambda _: None
) -> list[Located]:
    """Every place with its error signal, the likeliest first."""
    beside, out = Beside(fit), []
    for place in places:
        progress(place)
        out.append(_located(beside, fit, bench, place))
    return sorted(out, key=lambda one: -one.nats)


def _located(beside: Beside, fit: Fit, bench: Bench, place: Place) -> Located:
    step = rules.LAW_KNOTS_S if len(place.axes) == 1 else rules.LAW_VECTOR_KNOTS_S
    knots, information, edges, scores = [], [], [], []
    for trial in fit.problem.trials:
        at, hats = _hats(bench.length(trial), bench.rate_hz(trial), step)
        directions = bench.directions(trial, place)
        moved = bench.at_rows(trial, hats, rates=directions.shape[2] == 3)
        columns = np.einsum("narc,nrk->ncka", directions, moved, optimize=True)
        columns = columns.reshape(*columns.shape[:2], -1)
        rows = beside.rows(trial, bench.white(trial, columns))
        edge, score = beside.edges(trial, rows)
        knots.append(at)
        information.append(rows.T @ rows)
        edges.append(edge)
        scores.append(score)
    count = [len(score) for score in scores]
    total = np.zeros((sum(count), sum(count)))
    spans = np.concatenate([[0], np.cumsum(count)])
    for k, own in enumerate(information):
        total[spans[k] : spans[k + 1], spans[k] : spans[k + 1]] = own
    edge = np.concatenate(edges, axis=1)
    total -= edge.T @ (fit.covariance @ edge)
    score = np.concatenate(scores)
    # In units in which each value is known to a standard error of one by itself.
    scale = 1.0 / np.sqrt(np.maximum(np.diag(total), 1e-9 * max(float(np.diag(total).max()), 1e-300)))
    typical = float(np.median(scale))
    best, nats = SIZES[0], -np.inf
    for size in SIZES:
        value = _evidence(total, score, 10.0 * size * typical)[0]
        if value > nats:
            best, nats = size, value
    nats, mean, covariance = _evidence(total, score, 10.0 * best * typical, full=True)
    axes = len(place.axes)
    parts = [mean[a:b].reshape(-1, axes) for a, b in zip(spans[:-1], spans[1:], strict=True)]
    se = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    errors = [se[a:b].reshape(-1, axes) for a, b in zip(spans[:-1], spans[1:], strict=True)]
    return Located(place, nats, tuple(parts), tuple(errors), tuple(knots))


def _evidence(
    information: Array, score: Array, size: float, *, full: bool = False
) -> tuple[float, Array, Array]:
    """Log evidence of normal values of one size over nothing, and their mean and covariance if ``full``."""
    k = len(score)
    inner = np.eye(k) + size**2 * information
    factor = cho_factor(0.5 * (inner + inner.T), lower=True)
    mean = size**2 * cho_solve(factor, score)
    log_det = 2.0 * float(np.sum(np.log(np.diag(factor[0]))))
    nats = 0.5 * (float(score @ mean) - log_det)
    covariance = size**2 * cho_solve(factor, np.eye(k)) if full else np.zeros((0, 0))
    return nats, mean, covariance


def _hats(samples: int, rate_hz: float, step_s: float) -> tuple[Array, Array]:
    """Knots [s] over a trial, and smooth bumps around them that add up to one, shape (Q, knots)."""
    time = np.arange(samples) / rate_hz
    count = max(2, round(time[-1] / step_s) + 1)
    at = np.linspace(0.0, time[-1], count)
    away = np.abs(time[:, None] - at) / (at[1] - at[0])
    # Cubic B-spline: twice differentiable, as angles have to be.
    inner = 2.0 / 3.0 - away**2 + 0.5 * away**3
    outer = np.maximum(2.0 - away, 0.0) ** 3 / 6.0
    return at, np.where(away < 1.0, inner, outer)

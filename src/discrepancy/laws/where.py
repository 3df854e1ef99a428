"""Where something is wrong: at every place the error over time that explains most, and what it is worth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve

from discrepancy import rules
from discrepancy.laws.bench import Bench, along
from discrepancy.laws.place import Place
from discrepancy.laws.told import Beside
from discrepancy.least_squares.fit import Fit
from estimator.arrays import Array


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
    beside, bumps, out = Beside(fit), _Bumps(bench), []
    for place in places:
        progress(place)
        out.append(_located(beside, fit, bumps, place))
    return sorted(out, key=lambda one: -one.nats)


class _Bumps:
    """Smooth bumps around knots at the rows, which are the same at every place."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self._made: dict[tuple[int, float, bool], tuple[Array, Array]] = {}

    def of(self, trial: int, step_s: float, *, rates: bool) -> tuple[Array, Array]:
        """Times of the knots [s], and the bumps (and their rates and accelerations) at the rows, (n, 1 or 3, knots)."""
        key = trial, step_s, rates
        if key not in self._made:
            at, hats = _hats(self.bench.length(trial), self.bench.rate_hz(trial), step_s)
            self._made[key] = at, self.bench.at_rows(trial, hats, rates=rates)
        return self._made[key]


def _located(beside: Beside, fit: Fit, bumps: _Bumps, place: Place) -> Located:
    step, bench = rules.LAW_KNOTS_S if len(place.axes) == 1 else rules.LAW_VECTOR_KNOTS_S, bumps.bench
    knots, information, edges, scores = [], [], [], []
    for trial in fit.problem.trials:
        directions = bench.directions(trial, place)
        at, at_rows = bumps.of(trial, step, rates=directions.shape[2] == 3)
        columns = along(directions, at_rows)
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
    # In units of what one value alone is known to; as it comes, and smooth over longer times.
    scale = 1.0 / np.sqrt(np.maximum(np.diag(total), 1e-9 * max(float(np.diag(total).max()), 1e-300)))
    typical = 10.0 * float(np.median(scale))
    axes, best, nats = len(place.axes), (rules.LAW_SIZES[0], np.eye(len(score), dtype=np.float64)), -np.inf
    for coarser in rules.LAW_SMOOTH:
        onto = np.array(block_diag(*(_onto(len(at), coarser, axes) for at in knots)), dtype=np.float64)
        inner, told = onto.T @ total @ onto, onto.T @ score
        for size in rules.LAW_SIZES:
            value = _evidence(inner, told, size * typical)[0]
            if value > nats:
                best, nats = (size, onto), value
    size, onto = best
    nats, mean, covariance = _evidence(onto.T @ total @ onto, onto.T @ score, size * typical, full=True)
    mean, covariance = onto @ mean, onto @ covariance @ onto.T
    parts = [mean[a:b].reshape(-1, axes) for a, b in pairwise(spans)]
    se = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    errors = [se[a:b].reshape(-1, axes) for a, b in pairwise(spans)]
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


def _onto(knots: int, coarser: int, axes: int) -> Array:
    """Values at knots from those at ``coarser`` times fewer, straight lines between, of every component."""
    if coarser == 1:
        return np.eye(knots * axes)
    few = max(2, round((knots - 1) / coarser) + 1)
    at = np.linspace(0.0, few - 1.0, knots)
    lines = np.maximum(1.0 - np.abs(at[:, None] - np.arange(few)), 0.0)
    return np.array(np.kron(lines, np.eye(axes)), dtype=np.float64)


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

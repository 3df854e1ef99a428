"""Normal equations of parts of the logs, for the prediction of each part from the others."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from discrepancy.evidence.search import State
from discrepancy.evidence.settings import SETTINGS
from estimator.arrays import Array

Values = tuple[Array, Array]
"""Values of the active columns (K,) and their covariance (K, K)."""


@dataclass(frozen=True, eq=False)
class Parts:
    """Normal equations of each of T parts, weighted with the noise learnt in the search.

    Attributes:
        state: the search result.
        active: indices of the columns, shape (K,).
        grams, products, squares: X' W X, X' W y and y' W y of each part, shapes (T, K, K), (T, K) and (T,).
        rows: number of rows of each part by channel and band, shape (T, C, bands).
        local: columns whose values are specific to a part, such as friction at rest or events, shape (K,).
        events: columns of events, shape (K,).
        unknown: nuisance parameters, which are always in the model, shape (K,).
    """

    state: State
    active: NDArray[np.intp]
    grams: Array
    products: Array
    squares: Array
    rows: Array
    local: NDArray[np.bool_]
    events: NDArray[np.bool_]
    unknown: NDArray[np.bool_]

    @classmethod
    def of(
        cls, state: State, each: Iterable[tuple[Array, Array, float, Array]], unknown: Collection[int],
        own: Collection[int], events: Collection[int],
    ) -> Parts:  # fmt: skip
        """Build from the normal equations of each part.

        Args:
            state: the search result.
            each: X' W X, X' W y, y' W y and number of rows by channel and band of each part, for the active columns.
            unknown: columns of the problem that are always in the model.
            own: columns whose values are specific to a part.
            events: columns of events.
        """
        active = np.flatnonzero(state.posterior.prior)
        G, b, yy, rows = zip(*each, strict=True)
        masks = [np.isin(active, list(k)) for k in ([*own, *events], events, unknown)]
        return cls(state, active, np.array(G), np.array(b), np.array(yy), np.array(rows), *masks)

    @property
    def count(self) -> int:
        """Number of parts."""
        return len(self.grams)

    @cached_property
    def prior(self) -> Array:
        """Prior variances of the columns, shape (K,); those of causes are too wide to shrink their values."""
        wide = self.state.posterior.prior.copy()
        for c in self.state.chosen:
            k = list(c.group.columns)
            wide[k] = np.maximum(wide[k], (SETTINGS.plain * np.array(c.group.slab)) ** 2)
        return wide[self.active]

    def columns_of(self, chosen: Sequence[int]) -> list[int]:
        """Positions of the problem's columns among the active columns."""
        return np.searchsorted(self.active, chosen).tolist()

    def others(self, part: int | None) -> list[int]:
        """Indices of all parts but one; of all parts if there is no other."""
        return [k for k in range(self.count) if k != part] or list(range(self.count))

    def step(self, x: Array, prior: Array, parts: Sequence[int]) -> Array:
        """Fit the residual at values x in some parts, and return the updated values, shape (K,)."""
        G, b = self.grams[parts].sum(axis=0), self.products[parts].sum(axis=0)
        return x + _mean(G, b - G @ x, prior)

    def mean(self, prior: Array, but: int | None = None) -> Array:
        """Values of the columns from all parts but one, shape (K,)."""
        return self.step(np.zeros(len(prior)), prior, self.others(but))

    def values(self, prior: Array, but: int | None = None) -> Values:
        """The same values with their covariance."""
        on = np.flatnonzero(prior > 0.0)
        s = np.sqrt(prior[on])
        factor = _factor(self.grams[self.others(but)].sum(axis=0)[np.ix_(on, on)], s)
        covariance = np.zeros((len(prior),) * 2)
        covariance[np.ix_(on, on)] = s[:, None] * cho_solve(factor, np.diag(s))
        return self.mean(prior, but), covariance

    def left(self, x: Array, part: int | None = None) -> float:
        """Squared residuals over the noise variance at given values, in one part; None: in all parts."""
        at = list(range(self.count)) if part is None else [part]
        G, b, yy = (v[at].sum(axis=0) for v in (self.grams, self.products, self.squares))
        return max(float(yy - 2.0 * b @ x + x @ G @ x), 0.0)

    def predicted(self, prior: Array, part: int) -> Array:
        """Values for one part from the other parts; its local columns are fitted to itself, shape (K,)."""
        x = np.where(self.local, 0.0, self.mean(prior, part))
        return self.step(x, np.where(self.local, prior, 0.0), [part])


def _mean(G: Array, b: Array, prior: Array) -> Array:
    """Solve normal equations, shape (K,); values without prior variance are zero."""
    on, out = np.flatnonzero(prior > 0.0), np.zeros(len(b))
    s = np.sqrt(prior[on])
    out[on] = s * cho_solve(_factor(G[np.ix_(on, on)], s), s * b[on])
    return out


def _factor(G: Array, s: Array) -> tuple[Array, bool]:
    return cho_factor(np.eye(len(s)) + s[:, None] * G * s, lower=True)

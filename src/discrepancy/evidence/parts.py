"""Parts of the logs that predict each other: what each says of a found set's columns, with the noise of the search."""

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
"""Values of the active columns, and their covariance, shapes (K,) and (K, K)."""


@dataclass(frozen=True, eq=False)
class Parts:
    """Normal equations of each part in its noise.

    Attributes:
        state: what the search found.
        active: indices of the columns, shape (K,).
        grams, products, squares: X' W X, X' W y and y' W y of each part, shapes (T, K, K), (T, K) and (T,).
        rows: of each part, by channel and band, shape (T, C, bands).
        local: columns that are each part's own, such as friction at rest, shape (K,).
        events: those of them that belong to causes that act for a while, shape (K,).
        unknown: columns that are in the model whatever is found, shape (K,).
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
        """From what each part says of the active columns of a state.

        Args:
            state: what the search found.
            each: X' W X, X' W y, y' W y and rows by channel and band of each part.
            unknown: columns of the problem that are in the model whatever is found.
            own: those of them that are each part's own.
            events: columns of causes that act for a while.
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
        """Variances of the columns, of causes so wide that they shrink nothing, shape (K,)."""
        wide = self.state.posterior.prior.copy()
        for c in self.state.chosen:
            k = list(c.group.columns)
            wide[k] = np.maximum(wide[k], (SETTINGS.plain * np.array(c.group.slab)) ** 2)
        return wide[self.active]

    def columns_of(self, chosen: Sequence[int]) -> list[int]:
        """Places of a problem's columns among these."""
        return np.searchsorted(self.active, chosen).tolist()

    def others(self, part: int | None) -> list[int]:
        """All parts but one, where there is another."""
        return [k for k in range(self.count) if k != part] or list(range(self.count))

    def step(self, x: Array, prior: Array, parts: Sequence[int]) -> Array:
        """Values x and what they leave in some parts, fitted with variances of the columns, shape (K,)."""
        G, b = self.grams[parts].sum(axis=0), self.products[parts].sum(axis=0)
        return x + _mean(G, b - G @ x, prior)

    def mean(self, prior: Array, but: int | None = None) -> Array:
        """Values of the columns by all parts but one, shape (K,)."""
        return self.step(np.zeros(len(prior)), prior, self.others(but))

    def values(self, prior: Array, but: int | None = None) -> Values:
        """The same with their covariance."""
        on = np.flatnonzero(prior > 0.0)
        s = np.sqrt(prior[on])
        factor = _factor(self.grams[self.others(but)].sum(axis=0)[np.ix_(on, on)], s)
        covariance = np.zeros((len(prior),) * 2)
        covariance[np.ix_(on, on)] = s[:, None] * cho_solve(factor, np.diag(s))
        return self.mean(prior, but), covariance

    def left(self, x: Array, part: int | None = None) -> float:
        """Squares over the noise's variance that values leave in one part; None: in all."""
        at = list(range(self.count)) if part is None else [part]
        G, b, yy = (v[at].sum(axis=0) for v in (self.grams, self.products, self.squares))
        return max(float(yy - 2.0 * b @ x + x @ G @ x), 0.0)

    def predicted(self, prior: Array, part: int) -> Array:
        """Values for one part as the others have them; what is its own comes from itself, shape (K,)."""
        x = np.where(self.local, 0.0, self.mean(prior, part))
        return self.step(x, np.where(self.local, prior, 0.0), [part])


def _mean(G: Array, b: Array, prior: Array) -> Array:
    """Values for normal equations, shape (K,); those without prior variance are zero."""
    on, out = np.flatnonzero(prior > 0.0), np.zeros(len(b))
    s = np.sqrt(prior[on])
    out[on] = s * cho_solve(_factor(G[np.ix_(on, on)], s), s * b[on])
    return out


def _factor(G: Array, s: Array) -> tuple[Array, bool]:
    return cho_factor(np.eye(len(s)) + s[:, None] * G * s, lower=True)

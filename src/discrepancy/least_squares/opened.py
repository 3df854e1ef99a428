"""What a cause leaves open, such as friction at rest: unknowns of every trial of a known size, integrated out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from discrepancy import rules
from discrepancy.least_squares.patches import Patches
from discrepancy.least_squares.span import Span
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Opened:
    """Normal unknowns u with columns U in one trial; C channels, n rows.

    Rows y = U u + noise of unit power have the covariance I + size^2 U U^T, and (I + size^2 U U^T)^(-1/2) y is white
    again. With U = Q diag(s) V^T that is y - Q diag(f) Q^T y, f = 1 - 1 / sqrt(1 + size^2 s^2). Q is dense, as the
    trial's own unknowns are taken out of it; it is kept as sums of what it is made of.

    Attributes:
        columns: of the unknowns, n, C, k.
        span: the trial's own unknowns, those of the causes before, and these, m columns.
        basis: Q, of what others leave of these columns, as how much of the span's it is the sum of, shape (m, r).
        stretch: s, shape (r,).
        size: standard deviation of the unknowns.
    """

    columns: Patches
    span: Span
    basis: Array
    stretch: Array
    size: float

    @classmethod
    def of(cls, columns: Patches, size: float, own: Array, before: Sequence[Opened] = ()) -> Opened:
        """Unknowns of a size.

        Args:
            columns: n, C, k; possibly k = 0. Best as few as there can be (``Patches.fewer``).
            size: standard deviation of their values.
            own: orthonormal columns that the rows are without, shape (n, C, l).
            before: unknowns that the rows are transformed for already, in turn.
        """
        made = _MADE.get(columns)  # a search looks at the same columns again and again
        if made is None or not made.is_beside(own, before):
            made = _MADE[columns] = _Made(cls._unit(columns, own, before), own, tuple(before))
        return made.opened.of_size(size)

    @classmethod
    def _unit(cls, columns: Patches, own: Array, before: Sequence[Opened]) -> Opened:
        """The same of unit size."""
        others = before[-1].span if before else Span(own)
        span = others.beside(columns)
        gram = span.gram
        new = slice(len(gram) - columns.width, len(gram))
        squares, left = gram[new, new], np.zeros((len(gram), columns.width))
        shown = rules.PATCH_SHOWS**2 * np.max(np.diag(squares), initial=0.0)
        left[new] = np.eye(columns.width)
        left[span.dense] = -gram[span.dense, new]
        squares = squares - left[span.dense].T @ left[span.dense]
        for one in before:
            inside = one.basis.T @ (gram[: len(one.basis)] @ left)
            squares -= inside.T @ (inside * (1.0 - (1.0 - one.shrink) ** 2)[:, None])
            left[: len(one.basis)] -= one.basis @ (one.shrink[:, None] * inside)
        # Of their products, as of all rows it takes many times as long; so small an s is still known to 1e-8 of the
        # largest.
        squares, V = np.linalg.eigh(squares)
        keep = squares > max(rules.OPEN_SHOWS**2 * squares.max(initial=0.0), shown)
        s = np.sqrt(squares[keep])
        # With a span of its own: products with these columns are kept only where others come beside them.
        return cls(columns, others.beside(columns), left @ (V[:, keep] / s), s, 1.0)

    @cached_property
    def shrink(self) -> Array:
        """f, shape (r,)."""
        return 1.0 - (1.0 + (self.size * self.stretch) ** 2) ** -0.5

    @cached_property
    def inside(self) -> Array:
        """Products of the basis with the span's columns, shape (r, m)."""
        return self.basis.T @ self.span.gram

    @property
    def price(self) -> float:
        """Log sqrt det of the covariance [nats]."""
        return 0.5 * float(np.sum(np.log1p((self.size * self.stretch) ** 2)))

    def of_size(self, size: float) -> Opened:
        """The same unknowns of another size."""
        return replace(self, size=size)

    def __call__(self, x: Array) -> Array:
        """Rows that are white with these unknowns integrated out, shape (n, C, l) -> the same."""
        return through((self,), x)


@dataclass(frozen=True, eq=False)
class _Made:
    """Unknowns, and beside what they were made."""

    opened: Opened
    own: Array
    before: tuple[Opened, ...]

    def is_beside(self, own: Array, before: Sequence[Opened]) -> bool:
        """Whether they were made beside the same, of the same sizes."""
        same = [
            one.basis is two.basis and one.size == two.size
            for one, two in zip(self.before, before, strict=False)
        ]
        return self.own is own and len(self.before) == len(before) and all(same)


_MADE: WeakKeyDictionary[Patches, _Made] = WeakKeyDictionary()
"""What was made last of columns that are in use."""


def shares_of(opened: Sequence[Opened], products: Array) -> Array:
    """How much of the span's columns lies along unknowns of others, and is taken out, for one cause after the other.

    Args:
        opened: of every cause, in turn.
        products: of the last one's span with the others, shape (m, l).

    Returns:
        Shape (m, l).
    """
    out = np.zeros_like(products)
    for one in opened:
        m = len(one.basis)
        along = one.basis.T @ products[:m] - one.inside @ out[:m]
        out[:m] += one.basis @ (one.shrink[:, None] * along)
    return out


def through(opened: Sequence[Opened], x: Array) -> Array:
    """Rows with the unknowns of one cause after the other integrated out."""
    if not x.size or not any(len(one.stretch) for one in opened):
        return x
    span = opened[-1].span
    return np.asarray(x - span.times(shares_of(opened, span.products(x))))


def best_of(opened: Sequence[Opened], x: Array) -> tuple[Array, Array]:
    """Columns (n, C, l) without the likeliest values of unknowns, and these values in standard deviations, (k, l)."""
    each = [(one.columns, one.size) for one in opened]
    products = np.block([[a * b * u.cross(v) for v, b in each] for u, a in each])
    both = np.concatenate([a * u.products(x) for u, a in each])
    best = np.asarray(np.linalg.solve(products + np.eye(len(products)), both), dtype=np.float64)
    left, at = np.array(x), 0
    for u, a in each:
        left -= a * u.times(best[at : at + u.width])
        at += u.width
    return left, best

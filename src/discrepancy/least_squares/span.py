"""What one trial's unknowns are made of: its own columns, and patches of one cause after the other.

Unknowns that are without what others explain are dense. As sums of these columns they are a small matrix, and what is
asked of several causes' unknowns is asked of each patch once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from discrepancy.least_squares.gram import gram_of
from discrepancy.least_squares.patches import Patches
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Span:
    """Columns of one trial, m of them, by which others are told; n rows, C channels.

    Attributes:
        own: orthonormal dense columns, shape (n, C, l).
        parts: further ones, those of one cause after the other.
        before: the same without the last of these; None where there are none.
    """

    own: Array
    parts: tuple[Patches, ...] = ()
    before: Span | None = None

    def beside(self, more: Patches) -> Span:
        """These columns, and then others."""
        return Span(self.own, (*self.parts, more), self)

    @property
    def gram(self) -> Array:
        """Products of all with each other, the dense ones first, shape (m, m); put together anew, as it is large."""
        if self.before is None:
            return np.eye(self.own.shape[2])
        width, k = self._edge.shape
        out, at = np.empty((width, width)), width - k
        out[:at, :at] = self.before.gram
        out[:, at:], out[at:] = self._edge, self._edge.T
        return out

    @cached_property
    def _edge(self) -> Array:
        """Products of all with the last part, shape (m, k)."""
        *others, last = self.parts
        cross = (last.products(self.own).T, *(patches.cross(last) for patches in others), last.cross(last))
        return np.concatenate(cross)

    @property
    def dense(self) -> slice:
        """Which columns are the dense ones."""
        return slice(0, self.own.shape[2])

    @property
    def first(self) -> int:
        """Channel below which there is nothing but the dense ones."""
        return min((patches.first for patches in self.parts), default=self.own.shape[1])

    def times(self, z: Array, first: int = 0) -> Array:
        """The columns, each times its numbers in z, of channels from one on, shape (m, k) -> (n, C - first, k)."""
        own, at = self.own[:, first:], self.own.shape[2]
        rows, channels, _ = own.shape
        out = (own.reshape(rows * channels, at) @ z[:at]).reshape(rows, channels, z.shape[1])
        for patches in self.parts:
            patches.add_times(z[at : at + patches.width], out, first)
            at += patches.width
        return out

    def products(self, x: Array) -> Array:
        """Products with other columns over rows and channels, shape (n, C, k) -> (m, k)."""
        return np.concatenate([gram_of(self.own, x), *(patches.products(x) for patches in self.parts)])

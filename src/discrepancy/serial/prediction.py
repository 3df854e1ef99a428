"""Torques foretold from the motion: with given causes, and with what is normal as the other trials have it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from discrepancy.least_squares.whitening import Whitening
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Within:
    """What is normal of a model, such as masses that are off by a tenth, in units of its tolerances; one per block.

    Attributes:
        physical: columns, rows (n, C, k).
        whitening: of the rows.
        local: whitened columns of the block's own unknowns, rows (n, C, l).
    """

    physical: Array
    whitening: Whitening
    local: Array

    @cached_property
    def seen(self) -> Array:
        """Whitened columns without what the block's own unknowns can do, shape (n C, k)."""
        count = self.physical.shape[2]
        return _without(self.whitening(self.physical).reshape(-1, count), self.local)

    @cached_property
    def normal(self) -> Array:
        """Information of the block about the columns' values, shape (k, k)."""
        return np.asarray(self.seen.T @ self.seen)


def unforetold(trial: int, left: Sequence[Array], within: Sequence[Within]) -> Array:
    """Measured minus foretold torques of one block, low-passed as its rows are, shape (n, C).

    What is normal is fitted to the other blocks, within its tolerances; where there is one block only, to that.

    Args:
        trial: the block, from 0.
        left: measured torques less those of the model with its causes, rows (n, C) of every block.
        within: of every block.
    """
    count = within[trial].physical.shape[2]
    normal, score = np.eye(count), np.zeros(count)
    for t in [k for k in range(len(left)) if k != trial] or [trial]:
        block = within[t]
        normal += block.normal
        score += block.seen.T @ block.whitening(left[t]).ravel()
    return left[trial] - within[trial].physical @ np.linalg.solve(normal, score)


def _without(columns: Array, local: Array) -> Array:
    """Columns less what a block's own unknowns can do."""
    if not local.shape[2]:
        return columns
    basis = np.linalg.qr(local.reshape(-1, local.shape[2]))[0]
    return np.asarray(columns - basis @ (basis.T @ columns))

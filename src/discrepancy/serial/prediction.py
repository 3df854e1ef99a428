"""Torques foretold from the motion: with given causes, and with what is normal as the other trials have it."""

from collections.abc import Sequence
from dataclasses import dataclass

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
        columns = _without(block.whitening(block.physical).reshape(-1, count), block.local)
        normal += columns.T @ columns
        score += columns.T @ block.whitening(left[t]).ravel()
    return left[trial] - within[trial].physical @ np.linalg.solve(normal, score)


def _without(columns: Array, local: Array) -> Array:
    """Columns less what a block's own unknowns can do."""
    if not local.shape[2]:
        return columns
    basis = np.linalg.qr(local.reshape(-1, local.shape[2]))[0]
    return np.asarray(columns - basis @ (basis.T @ columns))

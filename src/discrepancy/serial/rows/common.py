"""What is wrong with a model on both of two days: every combination of causes that shows, free in all logs."""

from collections.abc import Sequence

import numpy as np

from discrepancy.least_squares.whitening import Whitening
from discrepancy.rules import serial as rules
from estimator.arrays import Array


def combinations(columns: Sequence[Sequence[Array]], whitening: Sequence[Whitening]) -> tuple[Array, ...]:
    """Columns that span all that causes can do in all blocks together, rows (n, C, s) per block, physical.

    Args:
        columns: of every cause and block, rows (n, C, k), physical.
        whitening: of every block.
    """
    each = [np.concatenate(own, axis=2) for own in zip(*columns, strict=True)]
    A = np.concatenate([w(x).reshape(-1, x.shape[2]) for w, x in zip(whitening, each, strict=True)])
    size = np.linalg.norm(A, axis=0)
    size = np.where(size > 0, size, 1.0)
    # A column of the span has length 1: of the right singular vectors, those that are seen.
    _, s, Vt = np.linalg.svd(A / size, full_matrices=False)
    told = s > rules.REDUNDANT**0.5 * s[0]
    mix = (Vt[told] / s[told, None]).T / size[:, None]
    return tuple(x @ mix for x in each)

"""Standard errors of what was found that hold when what is left is correlated in time."""

from dataclasses import replace

import numpy as np

from discrepancy.engine.explanation import Explanation
from discrepancy.least_squares.block_errors import block_covariance, part_of


def with_block_errors(explanation: Explanation, rows_per_block: int) -> Explanation:
    """The explanation with the causes' covariances from ``block_covariance``.

    A transient fits into a block or two, which says nothing of how it would scatter; it keeps the fit's own covariance,
    scaled by what is left.
    """
    inflation = max(1.0, explanation.after / explanation.samples)
    covariance = block_covariance(explanation.fit, rows_per_block)
    found = []
    for item in explanation.found:
        if item.candidate.transient:
            part = inflation * explanation.fit.part(item.index)[1]
        else:
            part = part_of(explanation.fit, covariance, item.index)
        found.append(replace(item, covariance=part * np.outer(item.candidate.units, item.candidate.units)))
    return replace(explanation, found=tuple(found))

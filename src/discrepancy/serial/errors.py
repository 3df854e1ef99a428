"""Standard errors of what was found: what is left is correlated in time, and what is normal is not known exactly."""

from dataclasses import replace

import numpy as np

from discrepancy.engine.explanation import Explanation
from discrepancy.least_squares.block_errors import block_covariance, part_of


def with_errors(explanation: Explanation, rows_per_block: int) -> Explanation:
    """The explanation with the causes' covariances from the scatter between blocks of rows, and from the tolerances.

    The first is ``block_covariance``'s, H^-1 B H^-1 with the scores' scatter B in place of H. H also holds the
    tolerances' priors, and these scatter as they say from robot to robot: H^-1 P H^-1 is added, with P their inverse
    variances (one over the spread squared for what is normal, 0 for a named cause).

    Args:
        explanation: what was found.
        rows_per_block: length of a block.
    """
    fit = explanation.fit
    prior = np.concatenate([np.zeros(fit.problem.shared), fit.problem.tolerant / fit.problem.spread**2])
    for index in fit.free:
        prior[fit.problem.spans[index]] = 0.0
    from_tolerances = fit.covariance @ (prior[fit.used][:, None] * fit.covariance)
    whole = block_covariance(fit, rows_per_block) + from_tolerances
    inflation = max(1.0, explanation.after / explanation.samples)
    found = []
    for item in explanation.found:
        # A transient fits into a block or two, which says nothing of how it would scatter.
        alone = inflation * fit.part(item.index)[1]
        part = alone if item.candidate.transient else part_of(fit, whole, item.index)
        k = len(part)
        part = part * np.outer(item.candidate.units, item.candidate.units)
        if (
            len(item.covariance) > k
        ):  # numbers of its shape are fitted, too: their errors grow as those of the values do
            plain = np.diag(fit.part(item.index)[1]) * item.candidate.units**2
            # What nothing tells has no error that could grow.
            growth = np.sqrt(np.divide(np.diag(part), plain, out=np.ones(k), where=plain > 0.0)).clip(1.0)
            each = np.concatenate([growth, np.full(len(item.covariance) - k, growth.max())])
            part = item.covariance * np.outer(each, each)
        found.append(replace(item, covariance=part))
    return replace(explanation, found=tuple(found))

"""Sizes of causes whose expected gain of chi-square is given, by the old engine's fit."""

import numpy as np

from discrepancy import rules
from discrepancy.least_squares.fit import Fit
from estimator.arrays import Array


def sizes_of(fit: Fit, gain: float) -> list[Array]:
    """Size of every candidate's parameters, each alone, whose expected gain of chi-square is ``gain``.

    The gain is that of leaving the tolerance. In the parameters' own units, one array (k,) per candidate; infinite
    where the data say nothing.
    """
    out = []
    for index, candidate in enumerate(fit.problem.candidates):
        lam, vectors = np.linalg.eigh(fit.told(index)[0])
        keep = lam > rules.LEAST_INFORMATION
        lam, vectors = lam[keep], vectors[:, keep]
        within = all(parameter.tolerance > 0 for parameter in candidate.parameters)  # pushes, too
        weight = lam / (1.0 + lam) if within else lam
        power = vectors**2 @ weight
        size = np.sqrt(gain / np.maximum(power, 1e-300))
        out.append(np.where(power > 0, candidate.units * size, np.inf))
    return out

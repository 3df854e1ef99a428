"""What the data say about one candidate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from discrepancy import rules
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the data say about one candidate.

    Attributes:
        index: which candidate.
        gain: how much chi-square falls when its parameters leave their tolerance.
        fall: how much it falls when they are free in place of nought (the same where there is no tolerance).
        parameters: how many of them (or of their combinations) the data can see.
        log10_p: of such a gain on clean data.
        score: gain less the penalty for parameters.
        values: parameters in units, MAP with their own prior removed, shape (k,).
        covariance: of the values, shape (k, k).
    """

    index: int
    gain: float
    fall: float
    parameters: int
    log10_p: float
    score: float
    values: Array
    covariance: Array

    @classmethod
    def of(
        cls, index: int, told: tuple[Array, Array], *, tolerant: bool, inflation: float, samples: int
    ) -> Evidence | None:
        """Evidence from what the data tell of a candidate's values; None where that is nothing.

        Args:
            index: which candidate.
            told: information about the values given all else, shape (k, k), and its score vector, shape (k,).
            tolerant: whether the candidate has a tolerance.
            inflation: of the noise's variance, at least 1; divides the gain before it is judged.
            samples: number of residuals, for the penalty.
        """
        lam, V, z = visible(*told)
        if not len(lam):
            return None
        fall = float(np.sum(z**2 / lam))
        gain = (float(np.sum(z**2 / (lam * (1.0 + lam)))) if tolerant else fall) / inflation
        return cls(
            index,
            gain,
            fall,
            len(lam),
            log10_survival(gain, len(lam)),
            gain - rules.COMPLEXITY * len(lam) * np.log(samples),
            V @ (z / lam),
            (V / lam) @ V.T,
        )


def log10_survival(value: float, freedom: float) -> float:
    """log10 of the probability that a chi-square exceeds a value.

    ``scipy.stats`` says the same, with checks that take longer than all else that is done for a candidate.
    """
    with np.errstate(divide="ignore"):
        return float(np.log(chdtrc(freedom, max(value, 0.0))) / np.log(10.0))


def visible(information: Array, score: Array) -> tuple[Array, Array, Array]:
    """Directions of which the data say enough: their information (m,), themselves (k, m), the score along them (m,)."""
    eigenvalues, vectors = np.linalg.eigh(information)
    keep = eigenvalues > rules.LEAST_INFORMATION
    return eigenvalues[keep], vectors[:, keep], vectors[:, keep].T @ score

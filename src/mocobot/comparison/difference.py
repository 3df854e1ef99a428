"""Groups of numbers that two results both give, and how far they are apart for their errors."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincc

from estimator.arrays import Array
from mocobot.comparison import rules


@dataclass(frozen=True, eq=False)
class Group:
    """Numbers of one kind, such as the three components of a centre of mass.

    Attributes:
        name: what they are.
        unit: theirs, all of them.
        entries: name of each, "" for one alone.
        a, b: values, shape (K,).
        a_covariance, b_covariance: of the errors of each, shape (K, K).
        covariance: of the difference: the sum of these, less what both have in common, shape (K, K).
    """

    name: str
    unit: str
    entries: tuple[str, ...]
    a: Array
    b: Array
    a_covariance: Array
    b_covariance: Array
    covariance: Array

    @classmethod
    def of(
        cls,
        name: str,
        unit: str,
        entries: tuple[str, ...],
        a: tuple[Array, Array],
        b: tuple[Array, Array],
        *,
        common: tuple[Array, Array] | None = None,
    ) -> "Group":
        """From values with covariances.

        Args:
            name, unit, entries: see above.
            a, b: values and the covariance of their errors, without a common error.
            common: derivatives of a and of b by one error of unit variance that both have, shape (K,) each.
        """
        no = np.zeros(len(entries))
        by_a, by_b = common or (no, no)
        return cls(
            name,
            unit,
            entries,
            a[0],
            b[0],
            a[1] + np.outer(by_a, by_a),
            b[1] + np.outer(by_b, by_b),
            a[1] + b[1] + np.outer(by_b - by_a, by_b - by_a),
        )

    @property
    def difference(self) -> Array:
        """b - a, shape (K,)."""
        return self.b - self.a

    @property
    def se(self) -> Array:
        """Standard errors of the difference, shape (K,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def ratio(self) -> Array:
        """Differences over their standard errors, shape (K,); infinite where there is a difference and no error."""
        same = np.abs(self.difference) <= rules.EQUAL * np.maximum(np.abs(self.a), np.abs(self.b))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(same, 0.0, self.difference / self.se)

    @cached_property
    def _correlation(self) -> tuple[Array, Array]:
        """Eigenvalues and eigenvectors of the difference's correlation matrix."""
        se = np.where(self.se > 0, self.se, 1.0)
        return np.linalg.eigh(self.covariance / np.outer(se, se))

    @cached_property
    def _known(self) -> NDArray[np.bool_]:
        """Which directions have an error that can be told from none, shape (K,)."""
        values = self._correlation[0]
        return values > rules.RANK * max(values[-1], 0.0)

    @property
    def dof(self) -> int:
        """Number of independent directions that are tested."""
        return int(np.count_nonzero(self._known))

    @property
    def chi2(self) -> float:
        """Square of the difference in terms of its covariance, correlations heeded; infinite as ``ratio``."""
        if not np.isfinite(self.ratio).all():
            return float("inf")
        values, vectors = self._correlation
        ratios = np.where(self.se > 0, self.ratio, 0.0)
        along = vectors[:, self._known].T @ ratios
        return float(np.sum(along**2 / values[self._known]))

    @property
    def p(self) -> float:
        """Probability of so large a difference by chance."""
        if not self.dof:
            return 1.0 if self.chi2 == 0 else 0.0
        return float(gammaincc(0.5 * self.dof, 0.5 * self.chi2))

    @property
    def together(self) -> list[tuple[str, str, float]]:
        """Entries whose differences have errors that move together, with the correlation."""
        se = self.se
        return [
            (self.entries[i], self.entries[j], r)
            for i in range(len(se))
            for j in range(i)
            if se[i] > 0 and se[j] > 0 and abs(r := self.covariance[i, j] / (se[i] * se[j])) >= rules.TOGETHER
        ]

"""What a search found: causes with their values, and the misfit without and with them."""

from dataclasses import dataclass

import numpy as np

from discrepancy import rules
from discrepancy.least_squares.evidence import Evidence
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Candidate
from estimator.arrays import Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Named:
    """A candidate that the data speak for, and why.

    Attributes:
        index: which candidate of the problem.
        candidate: what and where, with its best shape.
        evidence: when it was chosen.
        rivals: other candidates then, best first, with the gap of their score [nats].
        folds: gain of chi-square on every trial when fitted to the others.
    """

    index: int
    candidate: Candidate
    evidence: Evidence
    rivals: tuple[tuple[Candidate, float], ...]
    folds: tuple[float, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class Found(Named):
    """A named cause with what the last fit says of it.

    Attributes:
        values: its parameters, in their own units, shape (k,).
        covariance: of the values and of what is determined of its shape (see ``best_shape``), in their own units.
        in_sample, held_out: share of the nominal model's misfit that it removes beyond the causes before it (see
            ``held_out.shares``).
    """

    values: Array
    covariance: Array
    in_sample: float
    held_out: float | None


@dataclass(frozen=True, eq=False, kw_only=True)
class Explanation:
    """What the search found.

    Attributes:
        found: causes in the order of discovery.
        rejected: significant candidates that held-out trials did not confirm.
        nominal: misfit of the nominal model, nothing off.
        before, after: misfit with tolerances alone, and with the causes as well.
        plain: misfit with the causes and no tolerances.
        fit: the last fit.
        shared, local: displacements of the unknowns with the causes in the model.
    """

    found: tuple[Found, ...]
    rejected: tuple[Candidate, ...]
    nominal: float
    before: float
    after: float
    plain: float
    fit: Fit
    shared: Array
    local: tuple[Array, ...]

    @property
    def problem(self) -> Problem:
        """The last problem, with the causes' shapes and residual."""
        return self.fit.problem

    @property
    def samples(self) -> int:
        """Number of residuals."""
        return self.problem.samples

    @property
    def explained(self) -> float:
        """Share of the nominal model's misfit above clean data that the causes alone remove."""
        floor = min(self.plain, rules.CLEAN_CHI2_PER_N * self.samples)
        return float(np.clip((self.nominal - self.plain) / max(self.nominal - floor, 1e-9), 0.0, 1.0))

    @property
    def clean(self) -> bool:
        """Whether what is left is noise, and tolerances used as they usually are."""
        noise = self.after <= rules.CLEAN_CHI2_PER_N * self.samples
        return noise and self.fit.strain[2] > rules.SIGNIFICANT_LOG10_P

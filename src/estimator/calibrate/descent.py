"""Steps downhill: Gauss-Newton, damped where a whole step would go up."""

from __future__ import annotations

import numpy as np

from estimator.arrays import Array
from estimator.calibrate import rules
from estimator.calibrate.problem import Point, Problem
from estimator.calibrate.quadratic import solved
from estimator.errors import InputError


class Descent:
    """Damping of steps, kept from one to the next (D. W. Marquardt, J. SIAM 11, 1963).

    Attributes:
        damping: by how much of itself the diagonal of the normal equations is raised; 0 is Gauss-Newton.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self.damping = 0.0

    def step(self, point: Point, most: int) -> tuple[Point | None, int]:
        """A point that is no higher, and how many were tried; None if ``most`` were, and all are higher.

        The covariance of the rows' noise is each point's own, so that the sum may rise a little where it is least.
        """
        problem = self._problem
        H, g = problem.normal(point)
        signals = problem.signals()
        for tried in range(1, most + 1):
            dz = solved(H + self.damping * np.diag(np.diag(H)), g)[0]
            there = self._tried(point, dz)
            if there is not None and there.value <= point.value * (1.0 + rules.RISE):
                self.damping = 0.0 if self.damping <= rules.LEAST_DAMPING else self.damping / rules.DAMPING
                return there, tried
            problem.put_back(signals)
            self.damping = max(rules.LEAST_DAMPING, self.damping * rules.DAMPING)
        return None, most

    def _tried(self, point: Point, dz: Array) -> Point | None:
        try:
            return self._problem.moved(point, dz)
        except (InputError, np.linalg.LinAlgError):  # no arm reaches there
            return None

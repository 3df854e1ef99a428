"""One nonlinear least squares over loops and balance of all trials: Gauss-Newton with priors on the robots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from estimator.arm.unit import AT, COUNT
from estimator.arrays import Array
from estimator.calibrate import rules
from estimator.calibrate.calibration import Calibration
from estimator.calibrate.equations.alone import AloneEquations
from estimator.calibrate.prior import Prior
from estimator.calibrate.problem import KnownMass, Point, Problem, Trial, TrialFit
from estimator.calibrate.quadratic import Quadratic, solved
from estimator.calibrate.unknowns import Layout, Unknowns
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


@dataclass(frozen=True, eq=False)
class Fit:
    """What came out.

    Attributes:
        unknowns: values.
        layout: where each lies in ``covariance``.
        basis: unknowns from coordinates z in which the robots' prior is standard normal, shape (K, k).
        prior: information of that prior on z: 1 for the robots, 0 for the rest, shape (k,).
        z: coordinates of the solution relative to the start, shape (k,).
        covariance: of all unknowns, the mean spring scale held; zero for held ones, shape (K, K).
        by_scale: derivative of all unknowns by the common spring scale that is held, shape (K,); zero where it is free.
        trials: the trials with a payload at the solution.
        alone: recordings of unloaded arms there.
        known: weighed masses there.
        before: chi2/n of loops and balance of every trial with the robots as designed, shape (trials, 2).
        steps: Gauss-Newton steps.
        converged: whether the last step was small.
    """

    unknowns: Unknowns
    layout: Layout
    basis: Array
    prior: Array
    z: Array
    covariance: Array
    by_scale: Array
    trials: tuple[TrialFit, ...]
    alone: tuple[Quadratic, ...]
    known: tuple[Quadratic, ...]
    before: Array
    steps: int
    converged: bool


def fit(
    trials: Sequence[Trial],
    start: Unknowns,
    prior: Prior,
    alone: Sequence[AloneEquations] = (),
    known_mass: Sequence[KnownMass] = (),
    robots: Calibration | None = None,
    *,
    held: bool = False,
) -> Fit:
    """Calibrate.

    Args:
        trials: those with a payload.
        start: values to start from, the robots as designed, or as calibrated before.
        prior: spread of the robots.
        alone: recordings of unloaded arms.
        known_mass: weighed payloads; with one, the common spring scale is free.
        robots: an earlier calibration, whose robots are held; their errors go on to the rest.
        held: the robots are those of the start and have no errors (``prior`` has no spread): a third quicker, and
            trials know nothing of them.
    """
    layout = Layout(len(start.units.x), len(start.carried), len(trials))
    of_units = (
        prior.factor(layout.robots, hold_scale=not known_mass)
        if robots is None
        else np.zeros((layout.robots * COUNT, 0))
    )
    basis = np.asarray(block_diag(of_units, np.eye(layout.size - len(of_units))))
    information = np.zeros(basis.shape[1])
    information[: of_units.shape[1]] = 1.0
    problem = Problem(trials, alone, known_mass, prior, layout, basis, information, held=held)
    descent = Descent(problem)
    point, steps, settled = problem.at(start, np.zeros(basis.shape[1]), split=True), 0, False
    before = _with_robots_held(point, layout)
    while True:
        H, g = problem.normal(point)
        dz, covariance_z = solved(H, g)
        # Where much is left that no calibration explains, steps are small against what is left.
        left = max(1.0, np.sqrt(point.value / point.rows))
        size = float(np.max(np.abs(dz) / np.sqrt(np.diag(covariance_z)))) / left
        if problem.complete:
            settled = size < rules.CONVERGED
            if settled or steps >= rules.MAX_STEPS:
                break
        elif size < rules.COARSE or steps >= rules.MAX_COARSE_STEPS:
            point, steps = problem.on_all_rows(point, dz), steps + 1
            continue
        lower, tried = descent.step(point, rules.MAX_STEPS - steps)
        steps += tried
        flat = lower is None or (tried > 1 and lower.value > (1.0 - rules.FLAT) * point.value)
        point = lower or point
        if flat and problem.complete:
            break
        if flat:
            point = problem.on_all_rows(point, np.zeros(len(point.z)))

    def followed(held: Array) -> Array:
        """Changes of all unknowns with one of what is held, shapes (K, ...)."""
        return held - basis @ (covariance_z @ (basis.T @ (point.H @ held)))

    by_scale, covariance = np.zeros(layout.size), basis @ covariance_z @ basis.T
    if robots is not None:
        by_robots = followed(np.eye(layout.size)[:, layout.of_units])
        by_scale = by_robots @ robots.by_scale.ravel()
        covariance += by_robots @ robots.covariance @ by_robots.T
    elif not known_mass:
        by_scale[layout.unit_indices(np.r_[AT["stiffness_ratio"]])] = 1.0
        by_scale = followed(by_scale)
    return Fit(
        point.unknowns, layout, basis, information, point.z, covariance, by_scale, point.trials, point.alone,
        point.known, before, steps, settled,
    )  # fmt: skip


def _with_robots_held(point: Point, layout: Layout) -> Array:
    """chi2/n of loops and balance of every trial when payloads and bases alone are fitted, shape (trials, 2)."""
    rest = np.arange(layout.of_units.stop, layout.size)
    dx = np.zeros(layout.size)
    if len(rest):
        dx[rest] = solved(point.H[np.ix_(rest, rest)], point.g[rest])[0]
    parts = [
        (part.at(dx) / max(1, part.count)) for trial in point.trials for part in (trial.loops, trial.balance)
    ]
    return np.array(parts).reshape(-1, 2)

"""Least squares of a calibration: loops and balance of all trials, priors on the robots, weighed payloads.

Gauss-Newton starts from the robots as designed, on few rows first and then on all rows. In coordinates z the robots'
prior is standard normal; held unknowns have no coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, cho_factor, cho_solve

from estimator.arm.unit import AT, COUNT, ArmUnit
from estimator.arrays import Array
from estimator.calibrate import rules
from estimator.calibrate.calibration import CalibratedPayload, Calibration
from estimator.calibrate.driven import Drift, Driven, eliminated, learnt
from estimator.calibrate.equations import AloneEquations, Curvature, Rowed, TrialEquations
from estimator.calibrate.prior import Prior
from estimator.calibrate.rows import Rows, Sensing
from estimator.errors import InputError
from estimator.rigid_team import Bases, Shared


class Unknowns(NamedTuple):
    """Robots side by side, grasps and inertial parameters of each payload, and bases in each trial."""

    units: ArmUnit
    carried: tuple[Shared, ...]
    bases: tuple[Bases, ...]


@dataclass(frozen=True)
class Layout:
    """Position of each unknown in one vector: robots, then payloads, then trials; the fields are their numbers."""

    robots: int
    payloads: int
    trials: int

    @property
    def of_units(self) -> slice:
        """Slice of all robots, ``COUNT`` entries each."""
        return slice(0, self.robots * COUNT)

    @property
    def per_payload(self) -> int:
        """Number of unknowns per payload: grasps of robots 2 to N, and ten inertial parameters."""
        return 6 * (self.robots - 1) + 10

    def of_payload(self, payload: int) -> slice:
        """Return the slice of one payload: grasps (d_i, e_i for i >= 2), then (m, m c, J about {1})."""
        start = self.of_units.stop + payload * self.per_payload
        return slice(start, start + self.per_payload)

    def of_inertia(self, payload: int) -> slice:
        """Return the slice of the inertial parameters of one payload."""
        stop = self.of_payload(payload).stop
        return slice(stop - 10, stop)

    def of_trial(self, trial: int) -> slice:
        """Return the slice of one trial's bases (x, y, z, yaw for i >= 2)."""
        size = 4 * (self.robots - 1)
        start = self.of_payload(self.payloads).start + trial * size
        return slice(start, start + size)

    @property
    def size(self) -> int:
        """Number of unknowns, including held ones."""
        return self.of_trial(self.trials).start

    def unit_indices(self, places: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the indices of the entries ``places`` of ``ArmUnit.x`` for all robots, robot by robot."""
        return (np.arange(self.robots)[:, None] * COUNT + places).ravel()

    def moved(self, at: Unknowns, dx: Array) -> Unknowns:
        """Return the unknowns changed by a step."""
        return Unknowns(
            at.units.moved(dx[self.of_units].reshape(self.robots, COUNT)),
            tuple(shared.moved(dx[self.of_payload(k)]) for k, shared in enumerate(at.carried)),
            tuple(base.moved(dx[self.of_trial(k)]) for k, base in enumerate(at.bases)),
        )


@dataclass(frozen=True, eq=False)
class Quadratic:
    """Sum of squares of whitened rows near some unknowns: chi2(dx) = c + 2 g . dx + dx . H dx.

    Attributes:
        index: indices of the unknowns dx.
        H, g, c: see above, shapes (k, k), (k,), ().
        count: number of rows.
    """

    index: NDArray[np.intp]
    H: Array
    g: Array
    c: float
    count: int

    @classmethod
    def of(cls, J: Array, residual: Array, covariance: Array, index: NDArray[np.intp]) -> Quadratic:
        """Whiten rows (n, C) and their derivative (n, C, k) by the noise covariance (n, C, C); sum the squares."""
        factor = np.linalg.cholesky(covariance)
        white = np.linalg.solve(factor, np.concatenate([J, residual[..., None]], axis=2))
        flat = white.reshape(residual.size, -1)
        gram = flat.T @ flat
        return cls(index, gram[:-1, :-1], gram[:-1, -1], float(gram[-1, -1]), residual.size)

    @classmethod
    def driven(
        cls,
        J: Array,
        residual: Array,
        covariance: Array,
        index: NDArray[np.intp],
        bases: Driven,
        drift: Drift,
        at: slice,
    ) -> tuple[Quadratic, tuple[Array, Array]]:
        """Return the same of the channels ``at`` of bases that drive, without their errors, and these errors."""
        found = eliminated(J[:, at], residual[:, at], covariance[:, at, at], bases, drift, at)
        H, g, c = found.gram[:-1, :-1], found.gram[:-1, -1], float(found.gram[-1, -1])
        return cls(index, H, g, c, residual[:, at].size), (found.states, found.scales)

    @property
    def ratio(self) -> float:
        """chi2 over the number of rows; 0 without rows."""
        return self.c / max(1, self.count)

    @property
    def misfits(self) -> bool:
        """Whether ``ratio`` is larger than noise explains."""
        return self.ratio > max(rules.MISFIT, 1.0 + rules.MISFIT_SIGMAS * np.sqrt(2.0 / max(1, self.count)))

    def plus(self, other: Quadratic) -> Quadratic:
        """Return the sum of two quadratics in the same unknowns."""
        return Quadratic(
            self.index, self.H + other.H, self.g + other.g, self.c + other.c, self.count + other.count
        )

    def at(self, dx: Array) -> float:
        """Return chi2 after a step of all unknowns, shape (K,)."""
        own = dx[self.index]
        return float(self.c + 2.0 * self.g @ own + own @ self.H @ own)


def normal_equations(parts: Sequence[Quadratic], size: int) -> tuple[Array, Array]:
    """Return H (K, K) and g (K,) of all unknowns, summed over the parts."""
    H, g = np.zeros((size, size)), np.zeros(size)
    for part in parts:
        H[np.ix_(part.index, part.index)] += part.H
        g[part.index] += part.g
    return H, g


def solved(H: Array, g: Array) -> tuple[Array, Array]:
    """Return the step -H^-1 g, and H^-1; scale the unknowns, which have different units."""
    scale = 1.0 / np.sqrt(np.diag(H))
    factor = cho_factor(H * np.outer(scale, scale))
    return -scale * cho_solve(factor, scale * g), scale[:, None] * cho_solve(factor, np.diag(scale))


class KnownMass(NamedTuple):
    """A weighed payload: its index (from 0), measured mass [kg] and standard error [kg]."""

    payload: int
    mass_kg: float
    se_kg: float


class CarriedTrial(NamedTuple):
    """Rows of a trial, index of its payload (from 0), sensors of its robots, errors of bases that drive."""

    rows: Rows
    payload: int
    sensing: Sensing
    drift: Drift = Drift()


@dataclass(frozen=True, eq=False)
class Given:
    """Input of a calibration.

    Attributes:
        trials: trials with a payload.
        start: initial values: robots as designed, or as calibrated before.
        prior: prior standard deviations of the robots.
        alone: recordings of unloaded arms.
        known_mass: weighed payloads; with at least one, the common spring scale is free.
        robots: an earlier calibration whose robots are held; their covariance propagates to the other unknowns.
        held: hold the robots at the start without errors (``prior`` is zero). The trials then have no derivatives by
            the robots, which saves a third of the time.
    """

    trials: Sequence[CarriedTrial]
    start: Unknowns
    prior: Prior
    alone: Sequence[AloneEquations] = ()
    known_mass: Sequence[KnownMass] = ()
    robots: Calibration | None = None
    held: bool = False

    def only(self, chosen: Sequence[int]) -> Given:
        """Return the input restricted to some of the trials, by index, and their payloads."""
        carried = sorted({self.trials[k].payload for k in chosen})
        start = Unknowns(
            self.start.units,
            tuple(self.start.carried[payload] for payload in carried),
            tuple(self.start.bases[k] for k in chosen),
        )
        trials = [self.trials[k]._replace(payload=carried.index(self.trials[k].payload)) for k in chosen]
        known = [
            one._replace(payload=carried.index(one.payload))
            for one in self.known_mass
            if one.payload in carried
        ]
        return replace(self, trials=trials, start=start, known_mass=known)


class TrialFit(NamedTuple):
    """One trial at the solution: all its rows together, its loops alone, and its balance alone."""

    all: Quadratic
    loops: Quadratic
    balance: Quadratic


class Point(NamedTuple):
    """Sum of squares near some unknowns.

    Attributes:
        unknowns: the point.
        z: the point in coordinates of ``Problem.basis``, relative to the start, shape (k,).
        trials, alone, known: parts: trials with a payload, recordings of unloaded arms, weighed masses.
        H, g: normal equations of all unknowns without the prior, shapes (K, K) and (K,).
        value: chi2 of all rows and the prior.
        rows: number of rows, plus number of coordinates with a prior.
    """

    unknowns: Unknowns
    z: Array
    trials: tuple[TrialFit, ...]
    alone: tuple[Quadratic, ...]
    known: tuple[Quadratic, ...]
    H: Array
    g: Array
    value: float
    rows: int


class Problem:
    """Sum of squares to minimize, on some of the rows at first.

    Attributes:
        layout: position of each unknown.
        basis: matrix from coordinates z to unknowns, shape (K, k).
        prior: information of the prior on z: 1 for the robots, 0 for the rest, shape (k,).
        complete: whether all rows are in use.
    """

    def __init__(self, given: Given) -> None:
        """Start with evenly spaced rows, ``rules.COARSE_ROWS`` in all."""
        self._given, start = given, given.start
        self.layout = layout = Layout(len(start.units.x), len(start.carried), len(given.trials))
        of_units = np.zeros((layout.of_units.stop, 0))
        if given.robots is None:
            of_units = given.prior.factor(layout.robots, hold_scale=not given.known_mass)
        self.basis = np.asarray(block_diag(of_units, np.eye(layout.size - len(of_units))))
        self.prior = np.zeros(self.basis.shape[1])
        self.prior[: of_units.shape[1]] = 1.0
        # Derivatives at a row's mean signals have errors of up to 2 %. Free arm masses and a common spring scale differ
        # by no more than that, so a Gauss-Newton step would cover only a fifth of the distance. With held robots and
        # weak motion, the errors may exceed the information on the inertia. Both cases need averaged derivatives.
        self._averaged = given.prior.arm_mass_ratio > 0.0 or not self.prior.any()
        coarse = max(1, sum(len(trial.rows.time) for trial in given.trials) // rules.COARSE_ROWS)
        self._use_rows(1 if any(trial.rows.driven for trial in given.trials) else coarse)

    def _use_rows(self, every: int) -> None:
        self.complete = every == 1
        self._blocks = [
            [
                _Block(equations, self._averaged and self.complete)
                for equations in _equations(trial, every, held=self._given.held)
            ]
            for trial in self._given.trials
        ]

    def on_all_rows(self, point: Point, dz: Array) -> Point:
        """Take a step, and use every row from there on."""
        self._use_rows(1)
        return self.moved(point, dz)

    def start(self) -> Point:
        """Evaluate the sum of squares at the start, with loops and balance separate."""
        return self.at(self._given.start, np.zeros(self.basis.shape[1]), split=True)

    def at(self, unknowns: Unknowns, z: Array, *, split: bool = False) -> Point:
        """Evaluate the sum of squares near some unknowns, given also as z; ``split`` separates loops and balance.

        Raises:
            InputError: arms of these robots cannot reach their recorded poses.
        """
        split = split or self.complete
        done = tuple(self._trial(k, unknowns, split=split) for k in range(self.layout.trials))
        alone = tuple(_alone(equations, unknowns.units) for equations in self._given.alone)
        known = tuple(self._weighed(one, unknowns) for one in self._given.known_mass)
        parts = (*(trial.all for trial in done), *alone, *known)
        H, g = normal_equations(parts, self.layout.size)
        value = sum(part.c for part in parts) + float(self.prior @ z**2)
        count = sum(part.count for part in parts) + int(np.count_nonzero(self.prior))
        return Point(unknowns, z, done, alone, known, H, g, value, count)

    def normal(self, point: Point) -> tuple[Array, Array]:
        """Return the normal equations of z with the prior, shapes (k, k) and (k,)."""
        H = self.basis.T @ point.H @ self.basis + np.diag(self.prior)
        return H, self.basis.T @ point.g + self.prior * point.z

    def moved(self, point: Point, dz: Array) -> Point:
        """Evaluate the point after a step; errors as for ``at``."""
        return self.at(self.layout.moved(point.unknowns, self.basis @ dz), point.z + dz)

    def lower(self, point: Point, damping: float, most: int) -> tuple[Point | None, int, float]:
        """Take a damped step (D. W. Marquardt, J. SIAM 11, 1963) to a point that is not higher.

        The sum may rise slightly near its minimum, because the covariance of the row noise depends on the point.

        Args:
            point: start of the step.
            damping: relative increase of the diagonal of the normal equations; 0 is Gauss-Newton.
            most: largest number of tries.

        Returns:
            The new point or None if all tries are higher, the number of tries, and the next damping.
        """
        H, g = self.normal(point)
        every = [block for blocks in self._blocks for block in blocks]
        adjustments = [(block.adjustment, block.wrong) for block in every]
        for tried in range(1, most + 1):
            dz = solved(H + damping * np.diag(np.diag(H)), g)[0]
            try:
                there = self.moved(point, dz)
            except (InputError, np.linalg.LinAlgError):  # unreachable poses
                there = None
            if there is not None and there.value <= point.value * (1.0 + rules.RISE):
                return there, tried, 0.0 if damping <= rules.LEAST_DAMPING else damping / rules.DAMPING
            for block, before in zip(every, adjustments, strict=True):
                block.adjustment, block.wrong = before
            damping = max(rules.LEAST_DAMPING, damping * rules.DAMPING)
        return None, most, damping

    def learnt(self, point: Point) -> list[CarriedTrial]:
        """Return the trials with the errors of driving bases that make the residual at a point most likely."""
        out = []
        for k, trial in enumerate(self._given.trials):
            drift = trial.drift
            if trial.rows.driven:
                block, at = self._blocks[k][0], point.unknowns
                rowed = block.at(at.units, at.carried[trial.payload], at.bases[k])
                assert rowed.driven is not None
                drift = learnt(rowed.residual, rowed.covariance, rowed.driven, drift)
            out.append(trial._replace(drift=drift))
        return out

    def _trial(self, k: int, at: Unknowns, *, split: bool) -> TrialFit:
        """Evaluate one trial; separate loops and balance only if ``split``."""
        payload, layout = self._given.trials[k].payload, self.layout
        of_units = slice(0, 0) if self._given.held else layout.of_units
        index = np.r_[of_units, layout.of_payload(payload), layout.of_trial(k)]
        sums: list[Quadratic | None] = [None, None, None]
        for block in self._blocks[k]:
            rowed = block.at(at.units, at.carried[payload], at.bases[k])
            n, C = rowed.residual.shape
            by_units = rowed.by_units.reshape(n, C, -1)[..., of_units]
            J = np.concatenate([by_units, rowed.by_carried, rowed.by_bases], axis=2)
            kinds = (slice(0, C), slice(0, C - 6), slice(C - 6, C))
            for kind, rows in enumerate(kinds if split else kinds[:1]):
                noise = rowed.scatter if kind else rowed.covariance
                if rowed.driven is None:
                    part = Quadratic.of(J[:, rows], rowed.residual[:, rows], noise[:, rows, rows], index)
                else:
                    drift = block.equations.drift
                    noise = rowed.driven.with_noise(noise, drift)
                    part, wrong = Quadratic.driven(J, rowed.residual, noise, index, rowed.driven, drift, rows)
                    block.wrong = block.wrong if kind else wrong
                before = sums[kind]
                sums[kind] = part if before is None else before.plus(part)
        total = sums[0]
        assert total is not None
        return TrialFit(total, sums[1] or total, sums[2] or total)

    def _weighed(self, known: KnownMass, at: Unknowns) -> Quadratic:
        place = np.array([self.layout.of_inertia(known.payload).start])
        off = (at.carried[known.payload].pi[0] - known.mass_kg) / known.se_kg
        return Quadratic(place, np.array([[1.0 / known.se_kg**2]]), np.array([off / known.se_kg]), off**2, 1)


@dataclass(eq=False)
class _Block:
    """Rows of a trial, with state from earlier steps: adjustment of signals, curvature, errors of driving bases.

    If ``averaged``, derivatives of the balance are averaged over each row.
    """

    equations: TrialEquations
    averaged: bool
    adjustment: Array | None = None
    curvature: Curvature | None = None
    wrong: tuple[Array, Array] | None = None

    def at(self, units: ArmUnit, shared: Shared, bases: Bases) -> Rowed:
        """Evaluate the rows at some unknowns, and keep adjustment and curvature."""
        if self.averaged:
            self.curvature = self.equations.curvature(units, shared, bases, self.curvature)
        rowed = self.equations.at(units, shared, bases, self.adjustment, self.curvature, self.wrong)
        self.adjustment = rowed.adjustment
        return rowed


def _equations(trial: CarriedTrial, every: int, *, held: bool) -> list[TrialEquations]:
    """Return equations of one row in ``every``, in blocks; held robots need no derivatives."""
    chosen = np.arange(0, len(trial.rows.time), every)
    if trial.rows.driven:
        chosen = chosen[np.argsort(trial.rows.time[chosen])]
    parts = np.array_split(chosen, max(1, -(-len(chosen) // rules.BLOCK_ROWS)))
    return [
        TrialEquations.of(
            trial.rows.take(np.sort(part)), trial.sensing, held=held, first=k == 0, drift=trial.drift
        )
        for k, part in enumerate(parts)
    ]


def _alone(equations: AloneEquations, units: ArmUnit) -> Quadratic:
    residual, by_own, covariance = equations.at(units)
    n, N = residual.shape[:2]
    J = np.zeros((n, N, 3, N, COUNT))
    robots = np.arange(N)
    J[:, robots, :, robots] = np.moveaxis(by_own, 1, 0)
    shape = n * N, 3
    return Quadratic.of(
        J.reshape(*shape, -1), residual.reshape(shape), covariance.reshape(*shape, 3), np.arange(N * COUNT)
    )


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of the least squares.

    Attributes:
        point: the solution.
        layout, basis, prior: those of ``Problem``.
        covariance: of all unknowns, with the mean spring scale held; zero for held ones, shape (K, K).
        by_scale: derivative of all unknowns with respect to the held common spring scale, shape (K,); zero if it is
            free.
        before: chi2/n of loops and balance of every trial with the robots as designed, shape (trials, 2).
        steps: number of Gauss-Newton steps.
        converged: whether the last step was small.
    """

    point: Point
    layout: Layout
    basis: Array
    prior: Array
    covariance: Array
    by_scale: Array
    before: Array
    steps: int
    converged: bool

    def payload(self, k: int, label: str | None) -> CalibratedPayload:
        """Return the calibrated payload with index ``k`` from 0."""
        of, grasped = self.layout.of_payload(k), 6 * (self.layout.robots - 1)
        shared, covariance = self.point.unknowns.carried[k], self.covariance[of, of]
        grasps = replace(shared.grasps, covariance=covariance[:grasped, :grasped])
        return CalibratedPayload(label, grasps, shared.pi, covariance, self.by_scale[of])


def fit(given: Given, learn: int = 1) -> Fit:
    """Minimize the sum of squares of a calibration; learn the errors of driving bases so many times.

    Raises:
        InputError, LinAlgError: arms cannot reach their recorded poses, or the equations are singular.
    """
    problem = Problem(given)
    layout, basis = problem.layout, problem.basis
    if not learn:
        problem.start()  # finds the bases' errors about which the next evaluation is linear
    point, steps, settled, damping = problem.start(), 0, False, 0.0
    before = _with_robots_held(point, layout)
    while True:
        H, g = problem.normal(point)
        dz, covariance_z = solved(H, g)
        # If the calibration leaves a large misfit, compare steps with errors scaled by that misfit.
        left = max(1.0, np.sqrt(point.value / point.rows))
        size = float(np.max(np.abs(dz) / np.sqrt(np.diag(covariance_z)))) / left
        if problem.complete:
            settled = size < rules.CONVERGED
            if settled or steps >= rules.MAX_STEPS:
                break
        elif size < rules.COARSE or steps >= rules.MAX_COARSE_STEPS:
            point, steps = problem.on_all_rows(point, dz), steps + 1
            continue
        lower, tried, damping = problem.lower(point, damping, rules.MAX_STEPS - steps)
        steps += tried
        flat = lower is None or (tried > 1 and lower.value > (1.0 - rules.FLAT) * point.value)
        point = lower or point
        if flat and problem.complete:
            break
        if flat:
            point = problem.on_all_rows(point, np.zeros(len(point.z)))

    if learn and any(trial.rows.driven for trial in given.trials):
        at = point.unknowns
        start = Unknowns(given.start.units, at.carried, at.bases)
        return fit(replace(given, trials=problem.learnt(point), start=start), learn - 1)

    def followed(held: Array) -> Array:
        """Return changes of all unknowns per change of a held quantity, shape (K, ...)."""
        return held - basis @ (covariance_z @ (basis.T @ (point.H @ held)))

    by_scale, covariance = np.zeros(layout.size), basis @ covariance_z @ basis.T
    if given.robots is not None:
        by_robots = followed(np.eye(layout.size)[:, layout.of_units])
        by_scale = by_robots @ given.robots.by_scale.ravel()
        covariance += by_robots @ given.robots.covariance @ by_robots.T
    elif not given.known_mass:
        by_scale[layout.unit_indices(np.r_[AT["stiffness_ratio"]])] = 1.0
        by_scale = followed(by_scale)
    return Fit(point, layout, basis, problem.prior, covariance, by_scale, before, steps, settled)


def _with_robots_held(point: Point, layout: Layout) -> Array:
    """Return chi2/n of loops and balance of every trial if only payloads and bases are fitted, shape (trials, 2)."""
    rest = np.arange(layout.of_units.stop, layout.size)
    dx = np.zeros(layout.size)
    if len(rest):
        dx[rest] = solved(point.H[np.ix_(rest, rest)], point.g[rest])[0]
    parts = [
        (part.at(dx) / max(1, part.count)) for trial in point.trials for part in (trial.loops, trial.balance)
    ]
    return np.array(parts).reshape(-1, 2)

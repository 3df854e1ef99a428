"""The least squares of a calibration: loops and balance of all trials, priors on the robots, weighed payloads."""

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
from estimator.calibrate.calibration import Calibration, Prior
from estimator.calibrate.equations import AloneEquations, Curvature, Rowed, TrialEquations
from estimator.calibrate.rows import Rows, Sensing
from estimator.errors import InputError
from estimator.rigid_team import Bases, Shared


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Values of everything.

    Attributes:
        units: the robots side by side, ``x`` of shape (N, ``COUNT``).
        carried: grasps and inertial parameters of every payload.
        bases: where the robots stood in every trial.
    """

    units: ArmUnit
    carried: tuple[Shared, ...]
    bases: tuple[Bases, ...]


@dataclass(frozen=True)
class Layout:
    """Where each unknown lies in one vector: robots, then payloads, then trials.

    Attributes:
        robots: number of robots N.
        payloads: number of payloads, 0 where the robots only move freely.
        trials: number of trials with a payload.
    """

    robots: int
    payloads: int
    trials: int

    @property
    def of_units(self) -> slice:
        """All robots, ``COUNT`` each."""
        return slice(0, self.robots * COUNT)

    @property
    def per_payload(self) -> int:
        """Grasps of robots 2 on, and ten inertial parameters."""
        return 6 * (self.robots - 1) + 10

    @property
    def per_trial(self) -> int:
        """Bases of robots 2 on."""
        return 4 * (self.robots - 1)

    def of_payload(self, payload: int) -> slice:
        """One payload's grasps (d_i, e_i for i >= 2), then (m, m c, J about {1})."""
        start = self.of_units.stop + payload * self.per_payload
        return slice(start, start + self.per_payload)

    def of_inertia(self, payload: int) -> slice:
        """The latter part of it."""
        stop = self.of_payload(payload).stop
        return slice(stop - 10, stop)

    def of_trial(self, trial: int) -> slice:
        """One trial's bases (x, y, z, yaw for i >= 2)."""
        start = self.of_payload(self.payloads).start + trial * self.per_trial
        return slice(start, start + self.per_trial)

    @property
    def size(self) -> int:
        """Number of unknowns, held ones included."""
        return self.of_trial(self.trials).start

    def unit_indices(self, places: NDArray[np.intp]) -> NDArray[np.intp]:
        """Where the same entries of ``ArmUnit.x`` of all robots lie, robot by robot."""
        return (np.arange(self.robots)[:, None] * COUNT + places).ravel()

    def moved(self, at: Unknowns, dx: Array) -> Unknowns:
        """Unknowns changed by a step."""
        carried: Sequence[Shared] = [
            shared.moved(dx[self.of_payload(k)]) for k, shared in enumerate(at.carried)
        ]
        bases = [base.moved(dx[self.of_trial(k)]) for k, base in enumerate(at.bases)]
        units = at.units.moved(dx[self.of_units].reshape(self.robots, COUNT))
        return replace(at, units=units, carried=tuple(carried), bases=tuple(bases))


@dataclass(frozen=True, eq=False)
class Quadratic:
    """A sum of squares of whitened rows near some unknowns: chi2(dx) = c + 2 g . dx + dx . H dx.

    Attributes:
        index: which unknowns dx are.
        H, g, c: as above, shapes (k, k), (k,), ().
        count: rows in it.
    """

    index: NDArray[np.intp]
    H: Array
    g: Array
    c: float
    count: int

    @classmethod
    def of(cls, J: Array, residual: Array, covariance: Array, index: NDArray[np.intp]) -> Quadratic:
        """From rows (n, C), their derivative (n, C, k) and the covariance of their noise (n, C, C)."""
        factor = np.linalg.cholesky(covariance)
        white = np.linalg.solve(factor, np.concatenate([J, residual[..., None]], axis=2))
        flat = white.reshape(residual.size, -1)
        gram = flat.T @ flat
        return cls(index, gram[:-1, :-1], gram[:-1, -1], float(gram[-1, -1]), residual.size)

    @property
    def ratio(self) -> float:
        """chi2 over the number of rows; 0 without rows."""
        return self.c / max(1, self.count)

    @property
    def misfits(self) -> bool:
        """Whether that is more than noise leaves."""
        return self.ratio > max(rules.MISFIT, 1.0 + rules.MISFIT_SIGMAS * np.sqrt(2.0 / max(1, self.count)))

    def plus(self, other: Quadratic) -> Quadratic:
        """The sum of both, of the same unknowns."""
        return Quadratic(
            self.index, self.H + other.H, self.g + other.g, self.c + other.c, self.count + other.count
        )

    def at(self, dx: Array) -> float:
        """chi2 after a step of all unknowns, shape (K,)."""
        own = dx[self.index]
        return float(self.c + 2.0 * self.g @ own + own @ self.H @ own)

    def add_to(self, H: Array, g: Array) -> None:
        """Add to the normal equations of all unknowns."""
        H[np.ix_(self.index, self.index)] += self.H
        g[self.index] += self.g


def solved(H: Array, g: Array) -> tuple[Array, Array]:
    """Step -H^-1 g and H^-1 of normal equations whose unknowns have different units."""
    scale = 1.0 / np.sqrt(np.diag(H))
    factor = cho_factor(H * np.outer(scale, scale))
    return -scale * cho_solve(factor, scale * g), scale[:, None] * cho_solve(factor, np.diag(scale))


@dataclass(frozen=True)
class KnownMass:
    """A weighed payload.

    Attributes:
        payload: which one, from 0.
        mass_kg: what the scales say.
        se_kg: its standard error.
    """

    payload: int
    mass_kg: float
    se_kg: float


@dataclass(frozen=True, eq=False)
class CarriedTrial:
    """A trial with a payload.

    Attributes:
        rows: its rows.
        payload: which of the payloads it carries, from 0.
        sensing: of its robots.
    """

    rows: Rows
    payload: int
    sensing: Sensing

    def blocks(self, every: int = 1, *, held: bool = False) -> list[TrialEquations]:
        """Its equations in blocks, of every so-and-so-many-th row; robots ``held`` need no derivatives."""
        chosen = np.arange(0, len(self.rows.time), every)
        parts = np.array_split(chosen, max(1, -(-len(chosen) // rules.BLOCK_ROWS)))
        return [TrialEquations.of(self.rows.take(part), self.sensing, held=held) for part in parts]


@dataclass(frozen=True, eq=False)
class TrialFit:
    """One trial at the solution.

    Attributes:
        all, loops, balance: of all its rows together, and of either kind alone.
    """

    all: Quadratic
    loops: Quadratic
    balance: Quadratic


class Point(NamedTuple):
    """The sum of squares near some unknowns.

    Attributes:
        unknowns: where.
        z: the same in coordinates of ``Problem.basis``, relative to the start, shape (k,).
        trials, alone, known: its parts.
        H, g: normal equations of all unknowns without the prior, shapes (K, K) and (K,).
        value: chi2 of all rows, and of the prior.
        rows: how many there are, and coordinates that have a prior.
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
    """Everything that is held against the unknowns, on some of the rows at first.

    Attributes:
        layout: where each unknown lies.
        basis: unknowns from coordinates z in which the robots' prior is standard normal, shape (K, k).
        prior: information of that prior on z: 1 for the robots, 0 for the rest, shape (k,).
        complete: whether all rows are in it.
    """

    def __init__(
        self,
        trials: Sequence[CarriedTrial],
        alone: Sequence[AloneEquations],
        known_mass: Sequence[KnownMass],
        prior: Prior,
        layout: Layout,
        basis: Array,
        information: Array,
        *,
        held: bool = False,
    ) -> None:
        """On every so-and-so-many-th row, ``rules.COARSE_ROWS`` in all; ``held`` as ``fit`` has it."""
        self.layout, self.basis, self.prior = layout, basis, information
        self._trials, self._alone, self._known = trials, alone, known_mass
        self._held = held
        # A common scale of springs and arm masses that are each free are told apart by what lies within the errors of
        # derivatives at a row's mean signals (2 % at most): a step of Gauss-Newton then covers a fifth of the way. And
        # where robots are held, motion may be so weak that those errors exceed what it shows of the inertia.
        self._averaged = prior.arm_mass_ratio > 0.0 or not information.any()
        every = max(1, sum(len(trial.rows.time) for trial in trials) // rules.COARSE_ROWS)
        self.complete = every == 1
        self._blocks = _blocks(trials, self._averaged, every, held=held)

    def on_all_rows(self, point: Point, dz: Array) -> Point:
        """A step, and every row from there on."""
        self.complete = True
        self._blocks = _blocks(self._trials, self._averaged, 1, held=self._held)
        return self.moved(point, dz)

    def at(self, unknowns: Unknowns, z: Array, *, split: bool = False) -> Point:
        """The sum of squares near some unknowns.

        Args:
            unknowns, z: where, twice.
            split: whether loops and balance are also wanted apart.

        Raises:
            InputError: robots are such that their arms cannot be where they were.
        """
        layout = self.layout
        done = tuple(
            _trial_fit(k, trial, self._blocks[k], unknowns, layout, split=split or self.complete)
            for k, trial in enumerate(self._trials)
        )
        alone = tuple(_alone_fit(equations, unknowns, layout) for equations in self._alone)
        known = tuple(_weighed(one, unknowns, layout) for one in self._known)
        H, g = np.zeros((layout.size, layout.size)), np.zeros(layout.size)
        parts = (*(trial.all for trial in done), *alone, *known)
        for part in parts:
            part.add_to(H, g)
        value = sum(part.c for part in parts) + float(self.prior @ z**2)
        count = sum(part.count for part in parts) + int(np.count_nonzero(self.prior))
        return Point(unknowns, z, done, alone, known, H, g, value, count)

    def normal(self, point: Point) -> tuple[Array, Array]:
        """Normal equations of z, prior included, shapes (k, k) and (k,)."""
        H = self.basis.T @ point.H @ self.basis + np.diag(self.prior)
        return H, self.basis.T @ point.g + self.prior * point.z

    def moved(self, point: Point, dz: Array) -> Point:
        """The same after a step.

        Raises:
            InputError: as ``at``.
        """
        return self.at(self.layout.moved(point.unknowns, self.basis @ dz), point.z + dz)

    def signals(self) -> list[Array | None]:
        """How the rows' signals are adjusted now."""
        return [block.adjustment for blocks in self._blocks for block in blocks]

    def put_back(self, signals: Sequence[Array | None]) -> None:
        """Adjust the rows' signals as they were."""
        for block, was in zip((b for blocks in self._blocks for b in blocks), signals, strict=True):
            block.adjustment = was


@dataclass(eq=False)
class _Block:
    """Rows of a trial, and what earlier steps found of them.

    Attributes:
        equations: the rows.
        averaged: whether derivatives of the balance are averaged over each row.
        adjustment: of the signals; None before the first step.
        curvature: of those derivatives; None before it is needed.
    """

    equations: TrialEquations
    averaged: bool
    adjustment: Array | None = None
    curvature: Curvature | None = None

    def at(self, units: ArmUnit, shared: Shared, bases: Bases) -> Rowed:
        """The rows at some unknowns; what is found of them is kept."""
        if self.averaged:
            self.curvature = self.equations.curvature(units, shared, bases, self.curvature)
        rowed = self.equations.at(units, shared, bases, self.adjustment, self.curvature)
        self.adjustment = rowed.adjustment
        return rowed


def _blocks(trials: Sequence[CarriedTrial], averaged: bool, every: int, *, held: bool) -> list[list[_Block]]:
    """Rows of all trials; derivatives of the balance are ``averaged`` where every row counts."""
    return [
        [_Block(equations, averaged and every == 1) for equations in trial.blocks(every, held=held)]
        for trial in trials
    ]


def _trial_fit(
    k: int, trial: CarriedTrial, blocks: Sequence[_Block], at: Unknowns, layout: Layout, *, split: bool
) -> TrialFit:
    """A trial at some unknowns; loops and balance apart only where asked."""
    held = all(block.equations.held for block in blocks)
    of_units = slice(0, 0) if held else layout.of_units
    index = np.r_[of_units, layout.of_payload(trial.payload), layout.of_trial(k)]
    sums: list[Quadratic | None] = [None, None, None]
    for block in blocks:
        rowed = block.at(at.units, at.carried[trial.payload], at.bases[k])
        n, C = rowed.residual.shape
        by_units = rowed.by_units.reshape(n, C, -1)[..., of_units]
        J = np.concatenate([by_units, rowed.by_carried, rowed.by_bases], axis=2)
        kinds = (slice(0, C), slice(0, C - 6), slice(C - 6, C))
        for kind, rows in enumerate(kinds if split else kinds[:1]):
            noise = rowed.scatter if kind else rowed.covariance
            part = Quadratic.of(J[:, rows], rowed.residual[:, rows], noise[:, rows, rows], index)
            before = sums[kind]
            sums[kind] = part if before is None else before.plus(part)
    total = sums[0]
    assert total is not None
    return TrialFit(total, sums[1] or total, sums[2] or total)


def _alone_fit(equations: AloneEquations, at: Unknowns, layout: Layout) -> Quadratic:
    residual, by_own, covariance = equations.at(at.units)
    n, N = residual.shape[:2]
    J = np.zeros((n, N, 3, N, COUNT))
    robots = np.arange(N)
    J[:, robots, :, robots] = np.moveaxis(by_own, 1, 0)
    index = np.r_[layout.of_units]
    return Quadratic.of(
        J.reshape(n * N, 3, -1), residual.reshape(n * N, 3), covariance.reshape(n * N, 3, 3), index
    )


def _weighed(known: KnownMass, at: Unknowns, layout: Layout) -> Quadratic:
    place = np.array([layout.of_inertia(known.payload).start])
    off = (at.carried[known.payload].pi[0] - known.mass_kg) / known.se_kg
    return Quadratic(place, np.array([[1.0 / known.se_kg**2]]), np.array([off / known.se_kg]), off**2, 1)


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
    trials: Sequence[CarriedTrial],
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

"""One nonlinear least squares over loops and balance of all trials: Gauss-Newton with priors on the robots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, cho_factor, cho_solve

from estimator.arm.unit import AT, COUNT
from estimator.arrays import Array
from estimator.calibrate import rules
from estimator.calibrate.calibration import Calibration
from estimator.calibrate.equations.alone import AloneEquations
from estimator.calibrate.equations.rows import Rows
from estimator.calibrate.equations.sensing import Sensing
from estimator.calibrate.equations.trial import TrialEquations
from estimator.calibrate.prior import Prior
from estimator.calibrate.unknowns import Layout, Unknowns


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
class Trial:
    """A trial with a payload.

    Attributes:
        rows: its rows.
        payload: which of the payloads it carries, from 0.
        sensing: of its robots.
    """

    rows: Rows
    payload: int
    sensing: Sensing

    def blocks(self, every: int = 1) -> list[TrialEquations]:
        """Its equations in blocks, of every so-and-so-many-th row."""
        chosen = np.arange(0, len(self.rows.time), every)
        parts = np.array_split(chosen, max(1, -(-len(chosen) // rules.BLOCK_ROWS)))
        return [TrialEquations.of(self.rows.take(part), self.sensing) for part in parts]


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


@dataclass(frozen=True, eq=False)
class TrialFit:
    """One trial at the solution.

    Attributes:
        all, loops, balance: of all its rows together, and of either kind alone.
    """

    all: Quadratic
    loops: Quadratic
    balance: Quadratic


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
) -> Fit:
    """Calibrate.

    Args:
        trials: those with a payload.
        start: values to start from, the robots as designed, or as calibrated before.
        prior: spread of the robots.
        alone: recordings of unloaded arms.
        known_mass: weighed payloads; with one, the common spring scale is free.
        robots: an earlier calibration, whose robots are held; their errors go on to the rest.
    """
    layout = Layout(len(start.units.x), len(start.carried), len(trials))
    of_units = (
        prior.factor(layout.robots, hold_scale=not known_mass)
        if robots is None
        else np.zeros((layout.robots * COUNT, 0))
    )
    basis = np.asarray(block_diag(of_units, np.eye(layout.size - len(of_units))))
    z, information = np.zeros(basis.shape[1]), np.zeros(basis.shape[1])
    information[: of_units.shape[1]] = 1.0
    at, step = start, 0
    every = max(1, sum(len(trial.rows.time) for trial in trials) // rules.COARSE_ROWS)
    before = np.zeros((len(trials), 2))
    blocks, adjusted = _blocks(trials, every)
    while True:
        complete = every == 1
        done = [
            _trial_fit(k, trial, blocks[k], at, layout, adjusted[k], split=complete or step == 0)
            for k, trial in enumerate(trials)
        ]
        lone = tuple(_alone_fit(equations, at, layout) for equations in alone)
        known = tuple(_weighed(one, at, layout) for one in known_mass)
        H, g = np.zeros((layout.size, layout.size)), np.zeros(layout.size)
        for part in (*(trial.all for trial in done), *lone, *known):
            part.add_to(H, g)
        if step == 0:
            before = _with_robots_held(done, H, g, layout)
        reduced, score = basis.T @ H @ basis + np.diag(information), basis.T @ g + information * z
        dz, covariance_z = solved(reduced, score)
        size = float(np.max(np.abs(dz) / np.sqrt(np.diag(covariance_z))))
        if complete and (size < rules.CONVERGED or step == rules.MAX_STEPS):
            break
        z += dz
        at = layout.moved(at, basis @ dz)
        step += 1
        if not complete and (size < rules.COARSE or step == rules.MAX_STEPS - 2):
            every = 1
            blocks, adjusted = _blocks(trials, every)

    def followed(held: Array) -> Array:
        """Changes of all unknowns with one of what is held, shapes (K, ...)."""
        return held - basis @ (covariance_z @ (basis.T @ (H @ held)))

    by_scale, covariance = np.zeros(layout.size), basis @ covariance_z @ basis.T
    if robots is not None:
        by_robots = followed(np.eye(layout.size)[:, layout.of_units])
        by_scale = by_robots @ robots.by_scale.ravel()
        covariance += by_robots @ robots.covariance @ by_robots.T
    elif not known_mass:
        by_scale[layout.unit_indices(np.r_[AT["stiffness_ratio"]])] = 1.0
        by_scale = followed(by_scale)
    return Fit(
        at, layout, basis, information, z, covariance, by_scale, tuple(done), lone, known, before, step,
        size < rules.CONVERGED,
    )  # fmt: skip


def solved(H: Array, g: Array) -> tuple[Array, Array]:
    """Step -H^-1 g and H^-1 of normal equations whose unknowns have different units."""
    scale = 1.0 / np.sqrt(np.diag(H))
    factor = cho_factor(H * np.outer(scale, scale))
    return -scale * cho_solve(factor, scale * g), scale[:, None] * cho_solve(factor, np.diag(scale))


def _blocks(
    trials: Sequence[Trial], every: int
) -> tuple[list[list[TrialEquations]], list[list[Array | None]]]:
    """Equations of all trials, and how their signals are to be adjusted: not yet known."""
    blocks = [trial.blocks(every) for trial in trials]
    return blocks, [[None] * len(parts) for parts in blocks]


def _trial_fit(
    k: int,
    trial: Trial,
    blocks: Sequence[TrialEquations],
    at: Unknowns,
    layout: Layout,
    adjusted: list[Array | None],
    *,
    split: bool,
) -> TrialFit:
    """A trial at some unknowns; loops and balance apart only where asked. ``adjusted`` is brought up to date."""
    index = np.r_[layout.of_units, layout.of_payload(trial.payload), layout.of_trial(k)]
    sums: list[Quadratic | None] = [None, None, None]
    for place, equations in enumerate(blocks):
        rowed = equations.at(at.units, at.carried[trial.payload], at.bases[k], adjusted[place])
        adjusted[place] = rowed.adjustment
        n, C = rowed.residual.shape
        J = np.concatenate([rowed.by_units.reshape(n, C, -1), rowed.by_carried, rowed.by_bases], axis=2)
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


def _with_robots_held(trials: Sequence[TrialFit], H: Array, g: Array, layout: Layout) -> Array:
    """chi2/n of loops and balance of every trial when payloads and bases alone are fitted, shape (trials, 2)."""
    rest = np.arange(layout.of_units.stop, layout.size)
    dx = np.zeros(layout.size)
    if len(rest):
        dx[rest] = solved(H[np.ix_(rest, rest)], g[rest])[0]
    parts = [(part.at(dx) / max(1, part.count)) for trial in trials for part in (trial.loops, trial.balance)]
    return np.array(parts).reshape(-1, 2)

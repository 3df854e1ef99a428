"""One nonlinear least squares over loops and balance of all trials: Gauss-Newton with priors on the robots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from estimator.arm.unit import AT, COUNT, ArmUnit
from estimator.arrays import Array
from estimator.calibrate import rules
from estimator.calibrate.calibration import Calibration
from estimator.calibrate.equations.alone import AloneEquations
from estimator.calibrate.equations.rows import Rows
from estimator.calibrate.equations.sensing import Sensing
from estimator.calibrate.equations.trial import Curvature, Rowed, TrialEquations
from estimator.calibrate.prior import Prior
from estimator.calibrate.quadratic import Quadratic, solved
from estimator.calibrate.unknowns import Layout, Unknowns
from estimator.rigid_team.residual import Bases, Shared


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
    blocks = _blocks(trials, prior, every)
    while True:
        complete = every == 1
        done = [
            _trial_fit(k, trial, blocks[k], at, layout, split=complete or step == 0)
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
            blocks = _blocks(trials, prior, every)

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
        if self.averaged and self.curvature is None:
            self.curvature = self.equations.curvature(units, shared, bases)
        rowed = self.equations.at(units, shared, bases, self.adjustment, self.curvature)
        self.adjustment = rowed.adjustment
        return rowed


def _blocks(trials: Sequence[Trial], prior: Prior, every: int) -> list[list[_Block]]:
    """Rows of all trials.

    A common scale of springs and arm masses that are each free are told apart by what lies within the errors of
    derivatives at a row's mean signals (2 % at most): a step of Gauss-Newton then covers a fifth of the way.
    """
    averaged = every == 1 and prior.arm_mass_ratio > 0.0
    return [[_Block(equations, averaged) for equations in trial.blocks(every)] for trial in trials]


def _trial_fit(
    k: int, trial: Trial, blocks: Sequence[_Block], at: Unknowns, layout: Layout, *, split: bool
) -> TrialFit:
    """A trial at some unknowns; loops and balance apart only where asked."""
    index = np.r_[layout.of_units, layout.of_payload(trial.payload), layout.of_trial(k)]
    sums: list[Quadratic | None] = [None, None, None]
    for block in blocks:
        rowed = block.at(at.units, at.carried[trial.payload], at.bases[k])
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

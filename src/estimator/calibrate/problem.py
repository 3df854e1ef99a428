"""The sum of squares that a calibration makes least: loops and balance of all trials, priors, weighed payloads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from estimator.arm.unit import COUNT, ArmUnit
from estimator.arrays import Array
from estimator.calibrate import rules
from estimator.calibrate.equations.alone import AloneEquations
from estimator.calibrate.equations.rows import Rows
from estimator.calibrate.equations.sensing import Sensing
from estimator.calibrate.equations.trial import Curvature, Rowed, TrialEquations
from estimator.calibrate.prior import Prior
from estimator.calibrate.quadratic import Quadratic
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
        trials: Sequence[Trial],
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


def _blocks(trials: Sequence[Trial], averaged: bool, every: int, *, held: bool) -> list[list[_Block]]:
    """Rows of all trials; derivatives of the balance are ``averaged`` where every row counts."""
    return [
        [_Block(equations, averaged and every == 1) for equations in trial.blocks(every, held=held)]
        for trial in trials
    ]


def _trial_fit(
    k: int, trial: Trial, blocks: Sequence[_Block], at: Unknowns, layout: Layout, *, split: bool
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

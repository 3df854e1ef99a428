"""Rows of one robot's logs: residuals, and what causes add to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from discrepancy.candidate import Candidate
from discrepancy.least_squares.whitening import Whitening
from discrepancy.rules import serial as rules
from discrepancy.serial.candidate import place_of
from discrepancy.serial.catalogue import Tolerances
from discrepancy.serial.causes import CAUSES
from discrepancy.serial.causes.base import Hints
from discrepancy.serial.logs import Part
from discrepancy.serial.mechanics.tree import Tree
from discrepancy.serial.model import SerialModel
from discrepancy.serial.rows.applied import Applied
from discrepancy.serial.rows.remainder import Key
from discrepancy.serial.servo.motor import Motor
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class SerialRows:
    """Logs of one robot, cut into blocks that validate each other, as rows of a linear problem.

    Attributes:
        model: the robot as described.
        parts: the logs with their rows.
        joints: which joints have torques, and so channels, from 0, shape (C,).
        hints: where shapes begin.
        whitening: of every block.
        level: sensors' noise over what the whole catalogue leaves, of every joint with torques, shape (C,).
        tolerances: given standard deviations by cause and parameter; causes that are not in it have their own.
        excluded: causes left out of the catalogue.
        spoilt: cause and place of what noise of the positions hides.
        changed: blocks in which causes act; those of a reference come after them.
        common: what may be wrong with the model in all logs, where there is a reference: rows (n, C, s) per block.
        motors: drives that tell no torque, and what they give by what they were given.
        traces: of causes in some shape (``shaped_key``), as far as they were made already: rows (n, C, k) per block.
    """

    model: SerialModel
    parts: tuple[Part, ...]
    joints: NDArray[np.intp]
    hints: Hints
    whitening: tuple[Whitening, ...]
    level: Array
    tolerances: Tolerances
    excluded: frozenset[str]
    spoilt: frozenset[Key]
    changed: int
    common: tuple[Array, ...]
    motors: tuple[Motor, ...] = ()
    traces: Mapping[Any, list[Array]] = field(default_factory=dict, repr=False)
    _seen: dict[Any, list[Array]] = field(default_factory=dict, repr=False)

    @property
    def trials(self) -> Sequence[str]:
        """Names of the blocks."""
        return [name for part in self.parts for name in part.names]

    @property
    def tree(self) -> Tree:
        """The model's numbers."""
        return self.parts[0].signals.tree

    @cached_property
    def block_of(self) -> list[tuple[Part, int]]:
        """Log and number in it of every block."""
        return [(part, k) for part in self.parts for k in range(len(part.blocks))]

    def row_times(self, trial: int) -> Array:
        """Time of every row of a block on its log's clock [s], shape (n,)."""
        part, k = self.block_of[trial]
        return part.signals.time[part.reduction.samples[k]]

    def physical(self, candidate: Candidate) -> list[Array]:
        """Columns of one candidate in N m or N, rows (n, C, k) of every block."""
        cause, at, key = CAUSES[candidate.cause], place_of(candidate), shaped_key(candidate)
        if key not in self._seen:
            rows = self.traces.get(key)
            if rows is None:
                done = [
                    part.reduction(cause.columns(part.signals, at, candidate.shape)) for part in self.parts
                ]
                rows = [block[:, self.joints] for blocks in done for block in blocks]
            rows = _seen_only(rows, candidate.units)
            rows = [block * (t < self.changed and candidate.acts_in(t)) for t, block in enumerate(rows)]
            if candidate.transient:
                return rows
            self._seen[key] = rows
        return self._seen[key]

    def columns(self, candidate: Candidate) -> list[Array]:
        """Whitened columns of one candidate, shape (n, C, k) per block."""
        if candidate.cause not in CAUSES:
            return [white(c) for white, c in zip(self.whitening, self.physical(candidate), strict=True)]
        if candidate.transient is not None:
            acts, rows = candidate.transient.trial, self.physical(candidate)
            return [self.whitening[t](c) if t == acts else np.zeros(c.shape) for t, c in enumerate(rows)]
        key = shaped_key(candidate)
        if key not in self._white:
            rows = self.physical(candidate)
            self._white[key] = [white(c) for white, c in zip(self.whitening, rows, strict=True)]
        return self._white[key]

    @cached_property
    def _white(self) -> dict[Any, list[Array]]:
        """Whitened columns of what lasts, as far as they were made already."""
        return {}

    def common_columns(self, trial: int) -> Array:
        """Whitened columns of what may be wrong in all logs, shape (n, C, s); none without a reference."""
        if self.common:
            return self.whitening[trial](self.common[trial])
        part, k = self.block_of[trial]
        return np.zeros((len(part.reduction.samples[k]), len(self.joints), 0))

    def local_columns(self, trial: int) -> Array:
        """Whitened columns of the friction that joints may have while they rest, shape (n, C, l)."""
        if trial not in self._resting:
            self._resting[trial] = self.whitening[trial](self._rests(trial))
        return self._resting[trial]

    def in_motion(self, error: Array, trial: int) -> Array:
        """An error of a block's torques (n, C) while the joints move, its mean square by joint that of these rows.

        While a joint rests its friction may be anything, so that nobody can foretell its torque.
        """
        moves = np.clip(1.0 - self._rests(trial).sum(axis=2), 0.0, 1.0)
        share = np.mean(moves**2, axis=0)
        return np.asarray(error * moves / np.sqrt(np.where(share > 0, share, 1.0)))

    def _rests(self, trial: int) -> Array:
        """Friction that joints may have while they rest, one unit each, rows (n, C, l)."""
        part, k = self.block_of[trial]
        rests = [rest[:, self.joints] for rest in part.rests(k)]
        none = np.zeros((len(part.reduction.samples[k]), len(self.joints), 0))
        return np.stack(rests, axis=2) if rests else none

    @cached_property
    def _resting(self) -> dict[int, Array]:
        return {}

    def physical_residual(
        self, active: Sequence[tuple[Candidate, Array]], shared: Array | None = None
    ) -> list[Array]:
        """The same in N m or N, rows (n, C) of every block.

        What is a number of the tree or a zero is put there, and all other causes act on that: a tenth of a mass times a
        tilt is more than the noise.
        """
        lasting = [(c, v) for c, v in active if c.transient is None]
        out, changed = [], {id(part) for part, _ in self.block_of[: self.changed]}
        for part in self.parts:
            there = Applied.of(part.signals, lasting if id(part) in changed else [])
            out += [rows[:, self.joints] for rows in part.reduction(there.left)]
        for candidate, values in active:
            if candidate.transient is not None:
                taken = [columns @ values for columns in self.physical(candidate)]
                out = [r - x for r, x in zip(out, taken, strict=True)]
        if shared is not None and shared.size:
            out = [r + columns @ shared for r, columns in zip(out, self.common, strict=True)]
        return out

    @property
    def slopes_vary(self) -> bool:
        """Not of drives that tell no torque: their gears leave more than noise, which other links would explain."""
        return not self.motors

    def slopes(self, active: Sequence[tuple[Candidate, Array]]) -> Sequence[Sequence[Array] | None]:
        """Whitened columns of causes where all are, (n, C, k) per block; None where they are those of the model."""
        listed = [c.transient is None and c.cause in CAUSES for c, _ in active]
        lasting = [one for one, there in zip(active, listed, strict=True) if there]
        changed = {id(part) for part, _ in self.block_of[: self.changed]}
        parts = [(part, Applied.of(part.signals, lasting)) for part in self.parts if id(part) in changed]
        return [
            self._slopes(parts, *one) if there else None for one, there in zip(active, listed, strict=True)
        ]

    def _slopes(
        self, parts: Sequence[tuple[Part, Applied]], candidate: Candidate, values: Array
    ) -> list[Array] | None:
        rows: list[Array] = []
        for part, there in parts:
            columns = there.slopes(candidate, values)
            if columns is None:
                return None
            rows += [block[:, self.joints] for block in part.reduction(columns)]
        rows = _seen_only(rows, candidate.units)
        rows += [np.zeros_like(block) for block in self.physical(candidate)[len(rows) :]]
        return [white(block) for white, block in zip(self.whitening, rows, strict=True)]


def _seen_only(rows: list[Array], units: Array) -> list[Array]:
    """Columns with nought in place of those that are rounding beside the others, such as a push along the axis."""
    size = units * np.sqrt(np.sum([np.sum(block**2, axis=(0, 1)) for block in rows], axis=0))
    return [block * (size > rules.REDUNDANT * size.max(initial=0.0)) for block in rows]


def shaped_key(candidate: Candidate) -> Any:
    """What tells a candidate's columns from those of others: cause, place and shape."""
    return candidate.key, tuple(sorted(candidate.shape.items()))

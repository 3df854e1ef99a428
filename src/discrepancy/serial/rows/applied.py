"""Causes where they are: torques that they leave, and columns, with their values in the machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy.candidate import Candidate
from discrepancy.rules import serial as rules
from discrepancy.serial.candidate import place_of
from discrepancy.serial.causes import CAUSES
from discrepancy.serial.rows.moved import asking
from discrepancy.serial.rows.signals import Signals
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Applied:
    """Signals of one log with causes in them.

    Attributes:
        signals: as the model has them.
        bare: with all numbers of the tree and zeros in place, but for what hangs on a link besides.
        laden: with that, too; it asks for the torques of such a machine.
        besides: what is no number of the tree.
    """

    signals: Signals
    bare: Signals
    laden: Signals
    besides: tuple[tuple[Candidate, Array], ...]

    @classmethod
    def of(cls, signals: Signals, active: Sequence[tuple[Candidate, Array]]) -> Applied:
        """With causes and their values, in their own units."""
        bare, besides, hung = signals, [], []
        for candidate, values in active:
            cause = CAUSES[candidate.cause]
            if cause.merges:
                hung.append((candidate, values))
                continue
            there = cause.applied(bare, place_of(candidate), values, candidate.shape)
            if there is None:
                besides.append((candidate, values))
            bare = there or bare
        laden = bare
        for candidate, values in hung:
            cause = CAUSES[candidate.cause]
            laden = cause.applied(laden, place_of(candidate), values, candidate.shape) or laden
        if laden is not signals:
            laden = asking(signals, laden)
        return cls(signals, bare, laden, tuple(besides))

    @property
    def left(self) -> Array:
        """Measured torques less those that the model asks for with the causes in it, shape (W, J)."""
        added = (_added(self.laden, *one) for one in self.besides)
        return self.laden.residual - sum(added, np.zeros_like(self.signals.torque))

    def slopes(self, candidate: Candidate, values: Array) -> Array | None:
        """Columns of one of the causes where all are, shape (W, J, k); None where they are those of the model."""
        cause, at = CAUSES[candidate.cause], place_of(candidate)
        if cause.applied(self.bare, at, values, candidate.shape) is None:
            return cause.columns(self.laden, at, candidate.shape) if cause.laden else None
        there = self.laden if cause.laden else self.bare
        columns = np.moveaxis(cause.slopes(self.signals, there, at, candidate.shape), 2, 0)
        out = np.stack([x + self._read(x) for x in columns], axis=2)
        return out + self._elsewhere(candidate)[..., None] if cause.moves else out

    def _read(self, torque: Array) -> Array:
        """What causes that depend on loads add for a little more torque, over that, shape (W, J) -> (W, J)."""
        out = np.zeros_like(torque)
        for candidate, values in self.besides:
            cause = CAUSES[candidate.cause]
            if cause.laden and np.any(values):
                out += cause.by_load(self.laden, place_of(candidate), values, candidate.shape, torque)
        return out

    def _elsewhere(self, zero: Candidate) -> Array:
        """What all else at a joint adds where the joint is farther on, per unit, shape (W, J)."""
        cause, at = CAUSES[zero.cause], place_of(zero)
        step = rules.STEP_M if self.signals.tree.slides[at] else rules.STEP_RAD
        ends = [cause.applied(self.laden, at, np.array([by]), zero.shape) for by in (step, -step)]
        out = np.zeros_like(self.signals.torque)
        for candidate, values in self.besides:
            if candidate.joint == zero.joint and not CAUSES[candidate.cause].laden:
                more, less = (_added(there, candidate, values) for there in ends if there is not None)
                out += (more - less) / (2.0 * step)
        return out


def _added(signals: Signals, candidate: Candidate, values: Array) -> Array:
    return CAUSES[candidate.cause].exact(signals, place_of(candidate), values, candidate.shape)

"""Causes where they are: torques that they leave, and columns, with their values in the machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy.candidate import Candidate
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
        added = np.zeros_like(self.signals.torque)
        for candidate, values in self.besides:
            cause = CAUSES[candidate.cause]
            added = added + cause.exact(self.laden, place_of(candidate), values, candidate.shape)
        return self.laden.residual - added

    def slopes(self, candidate: Candidate, values: Array) -> Array | None:
        """Columns of one of the causes where all are, shape (W, J, k); None where they are those of the model."""
        cause, at = CAUSES[candidate.cause], place_of(candidate)
        if cause.laden:
            return cause.columns(self.laden, at, candidate.shape)
        there = cause.applied(self.bare, at, values, candidate.shape)
        return None if there is None else cause.columns(self.bare, at, candidate.shape)


def place_of(candidate: Candidate) -> int:
    """Which joint a candidate is at, from 0; -1 of the whole arm."""
    return -1 if candidate.joint is None else candidate.joint - 1

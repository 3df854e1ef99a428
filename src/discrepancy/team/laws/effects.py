"""A law as the simulator's effects: one for each component of its place."""

from __future__ import annotations

from dataclasses import asdict

from discrepancy.laws.candidate import LawCandidate
from discrepancy.laws.said.pieces import pieces_of
from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.law import Law


def effects_of(candidate: LawCandidate, values: Array) -> list[Effect] | None:
    """The effects ``law`` of a law, or None where the simulator has no such.

    Args:
        candidate: the law.
        values: of its parameters, shape (k,).
    """
    try:
        return [Law(**asdict(piece)) for piece in pieces_of(candidate, values)]
    except InputError:
        return None

"""Which causes these logs cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from discrepancy.candidate import Candidate
from discrepancy.rules import serial as rules
from discrepancy.serial.causes import CAUSES
from estimator.arrays import Array


def look_alikes(candidates: Sequence[Candidate], columns: Sequence[Sequence[Array]]) -> list[dict[str, Any]]:
    """Statements on causes whose traces another imitates.

    Each number counts in its own unit, so that what would take many tolerances of another is no imitation.

    Args:
        candidates: all lasting causes.
        columns: whitened columns of every one of them, shape (n, C, k) per block.
    """
    flat = [np.concatenate([block.reshape(-1, block.shape[2]) for block in own]) for own in columns]
    scaled = [a * c.units for a, c in zip(flat, candidates, strict=True)]
    grams = [[a.T @ b for b in scaled] for a in scaled]
    pairs: dict[frozenset[int], tuple[Candidate, Candidate]] = {}
    for k, candidate in enumerate(candidates):
        own = float(np.trace(grams[k][k]))
        others = [(_left(grams, k, j), j) for j in range(len(candidates)) if j != k]
        left, other = min(others, default=(np.inf, k))
        if left < rules.ALIKE_SHARE * own:
            pairs.setdefault(frozenset((k, other)), (candidate, candidates[other]))
    by_kind: dict[tuple[str, str], list[tuple[Candidate, Candidate]]] = {}
    for one, other in pairs.values():
        by_kind.setdefault((one.kind, other.kind), []).append((one, other))
    return [_statement(alike) for alike in by_kind.values()]


def _left(grams: Sequence[Sequence[Array]], k: int, j: int) -> float:
    """Of a trace, squared, what another cause cannot make of it within ``MOST_UNITS`` of its own unit."""
    normal = grams[j][j] + np.eye(len(grams[j][j])) / rules.MOST_UNITS**2
    return float(np.trace(grams[k][k] - grams[k][j] @ np.linalg.solve(normal, grams[j][k])))


def _statement(alike: Sequence[tuple[Candidate, Candidate]]) -> dict[str, Any]:
    """One statement on all places where two kinds of causes look alike."""
    advice = dict.fromkeys(CAUSES[c.cause].separate.rstrip(".") for c in alike[0])
    pairs = ", ".join(f"{one.label} against {other.label}" for one, other in alike)
    return {
        "what": pairs,
        "why": "in these motions they leave the same trace",
        "remedy": "; or ".join(text[:1].lower() + text[1:] for text in advice if text),
    }


GENERAL = (
    (
        "one scale of all torques against all masses, inertias and frictions",
        "a robot that is heavier, and rubs more, by the same share gives every torque by that share more",
        "a known weight on the last link",
    ),
    (
        "what is on the motor's side of a gear against what is on the joint's",
        "the log has one position a joint",
        "positions on both sides of the gear",
    ),
)


def general() -> list[dict[str, Any]]:
    """What no logs of positions and torques decide: what, why, and what would."""
    return [{"what": what, "why": why, "remedy": remedy} for what, why, remedy in GENERAL]

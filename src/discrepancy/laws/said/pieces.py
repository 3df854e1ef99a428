"""A law as functions of one amplitude each, which is how simulators take it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from discrepancy import rules
from discrepancy.laws.candidate import LawCandidate
from discrepancy.laws.said.numbers import parts_of
from estimator.arrays import Array


@dataclass(frozen=True)
class Piece:
    """``amplitude`` times a function of a signal, and times another signal where one is named, added to a target.

    Attributes:
        target: the simulator's name of what it adds to.
        function: as in ``mocobot_sim.laws.functions``: a curve's knots are hats.
        of, times: names of signals; ``times`` is empty where there is none.
        amplitude: in the target's unit over those of the signals.
        number, second, phase_rad: what the function has inside.
    """

    target: str
    function: str
    of: str
    amplitude: float
    number: float = 0.0
    second: float = 0.0
    phase_rad: float = 0.0
    times: str = ""


def pieces_of(candidate: LawCandidate, values: Array) -> list[Piece]:
    """A law's pieces, one or more for each component of its place.

    Args:
        candidate: the law.
        values: of its parameters, shape (k,).
    """
    if candidate.term.of.parts:
        return list(_of_vector(candidate, values))
    out: list[Piece] = []
    for target, part in zip(candidate.at.targets, parts_of(candidate, values), strict=True):
        out += _of_component(candidate, target, part["columns"])
        out += [Piece(target, "constant", "time", float(x)) for x in part["offset"]]
    return out


def _of_vector(candidate: LawCandidate, values: Array) -> Iterator[Piece]:
    """By singular values: an error in one direction each, as a function of one sum of signals; few are of any size."""
    matrix = np.stack([part["columns"] for part in parts_of(candidate, values)])
    number, second = [*candidate.term.numbers.values(), 0.0, 0.0][:2]
    for left, size, right in zip(*_singular(matrix), strict=True):
        of = " + ".join(f"{x:.9g}*{part.name}" for x, part in zip(right, candidate.term.of.each, strict=True))
        for target, x in zip(candidate.at.targets, left, strict=True):
            if abs(x) > rules.LAW_SHOWS:
                yield Piece(target, candidate.term.function, of, float(x * size), number, second)


def _singular(matrix: Array) -> tuple[Array, Array, Array]:
    """Directions of the error, sizes and directions of the signals, those that show, one a row."""
    left, sizes, right = np.linalg.svd(matrix, full_matrices=False)
    shown = sizes > rules.LAW_SHOWS * max(sizes[0], 1e-300)
    return left.T[shown], sizes[shown], right[shown]


def _of_component(candidate: LawCandidate, target: str, columns: Array) -> Iterator[Piece]:
    term = candidate.term
    of, times = term.of.name, "" if term.times is None else term.times.name
    inside = list(term.numbers.values())
    if term.function in ("sine", "hum"):
        size, phase = float(np.hypot(*columns)), float(np.arctan2(columns[1], columns[0]))
        yield Piece(target, term.function, of, size, inside[0], 0.0, phase, times)
    elif term.function == "spline":
        low, step = inside
        names = ["first_hat", *["hat"] * (len(columns) - 2), "last_hat"]
        for k, (name, x) in enumerate(zip(names, columns, strict=True)):
            yield Piece(target, name, of, float(x), low + k * step, step, 0.0, times)
    else:
        number, second = [*inside, 0.0, 0.0][:2]
        yield Piece(target, term.function, of, float(columns[0]), number, second, 0.0, times)

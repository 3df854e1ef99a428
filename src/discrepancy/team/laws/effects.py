"""A law as the simulator's effects: one for each component of its place."""

from __future__ import annotations

import numpy as np

from discrepancy.laws.candidate import LawCandidate
from discrepancy.laws.said.numbers import parts_of
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
    out: list[Effect] = []
    try:
        for target, part in zip(candidate.at.targets, parts_of(candidate, values), strict=True):
            out += _of_component(candidate, target, part["columns"])
            out += [Law(target, "constant", "time", float(x)) for x in part["offset"]]
    except InputError:
        return None
    return out


def _of_component(candidate: LawCandidate, target: str, columns: Array) -> list[Effect]:
    term = candidate.term
    of, times = term.of.name, "" if term.times is None else term.times.name
    inside = list(term.numbers.values())
    if term.function in ("sine", "hum"):
        size, phase = float(np.hypot(*columns)), float(np.arctan2(columns[1], columns[0]))
        return [Law(target, term.function, of, size, inside[0], 0.0, phase, times)]
    if term.function == "spline":
        low, step = inside
        names = ["first_hat", *["hat"] * (len(columns) - 2), "last_hat"]
        return [
            Law(target, name, of, float(x), low + k * step, step, 0.0, times)
            for k, (name, x) in enumerate(zip(names, columns, strict=True))
        ]
    number, second = [*inside, 0.0, 0.0][:2]
    return [Law(target, term.function, of, float(columns[0]), number, second, 0.0, times)]

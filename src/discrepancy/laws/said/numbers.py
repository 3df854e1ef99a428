"""A law's numbers, as people and the simulator take them: amplitudes, phases, what is inside the function."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from discrepancy.laws.candidate import LawCandidate
from estimator.arrays import Array


def parts_of(candidate: LawCandidate, values: Array) -> list[dict[str, Array]]:
    """Amplitudes of every component of the place.

    Args:
        candidate: the law.
        values: of its parameters, shape (k,).

    Returns:
        One entry a component: ``columns``, amplitudes of the function's columns, and ``offset`` (empty without one).
    """
    table = values.reshape(-1, len(candidate.at.axes))
    count = len(table) - int(any(p.name.startswith("offset") for p in candidate.parameters))
    return [{"columns": table[:count, k], "offset": table[count:, k]} for k in range(table.shape[1])]


def physical(candidate: LawCandidate, values: Array, numbers: Mapping[str, float]) -> dict[str, float]:
    """Parameters by name: ``amplitude``, of a sine its ``phase_rad``, of a curve its value at every knot, ``offset``.

    Where the place has several components each name ends with the component's.

    Args:
        candidate: the law.
        values: of its parameters, shape (k,).
        numbers: inside the function.
    """
    out: dict[str, float] = {}
    if candidate.term.of.parts:
        return _of_vector(candidate, values) | {name: float(x) for name, x in numbers.items()}
    for axis, part in zip(candidate.at.axes, parts_of(candidate, values), strict=True):
        end = f"_{axis.replace(' ', '_')}" if axis else ""
        columns = part["columns"]
        if candidate.term.function in ("sine", "hum"):
            out[f"amplitude{end}"] = float(np.hypot(*columns))
            out[f"phase_rad{end}"] = float(np.arctan2(columns[1], columns[0]))
        elif len(columns) > 1:
            out |= {f"at_knot_{k + 1}{end}": float(x) for k, x in enumerate(columns)}
        else:
            out[f"amplitude{end}"] = float(columns[0])
        if len(part["offset"]):
            out[f"offset{end}"] = float(part["offset"][0])
    return out | {name: float(x) for name, x in numbers.items()}


def _of_vector(candidate: LawCandidate, values: Array) -> dict[str, float]:
    """By singular values: in which direction the error is largest, of the signal in which direction, and the next.

    What sits at p feels f + alpha x p, and n . (alpha x p) = alpha . (p x n): how far p is off across n follows.
    """
    of = candidate.term.of
    matrix = np.stack([part["columns"] for part in parts_of(candidate, values)])
    count = len(of.parts)
    left, sizes, right = np.linalg.svd(matrix[:, :count])
    sign = np.sign(right[0, np.argmax(np.abs(right[0]))])
    along, by = sign * left[:, 0], sign * right[0]
    out = {"amplitude": float(sizes[0])}
    out |= {f"along_{axis}": float(x) for axis, x in zip(candidate.at.axes, along, strict=True)}
    out |= {f"by_{axis}": float(x) for axis, x in zip(of.axes, by, strict=True)}
    if of.turns:
        lever = np.cross(by, along @ matrix[:, count:]) / max(sizes[0], 1e-300)
        out |= {f"lever_{axis}": float(x) for axis, x in zip(of.axes, lever, strict=True)}
    return out | {"beside": float(sizes[1])}


def report(
    candidate: LawCandidate, values: Array, covariance: Array
) -> tuple[dict[str, float], dict[str, float]]:
    """The same with standard errors; NaN for a number that was chosen, not determined.

    Args:
        candidate: the law.
        values: of its parameters, shape (k,).
        covariance: of the values, then of what is determined of the numbers inside, shape (k + s, k + s).
    """
    fitted = list(candidate.term.law.fitted)
    now = physical(candidate, values, candidate.shape)
    squares = dict.fromkeys(now, 0.0)
    variances, vectors = np.linalg.eigh(covariance)
    for variance, direction in zip(variances, vectors.T, strict=True):
        step = 0.1 * np.sqrt(max(float(variance), 0.0)) * direction
        ends = []
        for sign in (1.0, -1.0):
            moved = dict(candidate.shape)
            for name, x in zip(fitted, sign * step[len(values) :], strict=False):
                moved[name] += float(x)
            ends.append(physical(candidate, values + sign * step[: len(values)], moved))
        for name in now:
            change = ends[0][name] - ends[1][name]
            if name.startswith("phase_rad"):
                change = float(np.angle(np.exp(1j * change)))
            squares[name] += (change / 0.2) ** 2
    return now, {name: float(np.sqrt(x)) if x > 0.0 else float("nan") for name, x in squares.items()}


def law_to_dict(candidate: LawCandidate) -> dict[str, object]:
    """Plain JSON values: place, function, signals, unit, targets and numbers inside."""
    term = candidate.term
    return {
        "place": candidate.at.name,
        "unit": candidate.at.unit,
        "targets": list(candidate.at.targets),
        "function": term.function,
        "of": term.of.name,
        "times": None if term.times is None else term.times.name,
        "numbers": {name: float(x) for name, x in term.numbers.items()},
        "formula": formula_of(candidate),
    }


def formula_of(candidate: LawCandidate) -> str:
    """The formula in symbols, its numbers put in, ``a`` for the amplitude."""
    term = candidate.term
    shown = {name: f"{value:.4g}" for name, value in term.numbers.items()}
    text = term.law.formula.format(**shown, phase="phase", x=term.of.symbol)
    return text if term.times is None else f"{text} {term.times.symbol}"

"""What the data determine: excitation of every step against the noise the data themselves show.

A direction of parameter space is called determined when the signal that carries it exceeds ``FACTOR`` times
the noise of that signal. Sample counts do not enter: averaging cannot repair a regressor that is mostly
noise (it biases the estimate toward zero), while tiny motions measured without noise are fine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from estimator.arrays import Array

FACTOR = 3.0
"""Signal over noise (rms over rms) below which a direction is not determined."""


@dataclass(frozen=True)
class WeakDirection:
    """A direction of one step's parameters that the data do not determine.

    Attributes:
        step: the step, for example ``"position p_12"``.
        direction: the direction in words, for example ``"along x of {1}"``.
        vector: the same as a unit vector over the step's parameters.
        reason: why, as a sentence without a full stop.
    """

    step: str
    direction: str
    vector: tuple[float, ...]
    reason: str

    def __str__(self) -> str:
        return f"{self.step}, {self.direction}: {self.reason}"

    def to_dict(self) -> dict[str, Any]:
        """Plain types; see ``estimator.estimate.result``."""
        return {"direction": self.direction, "vector": list(self.vector), "reason": self.reason}


@dataclass(frozen=True)
class StepReport:
    """Excitation of one step.

    Attributes:
        step: the step's name.
        parameters: names of the parameters, in the order of ``vector`` of the weak directions.
        unit: unit of ``singular_values`` and ``noise``.
        singular_values: rms signal per direction, descending.
        noise: rms noise of that signal.
        weak: the directions that are not determined; empty when the step is.
    """

    step: str
    parameters: tuple[str, ...]
    unit: str
    singular_values: tuple[float, ...]
    noise: float
    weak: tuple[WeakDirection, ...]

    @property
    def determined(self) -> bool:
        """True when no direction is weak."""
        return not self.weak

    @property
    def rank(self) -> int:
        """Number of determined directions."""
        return max(0, len(self.singular_values) - len(self.weak))

    @property
    def condition(self) -> float:
        """Largest over smallest singular value; infinite for a singular regressor."""
        smallest = self.singular_values[-1]
        return self.singular_values[0] / smallest if smallest > 0 else float("inf")

    def to_dict(self) -> dict[str, Any]:
        """Plain types; see ``estimator.estimate.result``."""
        return {
            "step": self.step,
            "parameters": list(self.parameters),
            "unit": self.unit,
            "singular_values": list(self.singular_values),
            "noise": self.noise,
            "rank": self.rank,
            "condition": self.condition if np.isfinite(self.condition) else None,
            "weak": [weak.to_dict() for weak in self.weak],
        }

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> StepReport:
        """Inverse of ``to_dict``."""
        step = values["step"]
        return cls(
            step,
            tuple(values["parameters"]),
            values["unit"],
            tuple(values["singular_values"]),
            values["noise"],
            tuple(
                WeakDirection(step, w["direction"], tuple(w["vector"]), w["reason"]) for w in values["weak"]
            ),
        )


def judge(
    step: str,
    parameters: Sequence[str],
    information: Array,
    noise: float,
    *,
    unit: str,
    reason: str,
    words: str = "",
    frame: str = "",
    floor: float = 0.0,
    factor: float = FACTOR,
) -> StepReport:
    """Compare the singular values of a regressor to its noise.

    Args:
        step: name of the step.
        parameters: K names.
        information: mean normal matrix X^T X / Q of the scaled regressor, shape (K, K).
        noise: rms noise in the unit of the singular values (the square roots of the eigenvalues).
        unit: that unit.
        reason: what to say of a weak direction.
        words: how to introduce a direction of space, for example ``"along"``; needs K = 3 and ``frame``.
        frame: the frame in which the direction is expressed, for example ``"{1}"``.
        floor: smallest singular value that is not rounding error, same unit.
        factor: least determined ratio of a singular value to ``noise``.
    """
    values, vectors = np.linalg.eigh(information)
    values, vectors = np.sqrt(np.maximum(values[::-1], 0.0)), vectors[:, ::-1]
    # Squaring in the normal matrix leaves no digits below sqrt(eps) of the largest value.
    limit = max(factor * noise, floor, 3e-8 * values[0])
    weak = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value > limit:
            continue
        vector = vector * np.sign(vector[np.argmax(np.abs(vector))])
        direction = f"{words} {axis(vector)} of {frame}" if words else combination(vector, parameters)
        sentence = f"{reason} (signal {value:.2g} {unit}, noise {noise:.2g} {unit})"
        weak.append(WeakDirection(step, direction, tuple(float(x) for x in vector), sentence))
    return StepReport(
        step, tuple(parameters), unit, tuple(float(v) for v in values), float(noise), tuple(weak)
    )


def cross_information(vectors: Array) -> Array:
    """Mean of [a]^T [a] = |a|^2 I - a a^T over the vectors a, shapes (Q, 3) -> (3, 3).

    The normal matrix of x in a x x = b, and of a small rotation of the vectors: what only the components of
    ``a`` across a direction can tell about that direction.
    """
    moment = vectors.T @ vectors / len(vectors)
    return np.trace(moment) * np.eye(3) - moment


def axis(vector: Array) -> str:
    """A direction of space in words: an axis, or its components."""
    k = int(np.argmax(np.abs(vector)))
    if abs(vector[k]) > np.cos(np.deg2rad(10)):
        return "xyz"[k]
    return "(" + ", ".join(f"{x:.2f}" for x in vector) + ")"


def combination(vector: Array, parameters: Sequence[str]) -> str:
    """The large entries of a unit vector in words, such as ``0.90 Ixx -0.44 Iyy``."""
    large = [k for k in np.argsort(-np.abs(vector)) if abs(vector[k]) > 0.3]
    return " ".join(f"{vector[k]:+.2f} {parameters[k]}" for k in large).removeprefix("+")

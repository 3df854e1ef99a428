"""Standard errors: covariance of least squares under coloured noise, and excitation of parameters.

Residuals of 5 Hz signals sampled at 100 Hz are strongly correlated in time. Counting samples as independent would give
standard errors several times too small. The estimate depends on the noise of the scores J^T r at zero frequency. It is
measured by the scatter of scores summed under smooth windows. This is valid for any noise colour and any correlation
between components. The windows are smooth (Hann, overlapping by three quarters) because differentiated encoder noise
is blue. The sharp edges of rectangular blocks leak high frequencies and overestimate standard errors by a factor of
1.6.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from estimator.arrays import Array

WINDOW_S = 4.0
"""Length of a window [s]: resolves 0.25 Hz, and is long compared with the correlation time of 5 Hz noise (0.1 s)."""
MIN_WINDOWS = 6
"""Least number of windows; a short recording gets shorter windows."""
_MAX_LEVERAGE = 0.9  # above it, the residuals do not determine the noise
WEIGHT = 2.0
"""Sum of all windows' weights at any sample."""
_SQUARES = 1.5  # sum of the squared weights at any sample


class Window(NamedTuple):
    """Consecutive samples and their weights, shape (samples of the slice,)."""

    part: slice
    weights: Array


def windows(samples: int, rate_hz: float, first: int = 0) -> list[Window]:
    """Return overlapping Hann windows, truncated at both ends, so that the total weight of every sample is equal.

    ``first`` is the index of the first sample.
    """
    hop = max(1, round(min(WINDOW_S * rate_hz, samples / MIN_WINDOWS) / 4))
    hann = np.sin(np.pi * (np.arange(4 * hop) + 0.5) / (4 * hop)) ** 2
    out = []
    for start in range(-3 * hop, samples, hop):
        low, high = max(0, -start), min(4 * hop, samples - start)
        out.append(Window(slice(first + start + low, first + start + high), hann[low:high]))
    return out


def window_normals(J: Array, r: Array, parts: Sequence[Window]) -> tuple[Array, Array]:
    """Return weighted normal matrices J^T W J, shape (B, K, K), and scores J^T W r, shape (B, K), per window.

    J has shape (Q, rows, K) and r shape (Q, rows); the windows run over the first axis.
    """
    K = J.shape[-1]
    normals, scores = np.empty((len(parts), K, K)), np.empty((len(parts), K))
    for b, window in enumerate(parts):
        J_b = J[window.part].reshape(-1, K)
        weighted = (window.weights[:, None, None] * J[window.part]).reshape(-1, K)
        normals[b], scores[b] = weighted.T @ J_b, weighted.T @ r[window.part].ravel()
    return normals, scores


def window_covariance(normals: Array, scores: Array) -> Array:
    """Return the covariance of a least-squares solution from sums over ``windows``, shape (K, K).

    The covariance is A^-1 S A^-1 with A = J^T J and S the scatter of the windows' scores. The fit absorbs part of the
    noise, and more so with few windows. For white noise, S shrinks from A to A - sum_b A_b A^-1 A_b, and it is
    rescaled accordingly.

    Args:
        normals: A_b per window, shape (B, K, K); their sum must be positive definite.
        scores: J^T W r per window at the solution, shape (B, K).
    """
    factor = np.linalg.inv(np.linalg.cholesky(normals.sum(axis=0) / WEIGHT))  # A^-1 = factor^T factor
    whitened = factor @ normals @ factor.T
    leverage, axes = np.linalg.eigh(np.einsum("bij,bjk->ik", whitened, whitened) / _SQUARES)
    grow = (axes / np.sqrt(1 - np.minimum(leverage, _MAX_LEVERAGE))) @ axes.T
    root = scores @ factor.T @ grow @ factor / np.sqrt(_SQUARES)
    return root.T @ root


def numerical_jacobian(function: Callable[[Array], Array], x: Array, step: float = 1e-5) -> Array:
    """Return the Jacobian of ``function`` at x by central differences, shape (outputs, len(x)).

    It propagates the covariance of one step to the next, where 1 % accuracy suffices.
    """
    columns = [
        (np.ravel(function(x + d)) - np.ravel(function(x - d))) / (2 * step) for d in step * np.eye(len(x))
    ]
    return np.column_stack(columns) if columns else np.empty((np.size(function(x)), 0))


def norm_se(vector: Array, covariance: Array) -> float:
    """Return the standard error of the length of ``vector`` (3,) from its covariance (3, 3)."""
    length = float(np.linalg.norm(vector))
    if length == 0:
        return float(np.sqrt(np.trace(covariance)))
    u = vector / length
    return float(np.sqrt(max(u @ covariance @ u, 0.0)))  # rounding may give a negative value


def standard_errors(covariance: Array) -> Array:
    """Return the square roots of the diagonal, shape (K,)."""
    return np.sqrt(np.maximum(np.diag(covariance), 0.0))


FACTOR = 3.0
"""Signal-to-noise ratio (rms over rms) below which a direction of parameter space is undetermined.

The number of samples does not enter. Averaging cannot repair a regressor that is mostly noise, because noise biases
the estimate toward zero. Small motions without noise are sufficient.
"""


@dataclass(frozen=True)
class WeakDirection:
    """A direction of one step's parameters that the data do not determine.

    Attributes:
        step: such as ``"position p_12"``.
        direction: such as ``"along x of {1}"``.
        vector: the same direction over the step's parameters, of unit length.
        reason: a sentence without a full stop.
    """

    step: str
    direction: str
    vector: tuple[float, ...]
    reason: str

    def __str__(self) -> str:
        return f"{self.step}, {self.direction}: {self.reason}"

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain types; see ``estimator.estimate.result``."""
        return {"direction": self.direction, "vector": list(self.vector), "reason": self.reason}


@dataclass(frozen=True)
class StepReport:
    """Excitation of one step.

    Attributes:
        parameters: their names, in the order of ``vector`` of the weak directions.
        singular_values: rms signal per direction, descending; ``unit`` is theirs and that of the noise.
        noise: rms noise of that signal.
        weak: undetermined directions; empty if the step is determined.
    """

    step: str
    parameters: tuple[str, ...]
    unit: str
    singular_values: tuple[float, ...]
    noise: float
    weak: tuple[WeakDirection, ...]

    @property
    def determined(self) -> bool:
        """True if no direction is weak."""
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
        """Convert to plain types; see ``estimator.estimate.result``."""
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
) -> StepReport:
    """Compare the singular values of a regressor with its noise.

    Args:
        step: name of the step.
        parameters: K names.
        information: mean normal matrix X^T X / Q of the scaled regressor, shape (K, K).
        noise: rms noise in the unit of the singular values (the square roots of the eigenvalues).
        unit: unit of the singular values.
        reason: reason to report for a weak direction.
        words, frame: preposition for a direction in space (K = 3), and its frame, such as ``"along"`` and ``"{1}"``.
        floor: smallest singular value above rounding error, same unit.
    """
    values, vectors = np.linalg.eigh(information)
    values, vectors = np.sqrt(np.maximum(values[::-1], 0.0)), vectors[:, ::-1]
    # Squaring in the normal matrix leaves no digits below sqrt(eps) of the largest value.
    limit = max(FACTOR * noise, floor, 3e-8 * values[0])
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
    """Return the mean of [a]^T [a] = |a|^2 I - a a^T over the vectors a, shapes (Q, 3) -> (3, 3).

    This is the normal matrix of x in a x x = b, and of a small rotation of the vectors. The information on a direction
    comes from the components of ``a`` across it.
    """
    moment = vectors.T @ vectors / len(vectors)
    return np.trace(moment) * np.eye(3) - moment


def axis(vector: Array) -> str:
    """Describe a direction in space: name of an axis, or components."""
    k = int(np.argmax(np.abs(vector)))
    if abs(vector[k]) > np.cos(np.deg2rad(10)):
        return "xyz"[k]
    return "(" + ", ".join(f"{x:.2f}" for x in vector) + ")"


def combination(vector: Array, parameters: Sequence[str]) -> str:
    """Describe a unit vector by its large entries, such as ``0.90 Ixx -0.44 Iyy``."""
    large = [k for k in np.argsort(-np.abs(vector)) if abs(vector[k]) > 0.3]
    return " ".join(f"{vector[k]:+.2f} {parameters[k]}" for k in large).removeprefix("+")

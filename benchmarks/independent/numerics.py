"""Derivatives, rotations, and operators with a memory, on a fine grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

FINE_HZ = 500.0
"""Rate at which motion, forces and memories are computed [Hz]."""
_FIRST = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])
_SECOND = np.array([8 / 5, -1 / 5, 8 / 315, -1 / 560])


def derivative(x: Array) -> Array:
    """First time derivative of samples at ``FINE_HZ`` along axis 0, 8th order; the ends are taken as at rest."""
    padded = np.concatenate([np.repeat(x[:1], 4, 0), x, np.repeat(x[-1:], 4, 0)])
    q = len(x)
    steps = (padded[4 + k : 4 + k + q] - padded[4 - k : 4 - k + q] for k in range(1, 5))
    return sum((c * d for c, d in zip(_FIRST, steps, strict=True)), np.zeros_like(x)) * FINE_HZ


def second_derivative(x: Array) -> Array:
    """Second time derivative, as ``derivative``."""
    padded = np.concatenate([np.repeat(x[:1], 4, 0), x, np.repeat(x[-1:], 4, 0)])
    q = len(x)
    # Differences before sums: what is constant cancels exactly.
    steps = ((padded[4 + k : 4 + k + q] - x) - (x - padded[4 - k : 4 - k + q]) for k in range(1, 5))
    return sum((c * d for c, d in zip(_SECOND, steps, strict=True)), np.zeros_like(x)) * FINE_HZ**2


def smooth_step(x: Array) -> Array:
    """0 for x <= 0, 1 for x >= 1, and infinitely often differentiable in between."""
    inside = np.clip(x, 1e-3, 1 - 1e-3)
    up, down = np.exp(-1 / inside), np.exp(-1 / (1 - inside))
    return np.where(x <= 1e-3, 0.0, np.where(x >= 1 - 1e-3, 1.0, up / (up + down)))


def settled(x: Array, sigma_s: float = 0.008) -> Array:
    """Samples without what is faster than some milliseconds, axis 0: mass keeps displacements from jumping."""
    return gaussian_filter1d(x, sigma_s * FINE_HZ, axis=0, mode="nearest")


def lagged(x: Array, time_constant_s: float) -> Array:
    """First-order lag along axis 0, exact for samples joined by straight lines; starts settled.

    Args:
        x: input at ``FINE_HZ``, shape (Q, ...).
        time_constant_s: time constant [s]; 0 hands the input back.
    """
    if time_constant_s <= 0:
        return x
    ratio = time_constant_s * FINE_HZ
    decay = np.exp(-1 / ratio)
    old, new = ratio * (1 - decay) - decay, 1 - ratio * (1 - decay)
    change = x - x[:1]
    return x[:1] + np.asarray(lfilter([new, old], [1, -decay], change, axis=0))


def play(x: Array, width: Array) -> Array:
    """Play operator: the follower of a driver with a gap of +-``width``, which starts in its middle.

    Args:
        x: driver, shape (Q, ...).
        width: half of the gap, shape of one sample.
    """
    out, state = np.empty_like(x), x[0].copy()
    low, high = x - width, x + width
    for k in range(len(x)):
        state = np.minimum(np.maximum(state, low[k]), high[k])
        out[k] = state
    return out


def coulomb(x: Array, level: Array, presliding: float) -> Array:
    """Dry friction that resists a motion: elastic up to ``level``, then sliding; it keeps its value at rest.

    Args:
        x: displacement, shape (Q, ...).
        level: friction while sliding, shape of one sample.
        presliding: displacement from zero to ``level``.

    Returns:
        What has to be overcome: positive while x grows.
    """
    steps = np.diff(x, axis=0, prepend=x[:1]) * (level / presliding)
    out, state = np.empty_like(x), np.zeros_like(level)
    for k in range(len(x)):
        state = np.minimum(np.maximum(state + steps[k], -level), level)
        out[k] = state
    return out


def bristles(x: Array, level: Array, presliding: float) -> Array:
    """Friction of Dahl, or of LuGre where ``level`` changes with the speed, of one displacement.

    Args:
        x: displacement, shape (Q,).
        level: friction of steady sliding at each sample, shape (Q,).
        presliding: displacement over which friction builds up.

    Returns:
        What has to be overcome, shape (Q,).
    """
    steps = np.diff(x, prepend=x[:1])
    # dz = (level/presliding) (dx - |dx| z / level), whose solution over a step of one speed is exponential.
    decay = np.exp(-np.abs(steps) / presliding).tolist()
    goal = (np.sign(steps) * level).tolist()
    out, state = np.empty_like(x), 0.0
    for k in range(len(x)):
        state = goal[k] + (state - goal[k]) * decay[k]
        out[k] = state
    return out


def parallel_dahl(torque: Array, level: float, width: float) -> Array:
    """Reading of a spring that has a slider of Dahl's kind beside it, of one joint.

    Args:
        torque: of both together [N m], shape (Q,).
        level: largest torque of the slider [N m].
        width: change of the reading over which the slider builds up [N m].

    Returns:
        The spring's part [N m], shape (Q,).
    """
    pieces = 4  # per sample, since the slider's stiffness changes within one
    out, slider = np.empty_like(torque), 0.0
    ratio = level / width
    changes = (np.diff(torque, prepend=torque[:1]) / pieces).tolist()
    for k, change in enumerate(changes):
        sign = 1.0 if change > 0 else -1.0
        for _ in range(pieces):
            stiffness = ratio * (1 - sign * slider / level)
            slider += change * stiffness / (1 + stiffness)
        out[k] = torque[k] - slider
    return out


def from_rotvec(vector: Array) -> Array:
    """Rotation matrices of rotation vectors [rad], (..., 3) to (..., 3, 3)."""
    flat = Rotation.from_rotvec(np.reshape(vector, (-1, 3))).as_matrix()
    return flat.reshape(*np.shape(vector), 3)


def about(axis: int, angle: Array) -> Array:
    """Rotation matrices about axis 0, 1 or 2 by angles [rad], (...,) to (..., 3, 3)."""
    vector = np.zeros((*np.shape(angle), 3))
    vector[..., axis] = angle
    return from_rotvec(vector)


def spin(R: Array) -> tuple[Array, Array]:
    """Angular velocity and acceleration [rad/s, rad/s^2] in the fixed frame, of R (Q, 3, 3), shape (Q, 3) each."""
    back = np.swapaxes(R, -1, -2)
    # R'' R^T is the acceleration's cross product plus a symmetric part, which drops out of the difference.
    return _axial(derivative(R) @ back), _axial(second_derivative(R) @ back)


def turned(R: Array, vector: Array) -> Array:
    """R @ vector for stacks that broadcast, shapes (..., 3, 3) and (..., 3)."""
    return np.einsum("...ij,...j->...i", R, vector)


def back_turned(R: Array, vector: Array) -> Array:
    """R^T @ vector, as ``turned``."""
    return np.einsum("...ji,...j->...i", R, vector)


def _axial(S: Array) -> Array:
    pairs = ((2, 1), (0, 2), (1, 0))
    return np.stack([(S[..., a, b] - S[..., b, a]) / 2 for a, b in pairs], axis=-1)

"""Standard errors: block-robust covariance of least squares, and propagation from one step to the next.

Residuals of 5 Hz signals sampled at 100 Hz are strongly correlated in time, so counting samples as
independent would claim errors several times too small. The scores J^T r are instead summed over blocks of
``BLOCK_S`` seconds, long against the noise's correlation time (0.1 s), and the scatter of the block sums is
the noise in the normal equations, whatever its colour inside a block and across the residuals' components.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCK_S = 2.0
"""Length of a block [s]."""
MIN_BLOCKS = 12
"""A shorter recording is cut into this many blocks instead."""
_MAX_LEVERAGE = 0.9  # a block that alone fixes a direction says nothing about that direction's scatter


def block_slices(samples: int, rate_hz: float, block_s: float = BLOCK_S) -> list[slice]:
    """Consecutive slices of about ``block_s`` seconds that cover ``samples`` samples, lengths within one."""
    length = min(block_s * rate_hz, samples / MIN_BLOCKS)
    count = max(1, min(samples, round(samples / max(length, 1.0))))
    edges = np.linspace(0, samples, count + 1).astype(int)
    return [slice(a, b) for a, b in pairwise(edges)]


def block_normals(J: Array, r: Array, slices: list[slice]) -> tuple[Array, Array]:
    """Per-block normal matrices J^T J, shape (B, K, K), and scores J^T r, shape (B, K).

    J has shape (Q, rows, K) and r shape (Q, rows); ``slices`` run over the first axis.
    """
    K = J.shape[-1]
    normals, scores = np.empty((len(slices), K, K)), np.empty((len(slices), K))
    for b, part in enumerate(slices):
        J_b = J[part].reshape(-1, K)
        normals[b], scores[b] = J_b.T @ J_b, J_b.T @ r[part].ravel()
    return normals, scores


def block_covariance(normals: Array, scores: Array) -> Array:
    """Covariance of a least-squares solution from block sums: the cluster-robust sandwich ("CR2"), (K, K).

    cov = A^-1 (sum_b t_b t_b^T) A^-1 with A = sum_b A_b and t_b = (I - A_b A^-1)^(-1/2) s_b. The root removes
    the shrinkage of the residuals of a block by the fit itself (Bell and McCaffrey 2002), which matters when
    there are only a few blocks per parameter; it is exact for equal uncorrelated noise.

    Args:
        normals: A_b = J_b^T J_b per block, shape (B, K, K); their sum must be positive definite.
        scores: s_b = J_b^T r_b per block at the solution, shape (B, K).
    """
    factor = np.linalg.inv(np.linalg.cholesky(normals.sum(axis=0)))  # A^-1 = factor^T factor
    leverage, axes = np.linalg.eigh(factor @ normals @ factor.T)
    grow = 1 / np.sqrt(1 - np.minimum(leverage, _MAX_LEVERAGE))
    whitened = np.einsum("bij,j...->bi...", axes.transpose(0, 2, 1), factor)  # (B, K, K)
    t = np.einsum("bij,bj->bi", axes, grow * np.einsum("bij,bj->bi", whitened, scores))
    root = t @ factor
    return root.T @ root


def numerical_jacobian(function: Callable[[Array], Array], x: Array, step: float = 1e-5) -> Array:
    """Jacobian of ``function`` at x by central differences, shape (outputs, len(x)).

    Used to carry the covariance of one step into the next, where a percent of accuracy is plenty.
    """
    columns = [
        (np.ravel(function(x + d)) - np.ravel(function(x - d))) / (2 * step) for d in step * np.eye(len(x))
    ]
    return np.column_stack(columns) if columns else np.empty((np.size(function(x)), 0))


def norm_se(vector: Array, covariance: Array) -> float:
    """Standard error of the length of ``vector`` (3,) from its covariance (3, 3)."""
    length = float(np.linalg.norm(vector))
    if length == 0:
        return float(np.sqrt(np.trace(covariance)))
    u = vector / length
    return float(np.sqrt(u @ covariance @ u))


def standard_errors(covariance: Array) -> Array:
    """Square roots of the diagonal, shape (K,)."""
    return np.sqrt(np.maximum(np.diag(covariance), 0.0))

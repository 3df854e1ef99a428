"""What all causes of the catalogue together leave of the rows."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from discrepancy.serial.candidate import SerialCandidate
from discrepancy.serial.causes import CAUSES
from discrepancy.serial.logs import Part
from discrepancy.serial import rules
from estimator.arrays import Array


def remainder(
    parts: Sequence[Part], joints: NDArray[np.intp], candidates: Sequence[SerialCandidate]
) -> tuple[list[Array], float]:
    """Rows (n, C) per block that a plain fit of all causes leaves, and the share of freedom that the fit has left.

    Joints count alike: every channel is scaled to its own residual. Combinations that the data do not tell stay zero.
    """
    columns, rests = [], []
    for part in parts:
        each = [
            CAUSES[c.cause].columns(part.signals, -1 if c.joint is None else c.joint - 1, c.shape)
            for c in candidates
        ]
        whole = part.reduction(np.concatenate(each, axis=2))
        columns += [rows[:, joints] for rows in whole]
        rests += [[rest[:, joints] for rest in part.rests(k)] for k in range(len(part.blocks))]
    residual = [rows[:, joints] for part in parts for rows in part.reduction(part.signals.residual)]
    scale = np.sqrt(np.mean(np.concatenate(residual) ** 2, axis=0))
    scale = np.where(scale > 0, scale, 1.0)
    ends = np.cumsum([r.size for r in residual])[:-1]
    A = np.concatenate([(x / scale[:, None]).reshape(-1, x.shape[2]) for x in columns])
    local = _block_diagonal([[rest / scale for rest in own] for own in rests], [r.size for r in residual])
    A = np.column_stack([A, local])
    size = np.linalg.norm(A, axis=0)
    A = A[:, size > 0] / size[size > 0]
    b = np.concatenate([(r / scale).ravel() for r in residual])
    U, s, _ = np.linalg.svd(A, full_matrices=False)
    U = U[:, s > rules.REDUNDANT**0.5 * s[0]]
    left = b - U @ (U.T @ b)
    freedom = 1.0 - U.shape[1] / len(b)
    blocks = np.split(left, ends)
    return [x.reshape(r.shape) * scale for x, r in zip(blocks, residual, strict=True)], max(freedom, 0.1)


def _block_diagonal(own: Sequence[Sequence[Array]], sizes: Sequence[int]) -> Array:
    total, start, out = sum(sizes), 0, []
    for columns, size in zip(own, sizes, strict=True):
        for column in columns:
            wide = np.zeros(total)
            wide[start : start + size] = column.ravel()
            out.append(wide)
        start += size
    return np.array(out).T if out else np.zeros((total, 0))

"""What all causes of the catalogue together leave of the rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from discrepancy.least_squares.whitening import Whitening
from discrepancy.serial import rules
from discrepancy.serial.candidate import SerialCandidate
from discrepancy.serial.causes import CAUSES
from discrepancy.serial.logs import Part
from discrepancy.serial.rows.noise import SensorNoise
from estimator.arrays import Array

Key = tuple[str, int | None, int | None]
"""Cause and place of a candidate."""


@dataclass(frozen=True, eq=False)
class Remainder:
    """What a plain fit of all causes leaves.

    Attributes:
        rows: shape (n, C) per block.
        freedom: share of the rows' freedom that the fit has left.
        values: of the causes, shape (k,) each.
    """

    rows: list[Array]
    freedom: float
    values: list[Array]


def remainder(
    parts: Sequence[Part], joints: NDArray[np.intp], traces: Sequence[Sequence[Array]]
) -> Remainder:
    """What a plain fit of all causes leaves.

    Joints count alike: every channel is scaled to its own residual. Combinations that the data do not tell stay zero.

    Args:
        parts: the logs.
        joints: those with torques, shape (C,).
        traces: of every cause and block, rows (n, C, k).
    """
    columns = [np.concatenate(own, axis=2) for own in zip(*traces, strict=True)]
    rests = [[rest[:, joints] for rest in part.rests(k)] for part in parts for k in range(len(part.blocks))]
    residual = [rows[:, joints] for part in parts for rows in part.reduction(part.signals.residual)]
    scale = np.sqrt(np.mean(np.concatenate(residual) ** 2, axis=0))
    scale = np.where(scale > 0, scale, 1.0)
    ends = np.cumsum([r.size for r in residual])[:-1]
    A = np.concatenate([(x / scale[:, None]).reshape(-1, x.shape[2]) for x in columns])
    local = _block_diagonal([[rest / scale for rest in own] for own in rests], [r.size for r in residual])
    A = np.column_stack([A, local])
    size = np.linalg.norm(A, axis=0)
    size = np.where(size > 0, size, 1.0)
    b = np.concatenate([(r / scale).ravel() for r in residual])
    U, s, Vt = np.linalg.svd(A / size, full_matrices=False)
    told = s > rules.REDUNDANT**0.5 * s[0]
    U, s, Vt = U[:, told], s[told], Vt[told]
    values = Vt.T @ ((U.T @ b) / s) / size
    left = np.split(b - U @ (U.T @ b), ends)
    ends = np.cumsum([own[0].shape[2] for own in traces])
    return Remainder(
        rows=[x.reshape(r.shape) * scale for x, r in zip(left, residual, strict=True)],
        freedom=max(1.0 - len(s) / len(b), rules.LEAST_FREEDOM),
        values=np.split(values, ends)[:-1],
    )


def reversals(
    parts: Sequence[Part],
    joints: NDArray[np.intp],
    candidates: Sequence[SerialCandidate],
    values: Sequence[Array],
) -> list[Array]:
    """By how much dry friction is uncertain where joints turn round, rows (n, C) per block.

    It has any value between its two while a joint sticks, and a smoothed velocity does not tell when that is. So much it
    changes if the velocities are a little off.
    """
    out = []
    for part in parts:
        s = part.signals
        off = rules.STICKING_SHARE * s.typical
        total = np.zeros_like(s.q)
        for c, v in zip(candidates, values, strict=True):
            cause = CAUSES[c.cause]
            if cause.dry:
                at = -1 if c.joint is None else c.joint - 1
                ends = [
                    cause.columns(replace(s, dq=s.dq + sign * off), at, c.shape) @ v for sign in (1.0, -1.0)
                ]
                total += 0.5 * (ends[0] - ends[1])
        out += [np.abs(rows[:, joints]) for rows in part.reduction(np.abs(total))]
    return out


@dataclass(frozen=True, eq=False)
class NoiseInTraces:
    """What as much noise of the positions once more does to the traces of causes.

    Attributes:
        traces, changes: of every cause and block, rows (n, C, k).
    """

    traces: list[list[Array]]
    changes: list[list[Array]]

    @classmethod
    def of(
        cls,
        parts: Sequence[Part],
        noises: Sequence[SensorNoise],
        joints: NDArray[np.intp],
        candidates: Sequence[SerialCandidate],
    ) -> NoiseInTraces:
        """Traces of all causes, with and without more noise."""
        traces, changes = [[] for _ in candidates], [[] for _ in candidates]
        for part, noise in zip(parts, noises, strict=True):
            other = noise.added(part.signals)
            for k, c in enumerate(candidates):
                at = -1 if c.joint is None else c.joint - 1
                own, off = (CAUSES[c.cause].columns(s, at, c.shape) for s in (part.signals, other))
                traces[k] += [rows[:, joints] for rows in part.reduction(own)]
                changes[k] += [rows[:, joints] for rows in part.reduction(off - own)]
        return cls(traces, changes)

    def spoilt(self, candidates: Sequence[SerialCandidate], white: Whitening) -> frozenset[Key]:
        """Causes whose traces noise spoils: least squares would name them, or shrink them, for its sake.

        Noise is in a trace as it is in the residual, so that a fit sees the one in the other (errors in variables).
        """
        out = set()
        for c, traces, changes in zip(candidates, self.traces, self.changes, strict=True):
            trace, error = (
                sum(np.sum(replace(white, moving=len(x))(x) ** 2, axis=(0, 1)) for x in rows)
                for rows in (traces, changes)
            )
            if np.any(error > rules.SPOILT_SHARE * trace):
                out.add(c.key)
        return frozenset(out)

    def only(self, which: Sequence[int]) -> NoiseInTraces:
        """Of some of the causes."""
        return NoiseInTraces([self.traces[k] for k in which], [self.changes[k] for k in which])

    def of_values(self, values: Sequence[Array]) -> list[Array]:
        """What noise does to the sum of causes of some values, rows (n, C) per block."""
        return [
            np.sum([x[t] @ v for x, v in zip(self.changes, values, strict=True)], axis=0)
            for t in range(len(self.changes[0]))
        ]


def _block_diagonal(own: Sequence[Sequence[Array]], sizes: Sequence[int]) -> Array:
    total, start, out = sum(sizes), 0, []
    for columns, size in zip(own, sizes, strict=True):
        for column in columns:
            wide = np.zeros(total)
            wide[start : start + size] = column.ravel()
            out.append(wide)
        start += size
    return np.array(out).T if out else np.zeros((total, 0))

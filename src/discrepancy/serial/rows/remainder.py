"""What all causes of the catalogue together leave of the rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from discrepancy.least_squares.whitening import Whitening
from discrepancy.rules import serial as rules
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
    parts: Sequence[Part], joints: NDArray[np.intp], traces: Sequence[Sequence[Array]], white: Whitening
) -> Remainder:
    """What a plain fit of all causes leaves.

    Rows are as white as the sensors' noise makes them, or the fit would use causes to cancel noise where that is loud;
    but joints count alike, by what there is to explain. Combinations that the data do not tell stay zero.

    Args:
        parts: the logs.
        joints: those with torques, shape (C,).
        traces: of every cause and block, rows (n, C, k).
        white: of the sensors' noise.
    """
    residual = [rows[:, joints] for part in parts for rows in part.reduction(part.signals.residual)]
    rests = [[rest[:, joints] for rest in part.rests(k)] for part in parts for k in range(len(part.blocks))]
    whites = [replace(white, moving=len(rows)) for rows in residual]
    seen = [w(r) for w, r in zip(whites, residual, strict=True)]
    scale = np.sqrt(np.mean(np.concatenate(seen) ** 2, axis=0))
    scale = np.where(scale > 0, scale, 1.0)
    columns = [np.concatenate(own, axis=2) for own in zip(*traces, strict=True)]
    A = np.concatenate([_flat(w(x), scale) for w, x in zip(whites, columns, strict=True)])
    local = _block_diagonal([[w(rest) / scale for rest in own] for w, own in zip(whites, rests, strict=True)],
                            [r.size for r in residual])  # fmt: skip
    A = np.column_stack([A, local])
    size = np.linalg.norm(A, axis=0)
    size = np.where(size > 0, size, 1.0)
    b = np.concatenate([(z / scale).ravel() for z in seen])
    found, _, told, _ = np.linalg.lstsq(A / size, b, rcond=rules.REDUNDANT**0.5)
    found = found / size
    count = columns[0].shape[2]
    left, at = [], count
    for rows, x, own in zip(residual, columns, rests, strict=True):
        rested = sum(
            (v * rest for v, rest in zip(found[at : at + len(own)], own, strict=True)), np.zeros_like(rows)
        )
        left.append(rows - x @ found[:count] - rested)
        at += len(own)
    ends = np.cumsum([own[0].shape[2] for own in traces])[:-1]
    freedom = max(1.0 - told / len(b), rules.LEAST_FREEDOM)
    return Remainder(left, freedom, np.split(found[:count], ends))


def _flat(rows: Array, scale: Array) -> Array:
    return (rows / scale[:, None]).reshape(-1, rows.shape[2])


def reversals(
    parts: Sequence[Part],
    joints: NDArray[np.intp],
    candidates: Sequence[SerialCandidate],
    values: Sequence[Array],
) -> list[Array]:
    """By how much dry friction, the model's own and what it lacks, is uncertain where joints turn round.

    It has any value between its two while a joint sticks, and a smoothed velocity does not tell when that is. So much
    it changes if the velocities are a little off. Rows (n, C) per block.
    """
    out = []
    for part in parts:
        s = part.signals
        off = rules.STICKING_SHARE * s.typical
        moved = [replace(s, dq=s.dq + sign * off) for sign in (1.0, -1.0)]
        turned = moved[0].direction(s.slow) - moved[1].direction(s.slow)
        total = s.tree.coulomb * turned / np.sqrt(12.0)  # of an even spread
        for c, v in zip(candidates, values, strict=True):
            cause = CAUSES[c.cause]
            if cause.dry:
                at = -1 if c.joint is None else c.joint - 1
                ends = [cause.columns(other, at, c.shape) @ v for other in moved]
                total += (ends[0] - ends[1]) / np.sqrt(12.0)
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

    def spoilt(
        self, candidates: Sequence[SerialCandidate], noise: Sequence[Array], white: Whitening
    ) -> frozenset[Key]:
        """Causes that least squares would name, or shrink, for the sake of noise of the positions.

        Noise is in a trace as it is in the residual, so that a fit sees the one in the other (errors in variables): by
        chance it would have half the gain that noise times noise has.

        Args:
            candidates: the causes.
            noise: the same draw in the nominal residual, rows (n, C) per block.
            white: for noise.
        """
        out = set()
        whites = [replace(white, moving=len(rows)) for rows in noise]
        seen = [w(rows).ravel() for w, rows in zip(whites, noise, strict=True)]
        for c, traces, changes in zip(candidates, self.traces, self.changes, strict=True):
            trace, change = (
                np.concatenate([w(x).reshape(-1, x.shape[2]) for w, x in zip(whites, rows, strict=True)])
                for rows in (traces, changes)
            )
            size = np.linalg.norm(trace, axis=0)
            size = np.where(size > 0, size, 1.0)
            together = change.T @ np.concatenate(seen) / size
            gain = float(
                together @ np.linalg.pinv((trace / size).T @ (trace / size), hermitian=True) @ together
            )
            share = np.sum(change**2, axis=0) / size**2
            if gain > rules.SPOILT_GAIN or np.any(share > rules.SPOILT_SHARE):
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

"""Torques foretold from the motion: with given causes, and with everything else as the other trials have it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from discrepancy.rig import Candidate
from estimator.arrays import Array

if TYPE_CHECKING:
    from discrepancy.serial.rig import SerialRig


def unforetold(rig: SerialRig, trial: int, active: Sequence[tuple[Candidate, Array]]) -> Array:
    """Measured minus foretold torques of one block, low-passed as its rows are, shape (n, C).

    What is normal of a model, such as masses that are off by a tenth, is fitted to the other blocks, within its
    tolerances; where there is one block only, to that.

    Args:
        rig: the logs.
        trial: the block, from 0.
        active: causes and their values.
    """
    trials = range(len(rig.trials))
    physical = rig.physical_residual(active)
    taken = {candidate.key for candidate, _ in active}
    within = [
        c for c in rig.candidates() if c.key not in taken and all(p.tolerance > 0 for p in c.parameters)
    ]
    if not within:
        return physical[trial]
    columns = [np.concatenate([rig.columns(c)[t] * c.units for c in within], axis=2) for t in trials]
    normal, score = np.eye(columns[0].shape[2]), np.zeros(columns[0].shape[2])
    for t in [k for k in trials if k != trial] or [trial]:
        local = rig.local_columns(t)
        A = _without(columns[t].reshape(-1, columns[t].shape[2]), local)
        normal += A.T @ A
        score += A.T @ rig.whitening[t](physical[t]).ravel()
    values = np.linalg.solve(normal, score)
    own = np.concatenate([rig.physical(c)[trial] * c.units for c in within], axis=2)
    return physical[trial] - own @ values


def _without(columns: Array, local: Array) -> Array:
    """Columns less what a block's own unknowns can do."""
    if not local.shape[2]:
        return columns
    basis = np.linalg.qr(local.reshape(-1, local.shape[2]))[0]
    return np.asarray(columns - basis @ (basis.T @ columns))

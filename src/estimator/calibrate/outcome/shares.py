"""What each recording contributes: whose noise it is that is left in the result.

With whitened rows the covariance C of all unknowns is the sum of C H_k C over recordings, weights and the prior, H_k
being their information. The share of recording k in unknown j is (C H_k C)_jj / C_jj; what recordings leave of 1 is the
prior's and that of known weights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimator.arm.unit import AT, GROUPS
from estimator.arrays import Array
from estimator.calibrate.fit import Fit
from estimator.calibrate.quadratic import Quadratic

GRASPS, INERTIAL = "grasps", "inertial_parameters"


def shares(found: Fit) -> list[dict[str, float]]:
    """Mean share of every recording in each kind of unknown: by the names of ``GROUPS``, "grasps" and
    "inertial_parameters"; those with a payload first, then the others. Kinds that are held are left out.
    """
    variance = np.diag(found.covariance)
    kinds = {
        kind: at[variance[at] > 1e-12 * np.max(variance[at], initial=0.0)]
        for kind, at in _kinds(found).items()
    }
    parts = [*(trial.all for trial in found.trials), *found.alone]
    weights = [
        _weights(part, found.covariance) / np.maximum(variance, np.finfo(float).tiny) for part in parts
    ]
    return [
        {kind: float(np.mean(weight[at])) for kind, at in kinds.items() if len(at) and variance[at].any()}
        for weight in weights
    ]


def _kinds(found: Fit) -> dict[str, NDArray[np.intp]]:
    layout = found.layout
    out = {group.name: layout.unit_indices(np.r_[AT[group.name]]) for group in GROUPS}
    payloads = range(layout.payloads)
    grasps = [k for p in payloads for k in range(layout.of_payload(p).start, layout.of_inertia(p).start)]
    inertial = [k for p in payloads for k in range(layout.of_inertia(p).start, layout.of_inertia(p).stop)]
    return out | {GRASPS: np.array(grasps, dtype=np.intp), INERTIAL: np.array(inertial, dtype=np.intp)}


def _weights(part: Quadratic, covariance: Array) -> Array:
    """Diagonal of C H C."""
    columns = covariance[:, part.index]
    return np.einsum("jk,jk->j", columns @ part.H, columns)

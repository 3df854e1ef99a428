"""The catalogue as candidates, and what all of it together leaves."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from discrepancy.emps.causes import CAUSES
from discrepancy.emps.causes.base import Hints
from discrepancy.emps.reduction import Reduction
from discrepancy.emps.signals import Signals
from discrepancy.rig import Candidate, Parameter

Array = NDArray[np.float64]
Tolerances = Mapping[str, Mapping[str, float]]

DEFAULTS: dict[str, dict[str, float]] = {
    cause.name: dict.fromkeys(cause.parameters, 0.0) for cause in CAUSES.values()
}
"""Standard deviations per parameter that are no news: none, since nobody has said what this axis' tolerances are."""


def candidate_of(name: str, hints: Hints, tolerances: Tolerances) -> Candidate:
    """A cause of the catalogue with its first shape."""
    cause = CAUSES[name]
    parameters = tuple(
        Parameter(p, tolerances[name][p], scale)
        for p, scale in zip(cause.parameters, cause.scales, strict=True)
    )
    return Candidate(
        name, cause.family, None, None, parameters, dict(cause.shapes(hints)[0]), {}, cause.where
    )


def remainder(signals: Signals, reduction: Reduction, hints: Hints) -> list[Array]:
    """Rows (n, 2) that all causes of the catalogue together leave."""
    causes = [candidate_of(name, hints, DEFAULTS) for name in CAUSES if name != "push"]
    columns = [reduction(CAUSES[c.cause].columns(signals, c.shape)) for c in causes]
    rows = reduction(signals.residual)
    out = [np.empty_like(r) for r in rows]
    for channel in range(2):
        A = [np.concatenate([c[t][:, channel] for c in columns], axis=1) for t in range(len(rows))]
        whole, y = np.concatenate(A), np.concatenate([r[:, channel] for r in rows])
        size = np.maximum(np.linalg.norm(whole, axis=0), 1e-300)
        x = np.linalg.lstsq(whole / size, y, rcond=1e-9)[0] / size
        for t, r in enumerate(rows):
            out[t][:, channel] = r[:, channel] - A[t] @ x
    return out

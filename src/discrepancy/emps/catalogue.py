"""The catalogue as candidates, and what all of it together leaves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from discrepancy.emps.causes import CAUSES
from discrepancy.emps.causes.base import Hints
from discrepancy.emps.noise import dither
from discrepancy.emps.reduction import Reduction
from discrepancy.emps.signals import Signals
from discrepancy.rig import Candidate, Parameter
from discrepancy.whitening import Whitening

Array = NDArray[np.float64]
Tolerances = Mapping[str, Mapping[str, float]]

SPOILT = 0.01
"""Share of a trace's square that rounding may be; a fit would be off by as much."""

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


def hidden_by_rounding(signals: Signals, reduction: Reduction, hints: Hints, white: Whitening) -> list[str]:
    """Causes whose traces the position's rounding spoils: least squares would name them, or shrink them, for its sake.

    Rounding is in a trace as it is in the residual, so that a fit sees the one in the other (errors in variables). A
    second, equal rounding error shows how much of a trace that is.
    """
    other = Signals.of(replace(signals.log, position=signals.log.position + dither(signals)))
    out = []
    for name in CAUSES:
        if name == "push":
            continue
        shape = candidate_of(name, hints, DEFAULTS).shape
        column, changed = (CAUSES[name].columns(s, shape) for s in (signals, other))
        trace, error = 0.0, 0.0
        for own, off in zip(reduction(column), reduction(changed - column), strict=True):
            white_here = replace(white, moving=len(own))
            trace += float(np.sum(white_here(own) ** 2))
            error += float(np.sum(white_here(off) ** 2))
        if error > SPOILT * trace:
            out.append(name)
    return out


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

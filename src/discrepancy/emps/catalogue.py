"""The catalogue as candidates, and what all of it together leaves."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.emps.causes import CAUSES
from discrepancy.emps.causes.base import Hints
from discrepancy.emps.noise import dither
from discrepancy.emps.recording.signals import Signals
from discrepancy.emps.reduction import Reduction
from discrepancy.least_squares.whitening import Whitening
from estimator.arrays import Array

Tolerances = Mapping[str, Mapping[str, float]]


def default_tolerances() -> dict[str, dict[str, float]]:
    """Standard deviations per parameter that are no news: none, since nobody has said what this axis' are."""
    return {name: dict.fromkeys(cause.parameters, 0.0) for name, cause in CAUSES.items()}


def candidate_of(name: str, hints: Hints, tolerances: Tolerances | None = None) -> Candidate:
    """A cause of the catalogue with its first shape."""
    return CAUSES[name].candidate((tolerances or {}).get(name, {}), CAUSES[name].shapes(hints)[0])


def hidden_by_rounding(signals: Signals, reduction: Reduction, hints: Hints, white: Whitening) -> list[str]:
    """Causes whose traces the position's rounding spoils: least squares would name them, or shrink them, for its sake.

    Rounding is in a trace as it is in the residual, so that a fit sees the one in the other (errors in variables). A
    second, equal rounding error shows how much of a trace that is.
    """
    other = Signals.of(replace(signals.log, position=signals.log.position + dither(signals)))
    out = []
    for name, cause in CAUSES.items():
        if cause.transient:
            continue
        shape = cause.shapes(hints)[0]
        column, changed = (cause.columns(s, shape) for s in (signals, other))
        trace, error = 0.0, 0.0
        for own, off in zip(reduction(column), reduction(changed - column), strict=True):
            white_here = replace(white, moving=len(own))
            trace += float(np.sum(white_here(own) ** 2))
            error += float(np.sum(white_here(off) ** 2))
        if error > rules.SPOILT_SHARE * trace:
            out.append(name)
    return out


def remainder(signals: Signals, reduction: Reduction, hints: Hints) -> list[Array]:
    """Rows (n, 2) that all causes of the catalogue together leave; a second step allows for what is not linear."""
    causes = [candidate_of(name, hints) for name, cause in CAUSES.items() if not cause.transient]
    columns = [reduction(CAUSES[c.cause].columns(signals, c.shape)) for c in causes]
    counts = np.cumsum([len(c.parameters) for c in causes])[:-1]
    values, left = [np.zeros(len(c.parameters)) for c in causes], signals.residual
    for _ in range(2):
        step = _least_squares(columns, reduction(left))
        values = [v + d for v, d in zip(values, np.split(step, counts), strict=True)]
        left = signals.residual
        for cause, value in zip(causes, values, strict=True):
            left = left - CAUSES[cause.cause].exact(signals, value, cause.shape)
    return reduction(left)


def _least_squares(columns: list[list[Array]], rows: list[Array]) -> Array:
    """Values of all columns; each acts in one channel only, and the channels are fitted apart."""
    whole = np.concatenate([np.concatenate([c[t] for c in columns], axis=2) for t in range(len(rows))])
    residual, out = np.concatenate(rows), np.zeros(whole.shape[2])
    for channel in range(2):
        A = whole[:, channel]
        size = np.linalg.norm(A, axis=0)
        used = size > 0
        scaled = A[:, used] / size[used]
        out[used] = np.linalg.lstsq(scaled, residual[:, channel], rcond=1e-9)[0] / size[used]
    return out

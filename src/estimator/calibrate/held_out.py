"""What a calibration from all other recordings says of one: a step of least squares from the common solution."""

from __future__ import annotations

import numpy as np

from estimator.calibrate.fit import Fit
from estimator.calibrate.quadratic import solved


def held_out(fit: Fit) -> list[tuple[float, float] | None]:
    """chi2 per number of loops and balance of every trial with a payload; None where the others do not suffice.

    The problem is linear near its solution, so leaving one trial out takes one solution of normal equations. The bases
    stood elsewhere in every trial and are fitted to the trial itself.
    """
    out: list[tuple[float, float] | None] = []
    layout = fit.layout
    payload = [int(trial.all.index[layout.of_units.stop]) for trial in fit.trials]
    for k, trial in enumerate(fit.trials):
        own = np.r_[layout.of_trial(k)]
        others = [t for i, t in enumerate(fit.trials) if i != k]
        if payload.count(payload[k]) < 2:
            out.append(None)
            continue
        H, g = np.zeros((layout.size, layout.size)), np.zeros(layout.size)
        for part in (*(t.all for t in others), *fit.alone, *fit.known):
            part.add_to(H, g)
        free = ~np.isin(np.arange(layout.size), own)
        kept = fit.basis[free].any(axis=0)
        columns, prior, z = fit.basis[:, kept], fit.prior[kept], fit.z[kept]
        dz, _ = solved(columns.T @ H @ columns + np.diag(prior), columns.T @ g + prior * z)
        dx = columns @ dz
        at = np.flatnonzero(np.isin(trial.all.index, own))
        score = trial.all.g + trial.all.H @ dx[trial.all.index]
        if len(at):
            dx[own] = solved(trial.all.H[np.ix_(at, at)], score[at])[0]
        loops = trial.loops.at(dx) / max(1, trial.loops.count)
        out.append((loops, trial.balance.at(dx) / trial.balance.count))
    return out

"""A team's residuals for the plots: the whitening undone."""

import numpy as np
from scipy.signal import lfilter

from discrepancy.engine.explanation import Explanation
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.whitening import Whitening
from discrepancy.result.traces import Trace
from discrepancy.team.rig import TeamRig
from estimator.arrays import Array


def traces(rig: TeamRig, explanation: Explanation) -> list[Trace]:
    """Residuals of every trial: ``before`` as simulated, ``after`` with the named causes and tolerances."""
    nominal = Fit.of(explanation.nothing.problem.as_whitened, background=False)
    out = []
    for t, (linear, white) in enumerate(zip(rig.linear, rig.whitening, strict=True)):
        before, after = nominal.remaining(t), explanation.fit.remaining(t)
        sigma = np.empty_like(before)
        sigma[: white.moving] = white.loudness * np.linalg.norm(white.chol_moving, axis=1)
        sigma[white.moving :] = np.linalg.norm(white.chol_alone, axis=1)
        out.append(
            Trace(
                rig.trials[t],
                linear.reduction.time,
                white.moving,
                rig.row_rate_hz(t),
                unwhitened(white, before),
                unwhitened(white, after),
                sigma,
                before,
                after,
                rig.quantities(t),
            )
        )
    return out


def unwhitened(white: Whitening, y: Array) -> Array:
    """The residual whose whitening is y, shape (n, C) -> (n, C)."""
    order, moving = white.ar.shape[1], white.moving
    z = y[:moving].copy()
    for c in range(y.shape[1] if moving > order else 0):
        a = np.concatenate([[1.0], -white.ar[c]])
        # The first rows are as they were; they are the past of the first that was predicted.
        past = [
            float(np.dot(white.ar[c][k:], z[order - 1 :: -1, c][: order - k] if order else []))
            for k in range(order)
        ]
        z[order:, c], _ = lfilter([1.0], a, white.innovation[c] * z[order:, c], zi=np.array(past))
    return np.concatenate([white.loudness * (z @ white.chol_moving.T), y[moving:] @ white.chol_alone.T])

"""A team's residuals for the plots: the whitening undone."""

import numpy as np

from discrepancy.engine.explanation import Explanation
from discrepancy.least_squares.fit import Fit
from discrepancy.result.traces import Trace
from discrepancy.team.rig import TeamRig
from discrepancy.team.verdict import unwhitened


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

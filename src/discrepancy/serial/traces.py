"""The robot's residuals for the plots."""

import numpy as np

from discrepancy.engine.explanation import Explanation
from discrepancy.least_squares.fit import Fit
from discrepancy.result.traces import Trace
from discrepancy.serial.rig import SerialRig


def traces(rig: SerialRig, explanation: Explanation) -> list[Trace]:
    """Residuals of every block: ``before`` as modelled, ``after`` with the named causes and tolerances."""
    fit, problem = explanation.fit, explanation.problem
    nominal = Fit.of(explanation.nothing.problem.as_whitened, background=False)
    causes = [
        (candidate, fit.coefficients[span] * candidate.units)
        for candidate, span in zip(problem.candidates, problem.spans, strict=True)
        if np.any(fit.coefficients[span])
    ]
    before, after = rig.physical_residual([], -nominal.shared), rig.physical_residual(causes, -fit.shared)
    out = []
    for t in problem.trials:
        n = len(before[t])
        out.append(
            Trace(
                rig.trials[t],
                rig.row_times(t),
                n,
                rig.row_rate_hz(t),
                before[t],
                after[t],
                rig.sigma(t),
                nominal.remaining(t)[:n],
                fit.remaining(t)[:n],
                rig.quantities(t),
            )
        )
    return out

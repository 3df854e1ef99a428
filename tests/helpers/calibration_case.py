"""Equations of a calibration at instants that are told one by one, and steps in every unknown."""

import numpy as np
from scipy.sparse import csr_array

from estimator.arm.unit import ArmUnit
from estimator.calibrate.equations import TrialEquations
from estimator.calibrate.prior import Prior
from estimator.calibrate.rows import Rows, Sensing
from synthetic_team import Exact, Load, carry, draw_path, draw_units, load

PRIOR = Prior(tilt_rad=0.02, arm_mass_ratio=0.05)
"""All deviations there are."""


def exact_trial(seed: int, robots=3, duration_s=12.0, prior=PRIOR) -> tuple[ArmUnit, Load, Exact]:
    rng = np.random.default_rng(seed)
    units, held = draw_units(robots, prior, rng), load(robots, rng)
    return units, held, carry(units, held, draw_path(held, rng), rng, duration_s)


def instants(exact: Exact, units: ArmUnit, count=8) -> TrialEquations:
    """Every row one instant with exact signals: nothing is filtered and nothing averaged."""
    chosen = np.linspace(300, len(exact.truth) - 300, count).astype(int)
    s = exact.truth[chosen].copy()
    s[..., :3] += units.of("phi_zero")
    s[..., 9:12] += units.of("theta_zero")
    s[..., 18:] = exact.recording.tau[chosen]
    N = s.shape[1]
    gain = np.diag([0.1, 2.0, 90.0])
    gain[0, 2] = gain[2, 0] = -1.5
    rows = Rows(
        s, csr_array(np.eye(count)), np.arange(count) / 4.0, count, gain, np.zeros(count, dtype=np.intp),
        np.full((count, N, 6), 0.05), 100.0, 1.0,
    )  # fmt: skip
    sensing = Sensing(np.zeros((N, 9)), np.tile(np.repeat([3e-5, 2e-5, 0.01], 3), (N, 1)))
    return TrialEquations.of(rows, sensing)


def differences(function, size: int, step: float) -> np.ndarray:
    """Central differences by every entry of a vector at zero, in a last axis."""
    out = []
    for k in range(size):
        dx = np.zeros(size)
        dx[k] = step
        out.append((function(dx) - function(-dx)) / (2.0 * step))
    return np.stack(out, axis=-1)

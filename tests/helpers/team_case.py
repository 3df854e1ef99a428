"""An exact recording of three robots, with its true unknowns, as the diagnosis takes it."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.interpolate import make_interp_spline

from discrepancy.team.linear.jacobian import BySignals
from discrepancy.team.linear.rows import Reduction
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.start import exact_residual
from discrepancy.team.linear.trial_linear import TrialLinear, linearise
from estimator.arrays import Array, inertia_parameters
from estimator.estimate.grasps import GraspEstimate
from estimator.rigid_team import Bases, Shared
from omnid_design import DESIGN
from recorded_team import COM, GRASPS, HOME, INERTIA, MASS, Carried, Sines, carry


def true_shared(robots=3) -> Shared:
    about_1 = INERTIA + MASS * (COM @ COM * np.eye(3) - np.outer(COM, COM))
    nothing = np.zeros((robots, robots))
    grasps = GraspEstimate(
        np.array([R for R, _ in GRASPS[:robots]]),
        np.array([p for _, p in GRASPS[:robots]]),
        np.zeros((6 * robots - 6, 6 * robots - 6)),
        nothing,
        nothing,
        np.zeros(robots),
        np.zeros(robots),
    )
    return Shared(grasps, np.concatenate([[MASS], MASS * COM, inertia_parameters(about_1)]))


def true_bases() -> Bases:
    """Every base is turned like its grasp at rest and stands below it."""
    R = np.array([R for R, _ in GRASPS])
    p = np.array([HOME + p_1i - R_1i @ HOME for R_1i, p_1i in GRASPS])
    return Bases(R, p)


@dataclass(frozen=True)
class Case:
    path: Sines
    squeeze: Sines
    carried: Carried
    signals: Signals
    shared: Shared
    bases: Bases
    reduction: Reduction
    linear: TrialLinear


@cache
def exact(duration_s=16.0, seed=4) -> Case:
    """Slow sines with the joints' full travel, forces between the robots on top."""
    rng = np.random.default_rng(seed)
    path = Sines.draw(rng, [0.06, 0.06, 0.06, 0.03, 0.03, 0.025], 3, 0.1, 0.5)
    squeeze = Sines.draw(rng, [2.0, 2.0, 2.0], 2, 0.1, 0.5)
    carried = carry(path, squeeze, duration_s)
    signals = Signals.of(carried.recording)
    shared, bases, reduction = true_shared(), true_bases(), Reduction.of(signals)
    return Case(
        path, squeeze, carried, signals, shared, bases, reduction,
        linearise(signals, shared, bases, DESIGN, reduction, full=True),
    )  # fmt: skip


def residual_of(case: Case, signals=None, shared=None, bases=None):
    """Rows of the full nonlinear residual."""
    return exact_residual(
        signals or case.signals, shared or case.shared, bases or case.bases, DESIGN, case.reduction
    )


def rate_of(x):
    """Rates of samples of such a recording, by a spline."""
    time = np.arange(len(x)) / RATE_HZ
    return make_interp_spline(time, x, k=5).derivative()(time)


RATE_HZ = 100.0
BLOCKS = (
    ((0, 1, 2, 6, 7, 8), 1e-7),
    ((3, 4, 5, 9, 10, 11), 1e-7),
    ((12, 13, 14), 2e-4),
    ((15, 16, 17), 2e-4),
)


def assert_close(got, expected, tolerance):
    """Rms of the difference against the rms of what is expected, channels of each unit together."""
    for block, floor in BLOCKS:
        if block[-1] >= got.shape[1]:
            continue
        block = list(block)
        size = np.sqrt(np.mean(expected[:, block] ** 2))
        apart = np.sqrt(np.mean((got[:, block] - expected[:, block]) ** 2))
        assert apart <= tolerance * size + floor, (block, apart, size)


def every_sample(J: BySignals) -> Array:
    """The derivative at every sample, shape (N, Q, C, s)."""
    return np.array([J.at(robot, slice(None), np.arange(J.samples)) for robot in range(len(J.knots))])

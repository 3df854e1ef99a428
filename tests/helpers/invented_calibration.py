"""A calibration of invented numbers: for what reads, writes and shows one without having to fit it."""

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.unit import COUNT, ArmUnit
from estimator.calibrate.calibration import CalibratedPayload, CalibratedTrial, Calibration
from estimator.calibrate.prior import Prior
from estimator.estimate.grasps import GraspEstimate
from estimator.rigid_team import Bases
from omnid_design import DESIGN

SHARES = {"phi_zero": 0.3, "rod_length": 0.2, "grasps": 0.33, "inertial_parameters": 0.25}
FREE = {"phi_zero": 0.05, "rod_length": 0.1, "grasps": 0.0, "inertial_parameters": 0.2}


def invented_calibration(robots: int = 3, seed: int = 0) -> Calibration:
    """Robots off by about their prior, known a hundred times better; one payload, three trials and a free one."""
    rng = np.random.default_rng(seed)
    prior = Prior()
    factor = prior.factor(robots, hold_scale=True)
    x = (factor @ rng.standard_normal(factor.shape[1])).reshape(robots, COUNT)
    covariance = 1e-4 * factor @ factor.T
    count = 6 * (robots - 1) + 10
    spread = 1e-4 * rng.standard_normal((count, count))
    shared = spread @ spread.T
    R = np.concatenate([np.eye(3)[None], Rotation.random(robots - 1, rng).as_matrix()])
    p = np.concatenate([np.zeros((1, 3)), rng.normal(0.0, 0.7, (robots - 1, 3))])
    none, each = np.full((robots, robots), np.nan), np.full(robots, np.nan)
    grasps = GraspEstimate(R, p, shared[:-10, :-10], none, none, each, each)
    parameters = np.array([11.6, 4.0, -6.0, 0.4, 4.5, 2.0, -0.1, 3.5, 0.2, 7.6])
    payload = CalibratedPayload("c", grasps, parameters, shared, 0.1 * rng.standard_normal(count))
    trials = []
    for k, kind in enumerate(("random", "periodic", "static")):
        yaw = np.r_[0.0, rng.uniform(-3, 3, robots - 1)]
        bases = Bases(
            Rotation.from_euler("z", yaw[:, None]).as_matrix(),
            np.concatenate([np.zeros((1, 3)), rng.normal(0.0, 1.0, (robots - 1, 3))]),
        )
        fits = [(a * 1.1**k, b * 1.1**k) for a, b in ((6e4, 9e3), (0.9, 1.0), (1.5, 1.1))]
        trials.append(CalibratedTrial(f"{kind}.parquet", kind, 0, 40.0, (1200, 600), *fits, bases, SHARES))
    trials.append(
        CalibratedTrial("free.parquet", "free", None, 30.0, (0, 900), None, (0.0, 1.02), None, None, FREE)
    )
    by_scale = np.zeros((robots, COUNT))
    by_scale[:] = 0.02 * rng.standard_normal((robots, COUNT)) * (x != 0)
    return Calibration(
        ArmUnit(DESIGN, x), covariance, by_scale, 0.0067, prior, (payload,), tuple(trials), (), 4,
        ("the payload slipped",), ("arm masses: record the robots with nothing in their hands",),
    )  # fmt: skip

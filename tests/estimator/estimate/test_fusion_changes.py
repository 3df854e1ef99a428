"""What errors of the grasps do to the fused motion and to the inertia, against central differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.inertia import by_upstream
from estimator.estimate.uncertainty import numerical_jacobian
from estimator.rigid_team import fuse, fusion_changes, fusion_matrix, fusion_with, inertia_regressor
from estimator.signals import GraspData

ROBOTS, SAMPLES = 4, 30
K = 6 * (ROBOTS - 1)


def grasps(linear: float = 0.05) -> GraspEstimate:
    rng = np.random.default_rng(1)
    R = Rotation.random(ROBOTS, rng=rng).as_matrix()
    p = rng.normal(0.0, 0.5, (ROBOTS, 3))
    R[0], p[0] = np.eye(3), 0.0
    rms = np.ones((ROBOTS, ROBOTS)) - np.eye(ROBOTS)
    motion = np.ones(ROBOTS)
    return GraspEstimate(R, p, np.eye(K), 0.03 * rms, linear * rms, motion, motion)


def motion(samples: int = SAMPLES) -> GraspData:
    rng = np.random.default_rng(2)
    R = Rotation.random(samples * ROBOTS, rng=rng).as_matrix().reshape(samples, ROBOTS, 3, 3)
    twist, twist_dot, wrench = rng.normal(size=(3, samples, ROBOTS, 6))
    return GraspData(np.arange(samples) / 100.0, R, R[..., 0], twist, twist_dot, wrench, 100.0, 9.81)


@pytest.mark.parametrize("linear", [0.05, 0.01])  # the weight changes with the grasps, or is at its bound
def test_changes_of_the_fused_motion(linear: float) -> None:
    data, held = motion(), grasps(linear)
    found = fusion_changes(data.twist, data.twist_dot, data.R_bi, data.wrench, held)

    def fused(x: np.ndarray) -> np.ndarray:
        moved = held.moved(x)
        twists = [part.reshape(SAMPLES, -1) @ fusion_matrix(moved).T for part in (data.twist, data.twist_dot)]
        body = fuse(data, moved)
        return np.concatenate([*twists, body.up, body.force, body.moment], axis=1)

    expected = numerical_jacobian(fused, np.zeros(K)).T.reshape(K, SAMPLES, -1)
    assert np.concatenate(found, axis=2) == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())


def test_changes_with_a_weight_that_is_held() -> None:
    data, held = motion(), grasps()
    found = fusion_changes(data.twist, data.twist_dot, data.R_bi, data.wrench, held, 2.5)
    expected = numerical_jacobian(
        lambda x: data.twist.reshape(SAMPLES, -1) @ fusion_with(held.moved(x), 2.5).T, np.zeros(K)
    )
    assert found.twist == pytest.approx(expected.T.reshape(K, SAMPLES, 6), abs=1e-7)


def test_inertia_by_errors_of_grasps_and_centre_of_mass() -> None:
    """Of data that fit no inertia: residuals count in the derivative, too."""
    rng = np.random.default_rng(3)
    held, p_1c, by_grasps = grasps(), np.array([0.1, -0.2, 0.3]), rng.normal(size=(3, K))
    data = [motion(200), motion(150)]
    found = by_upstream(data, held, p_1c, by_grasps)

    def parameters(x: np.ndarray) -> np.ndarray:
        bodies, centre = [fuse(one, held.moved(x[:K])) for one in data], p_1c + by_grasps @ x[:K] + x[K:]
        X = np.concatenate([inertia_regressor(body.omega, body.alpha) for body in bodies])
        y = np.concatenate([body.moment - np.cross(centre, body.force) for body in bodies])
        return np.linalg.lstsq(X.reshape(-1, 6), y.ravel(), rcond=None)[0]

    expected = numerical_jacobian(parameters, np.zeros(K + 3))
    assert found == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())

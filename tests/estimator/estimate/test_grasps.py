"""Grasp frames from twists: exact recovery, hard angles, Jacobians, pooling, independence of the numbering."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.estimate import grasps as module
from estimator.estimate.grasps import GraspEstimate, estimate_grasps, pair_position, pair_rotation
from estimator.estimate.inertia import by_upstream
from estimator.estimate.uncertainty import numerical_jacobian
from estimator.rigid_team import fuse, inertia_regressor
from estimator.signals import GraspData
from rigid_body_data import Body, make_body, moving

NOISE = {"twist_noise": 1e-3, "linear_noise": 2e-4}


def renumbered(data, order):
    return replace(data, R_bi=data.R_bi[:, order], twist=data.twist[:, order], p_bi=data.p_bi[:, order])


@pytest.mark.parametrize("N", [2, 3, 5])
def test_exact_data_give_exact_grasps(N):
    body = make_body(N, seed=N)
    estimate, reports = estimate_grasps([moving(body, 10)])
    assert estimate is not None
    assert len(reports) == 2 * (N - 1)
    np.testing.assert_allclose(estimate.R_1i, body.R_1i, atol=1e-12)
    np.testing.assert_allclose(estimate.p_1i, body.p_1i, atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, np.pi - 1e-4, np.pi - 1e-9, np.pi])
@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 0, 0), (0.6, -0.48, 0.64)])
def test_rotations_from_zero_to_pi(angle, axis):
    R_12 = Rotation.from_rotvec(angle * np.array(axis)).as_matrix()
    body = make_body(2)
    body = Body(body.mass, body.p_1c, body.inertia, np.stack([np.eye(3), R_12]), body.p_1i)
    data = moving(body, 5)
    direct = pair_rotation(data.twist[:, 0, :3], data.twist[:, 1, :3])
    refined, _ = estimate_grasps([data])
    assert refined is not None
    for R in (direct, refined.R_1i[1]):
        assert np.linalg.norm(R_12.T @ R - np.eye(3)) < 1e-12
    np.testing.assert_allclose(
        pair_position(data.twist[:, 0], data.twist[:, 1], direct), body.p_1i[1], atol=1e-12
    )


def test_planar_angular_velocities_give_a_rotation_and_not_a_reflection():
    rng = np.random.default_rng(0)
    omega_2 = rng.normal(size=(200, 3)) * [1, 1, 0]
    R = Rotation.from_rotvec([0.3, -2.0, 1.0]).as_matrix()
    noisy = omega_2 @ R.T + rng.normal(0, 0.05, (200, 3))
    estimate = pair_rotation(noisy, omega_2)
    assert np.linalg.det(estimate) == pytest.approx(1)
    assert Rotation.from_matrix(R.T @ estimate).magnitude() < 0.05


def test_loops_close_and_pairs_are_inverse():
    estimate, _ = estimate_grasps([moving(make_body(5), 20, **NOISE)])
    assert estimate is not None
    np.testing.assert_allclose(estimate.T(1, 2) @ estimate.T(2, 5) @ estimate.T(5, 1), np.eye(4), atol=1e-14)
    np.testing.assert_allclose(estimate.T(3, 2) @ estimate.T(2, 3), np.eye(4), atol=1e-14)
    pair = estimate.pair(2, 4)
    np.testing.assert_array_equal(pair.R_ij, estimate.T(2, 4)[:3, :3])
    np.testing.assert_array_equal(pair.p_ij, estimate.T(2, 4)[:3, 3])
    with pytest.raises(ValueError, match="robot 6"):
        estimate.T(1, 6)
    with pytest.raises(ValueError, match="robot 0"):
        estimate.pair(0, 1)


def test_renumbering_the_robots_changes_nothing():
    data = moving(make_body(3), 20, **NOISE)
    a, _ = estimate_grasps([data])
    b, _ = estimate_grasps([renumbered(data, [2, 0, 1])])  # old 3, 1, 2 are new 1, 2, 3
    assert a is not None
    assert b is not None
    np.testing.assert_allclose(b.T(2, 3), a.T(1, 2), atol=1e-9)
    np.testing.assert_allclose(b.T(1, 3), a.T(3, 2), atol=1e-9)
    np.testing.assert_allclose(b.pair(2, 3).covariance, a.pair(1, 2).covariance, rtol=1e-3, atol=1e-12)


def test_pooling_trials_equals_one_long_trial():
    body = make_body(3)
    trials = [moving(body, 20, seed=k, **NOISE) for k in (1, 2)]
    fields = ("time", "R_bi", "p_bi", "twist", "twist_dot", "wrench")
    both = replace(trials[0], **{f: np.concatenate([getattr(t, f) for t in trials]) for f in fields})
    a, _ = estimate_grasps(trials)
    b, _ = estimate_grasps([both])
    assert a is not None
    assert b is not None
    np.testing.assert_allclose(a.R_1i, b.R_1i, atol=1e-10)
    np.testing.assert_allclose(a.p_1i, b.p_1i, atol=1e-10)


def test_refinement_uses_what_the_pair_alone_does_not():
    body, refined_error, pair_error = make_body(3), [], []
    exact = moving(body, 10)
    for seed in range(30):
        rng = np.random.default_rng(seed)
        noisy = exact.twist + rng.normal(0, [0.02] * 3 + [0.002] * 3, exact.twist.shape)
        data = replace(exact, twist=noisy)
        R = pair_rotation(noisy[:, 0, :3], noisy[:, 1, :3])
        pair_error.append(pair_position(noisy[:, 0], noisy[:, 1], R) - body.p_1i[1])
        estimate, _ = estimate_grasps([data])
        assert estimate is not None
        refined_error.append(estimate.p_1i[1] - body.p_1i[1])
    assert np.sqrt(np.mean(np.square(refined_error))) < 0.8 * np.sqrt(np.mean(np.square(pair_error)))


def test_residual_jacobian_against_finite_differences():
    rng = np.random.default_rng(3)
    N = 4
    V = rng.normal(size=(7, N, 6))
    R = Rotation.random(N, rng=rng).as_matrix()
    p = rng.normal(size=(N, 3))
    R[0], p[0] = np.eye(3), 0.0
    J = module._jacobian(V, R, p)
    h = 1e-6
    for k, d in enumerate(h * np.eye(6 * (N - 1))):
        sides = []
        for x in (d, -d):
            x = x.reshape(-1, 6)
            moved_R = np.concatenate([R[:1], Rotation.from_rotvec(x[:, :3]).as_matrix() @ R[1:]])
            sides.append(module._residuals(V, moved_R, np.concatenate([p[:1], p[1:] + x[:, 3:]])))
        np.testing.assert_allclose(J[..., k], (sides[0] - sides[1]) / (2 * h), atol=1e-8)


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


def test_inertia_by_errors_of_grasps_and_centre_of_mass() -> None:
    """Where data fit no inertia, residuals count in the derivative, too."""
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

"""Planar poses and planned motion, against scipy's transforms, the matrix exponential and numerical derivatives."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import RigidTransform, Rotation

from estimator.errors import InputError
from mocobot_sim.trial.trajectories import (
    Leg,
    PlanarMotion,
    carried,
    compose,
    moved,
    plan,
    relative,
    wrapped,
    yaw_of,
)


def _transform(pose: np.ndarray) -> RigidTransform:
    return RigidTransform.from_components([*pose[:2], 0.0], Rotation.from_euler("z", pose[2]))


def _matrix(pose: np.ndarray) -> np.ndarray:
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return np.array([[cos, -sin, pose[0]], [sin, cos, pose[1]], [0.0, 0.0, 1.0]])


@pytest.fixture
def poses() -> np.ndarray:
    return np.random.default_rng(2).uniform(-3.0, 3.0, (30, 2, 3))


def test_composing_and_seen_from(poses):
    for a, b in poses:
        joined = _transform(a) * _transform(b)
        ours = compose(a, b)
        np.testing.assert_allclose(ours[:2], joined.translation[:2], atol=1e-13)
        np.testing.assert_allclose(wrapped(ours[2] - joined.rotation.as_euler("zyx")[0]), 0.0, atol=1e-13)
        seen = relative(a, b)
        np.testing.assert_allclose(
            seen[:2], (_transform(a).inv() * _transform(b)).translation[:2], atol=1e-13
        )
        np.testing.assert_allclose(compose(a, seen)[:2], b[:2], atol=1e-13)
    np.testing.assert_allclose(compose(poses[:, 0], poses[:, 1])[7], compose(*poses[7]), atol=1e-14)


def test_odometry_is_the_exponential_of_the_twist(poses):
    for pose, step in poses:
        twist = np.array([[0.0, -step[0], step[1]], [step[0], 0.0, step[2]], [0.0, 0.0, 0.0]])
        np.testing.assert_allclose(_matrix(moved(pose, step)), _matrix(pose) @ expm(twist), atol=1e-12)
    # Without turning it is a straight line, where the formula has 0 / 0.
    np.testing.assert_allclose(
        moved([1.0, 2.0, np.pi / 2], [0.0, 0.3, 0.1]), [0.9, 2.3, np.pi / 2], atol=1e-15
    )


def test_angles_are_wrapped_and_read_off_rotations():
    angles = np.array([-7.0, -np.pi, 0.0, 3.0, 4.0, 100.0])
    np.testing.assert_allclose(np.exp(1j * wrapped(angles)), np.exp(1j * angles), atol=1e-13)
    assert (np.abs(wrapped(angles)) <= np.pi).all()
    tilted = Rotation.from_euler("ZYX", [[0.7, 0.1, -0.2], [-2.0, 0.0, 0.3]])
    np.testing.assert_allclose(yaw_of(tilted.as_matrix()), [0.7, -2.0], atol=1e-14)


@pytest.fixture(scope="module")
def motion() -> PlanarMotion:
    return plan(
        (0.1, -0.2, 0.3), [Leg((0.5, 0.4, 0.3), 2.0, 0.5), Leg((0.2, 0.4, 1.5), 1.5, 0.25)], rest_s=0.25
    )


def _body_twist(pose: np.ndarray, rate_hz: float) -> np.ndarray:
    """By central differences of the matrices: X^-1 dX/dt."""
    X = np.array([_matrix(p) for p in pose])
    hat = np.linalg.inv(X[1:-1]) @ (X[2:] - X[:-2]) * rate_hz / 2.0
    return np.stack([hat[:, 1, 0], hat[:, 0, 2], hat[:, 1, 2]], axis=1)


def test_a_plan_goes_where_it_should_and_its_twists_are_its_derivative(motion):
    assert motion.duration_s == pytest.approx(4.5)
    at = lambda t: motion.pose[round(t * motion.rate_hz), 0]  # noqa: E731
    for t, pose in ((0.0, (0.1, -0.2, 0.3)), (0.25, (0.1, -0.2, 0.3)), (1.25, (0.3, 0.1, 0.3)), (2.25, (0.5, 0.4, 0.3)),
                    (2.75, (0.5, 0.4, 0.3)), (4.25, (0.2, 0.4, 1.5)), (4.5, (0.2, 0.4, 1.5))):  # fmt: skip
        np.testing.assert_allclose(at(t), pose, atol=1e-12)
    np.testing.assert_allclose(
        motion.twist[1:-1, 0], _body_twist(motion.pose[:, 0], motion.rate_hz), atol=2e-5
    )
    # Rest to rest, without a jump.
    assert np.abs(np.diff(motion.twist[:, 0], axis=0)).max() < 5e-3
    np.testing.assert_array_equal(motion.twist[[0, -1]], 0.0)


def test_bases_stay_under_the_frame_that_they_carry(motion):
    places = np.array([[1.0, 0.0, 0.0], [0.3, -0.8, 2.0], [-0.5, 0.5, -1.5]])
    bases = carried(motion, places)
    np.testing.assert_allclose(bases.pose[0], places, atol=1e-14)
    for i in range(3):
        held = relative(motion.pose[:, 0], bases.pose[:, i])
        np.testing.assert_allclose(held, np.broadcast_to(held[0], held.shape), atol=1e-12)
        np.testing.assert_allclose(
            bases.twist[1:-1, i], _body_twist(bases.pose[:, i], motion.rate_hz), atol=5e-5
        )


NAN = float("nan")
BAD = {
    "no legs": ([], 0.0, "no legs"),
    "nan": ([Leg((0.0, NAN, 0.0), 1.0)], 0.0, "not x, y and yaw, all finite"),
    "two numbers": ([Leg((0.0, 1.0), 1.0)], 0.0, "not x, y and yaw"),
    "no time": ([Leg((0.0, 1.0, 0.0), 0.0)], 0.0, "must last longer than 0 s"),
    "back in time": ([Leg((0.0, 1.0, 0.0), 1.0, -1.0)], 0.0, "rest 0 s or more"),
    "nan time": ([Leg((0.0, 1.0, 0.0), NAN)], 0.0, "must last longer than 0 s"),
    "rest": ([Leg((0.0, 1.0, 0.0), 1.0)], -1.0, "rest 0 s or more"),
    "for ever": ([Leg((0.0, 1.0, 0.0), 4000.0)], 0.0, "lasts 4000 s; it may last 3600 s"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_plan_that_cannot_be_is_refused(case):
    legs, rest_s, sentence = BAD[case]
    with pytest.raises(InputError, match=sentence):
        plan((0.0, 0.0, 0.0), legs, rest_s)

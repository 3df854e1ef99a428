"""Two bodies on a joint against MuJoCo's kinematics and inverse dynamics."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from estimator.errors import InputError
from estimator.two_bodies.estimate import estimate_two_bodies
from estimator.two_bodies.relative import relative_motion
from estimator.two_bodies.result import TwoBodies as Found
from estimator.two_bodies.result import format_two_bodies
from synthetic_team import with_noise
from two_body_team import TwoBodies, carried

HINGE = TwoBodies(damping=0.5)
SLIDE = TwoBodies("slide", axis=(0.95, 0.25, 0.19), damping=4.0)
SPRING = TwoBodies(axis=(0.3, 0.7, 0.65), damping=1.0, stiffness=70.0, rest=0.02)
ROUND = 6e-6, 0.01  # noise of the angles [rad] and torques [N m]


def read(bodies: TwoBodies, seed: int, rms: float, duration_s: float = 25.0):
    rng = np.random.default_rng(seed)
    return with_noise(carried(bodies, rng, duration_s, joint_rms=rms), *ROUND, rng)


@pytest.fixture(scope="module")
def spring() -> Found:
    return estimate_two_bodies([read(SPRING, 4, 0.04)])


@pytest.mark.parametrize(
    ("bodies", "motion", "rms"),
    [(HINGE, "hinged", 0.05), (SLIDE, "sliding", 0.025), (TwoBodies("weld"), "rigid", 0.0)],
)
def test_the_motion_and_who_holds_what(bodies, motion, rms):
    best, second, *_ = relative_motion([read(bodies, 1, rms)], ("rigid", "hinged", "sliding"))
    assert best.motion == motion
    assert best.log_evidence > second.log_evidence + 5.0
    assert 0.8 < best.noise < 1.2
    if motion == "rigid":
        return
    assert best.halves == ((1,), (2, 3))
    axis = np.array(bodies.axis) / np.linalg.norm(bodies.axis)
    assert best.axis is not None
    assert np.arccos(min(1.0, best.axis @ axis)) < 5.0 * best.axis_se_rad < 1e-3
    assert best.q_rms == pytest.approx(rms, rel=0.2)
    if best.pivot is not None:
        off = np.linalg.norm(np.cross(axis, best.pivot - bodies.pivot))
        assert off < 5.0 * best.pivot_se_m < 1e-3


def test_four_robots_hold_two_each():
    bodies = replace(
        HINGE, axis=(0.06, 0.99, 0.05), pivot=(0.565, 0.4, 0.079), halves=((0, 1), (2, 3)),
        grasps=((0, 0, 0, 0), (0.06, 0.82, 0, -90), (1.12, 0.78, 0, 180), (1.07, -0.06, 0, 90)),
    )  # fmt: skip
    best = relative_motion([read(bodies, 3, 0.05)], ("hinged",))[0]
    assert best.halves == ((1, 2), (3, 4))
    axis = np.array(bodies.axis) / np.linalg.norm(bodies.axis)
    assert best.axis is not None
    assert np.linalg.norm(np.cross(best.axis, axis)) < 5.0 * best.axis_se_rad


def error_of(found: Found, bodies: TwoBodies) -> np.ndarray:
    return found.parameters - found.true_parameters(bodies.truth)


@pytest.mark.parametrize(("bodies", "kind", "rms"), [(HINGE, "hinged", 0.05), (SLIDE, "sliding", 0.025)])
def test_without_noise_the_parameters_are_those_of_mujoco(bodies, kind, rms):
    rng = np.random.default_rng(2)
    recording = with_noise(carried(bodies, rng, 25.0, joint_rms=rms), 1e-9, 1e-6, rng)
    found = estimate_two_bodies([recording], kind)
    assert found.kind == kind
    scale = np.maximum(np.abs(found.true_parameters(bodies.truth)), 0.1)
    assert np.all(np.abs(error_of(found, bodies)) < 3e-3 * scale)
    assert found.whole[0].mass == pytest.approx(bodies.mass_A + bodies.mass_B, rel=1e-5)


def test_a_spring_is_found_with_its_rest(spring):
    assert spring.kind == "flexible"
    stiffness, se = spring.value("stiffness")
    assert stiffness == pytest.approx(SPRING.stiffness, abs=5.0 * se)
    error = error_of(spring, SPRING)
    assert np.all(np.abs(error) < 5.0 * np.sqrt(np.diag(spring.covariance)))


def test_the_split_is_of_real_bodies_that_need_the_same_forces(spring):
    """Any split of what the joint hides must move alike: MuJoCo is asked."""
    assert spring.bodies is not None
    A, B, (low, high) = spring.bodies
    assert low < B.mass < high
    assert low < SPRING.mass_B < high
    for body in (A, B):
        moments = np.linalg.eigvalsh(body.inertia)
        assert moments[0] > 0
        assert moments[2] < moments[0] + moments[1]
    # At the estimate's joint zero B is turned by q, so A and B are put on a joint with its axis and pivot there.
    q = -spring.joint.coordinates(np.eye(3)[None], np.array([SPRING.grasps[1][:3]]))[0][0]
    turn = Rotation.from_rotvec(q * spring.axes[:, 0]).as_matrix()
    at_zero = spring.pivot + turn.T @ (B.com - spring.pivot)
    other = replace(
        SPRING, mass_A=A.mass, com_A=tuple(A.com), I_A=A.inertia, mass_B=B.mass, com_B=tuple(at_zero),
        I_B=turn.T @ B.inertia @ turn,
    )  # fmt: skip
    rng = np.random.default_rng(5)
    qpos, qvel, qacc = rng.normal(size=(20, 8)), rng.normal(size=(20, 7)), rng.normal(size=(20, 7))
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    apart = SPRING.needed(qpos, qvel, qacc) - other.needed(qpos, qvel, qacc)
    assert np.abs(apart).max() < 0.1  # of 100 N
    moved = replace(other, mass_B=B.mass + 0.1).needed(qpos, qvel, qacc) - SPRING.needed(qpos, qvel, qacc)
    assert np.abs(moved).max() > 0.5


@pytest.mark.slow
def test_errors_are_as_the_covariance_says():
    rng = np.random.default_rng(6)
    exact = carried(HINGE, rng, 20.0, joint_rms=0.05)
    nees, count = 0.0, 0
    for _ in range(8):
        found = estimate_two_bodies([with_noise(exact, *ROUND, rng)], "hinged")
        error = error_of(found, HINGE)
        nees, count = nees + error @ np.linalg.solve(found.covariance, error), count + len(error)
    low, high = chi2.ppf([0.0005, 0.9995], count)
    assert low < nees < high


def test_a_joint_that_hardly_moves_is_refused():
    with pytest.raises(InputError, match="halves hardly move against each other"):
        estimate_two_bodies([read(HINGE, 7, 1e-7)], "hinged")


def test_halves_must_divide_the_robots():
    with pytest.raises(InputError, match="must divide robots 1 to 3"):
        relative_motion([read(HINGE, 7, 0.05, 15.0)], ("hinged",), ((1,), (2,)))


def test_json_keeps_everything(spring):
    values = spring.to_dict()
    again = Found.from_dict(values)
    assert again.names == spring.names
    np.testing.assert_array_equal(again.covariance, spring.covariance)
    np.testing.assert_allclose(again.R_0, spring.R_0, atol=1e-12)
    assert format_two_bodies(again) == format_two_bodies(spring)
    assert "(true 70.0" in format_two_bodies(spring, SPRING.truth)
    with pytest.raises(InputError, match="version 1"):
        Found.from_dict(values | {"version": 2})

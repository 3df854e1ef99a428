"""Commanded wrist positions against what the paper says of them; planar plans against independent formulas."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from closed_loop import in_world
from estimator.errors import InputError
from mocobot_sim.scene.scene import TeamScene, build_team
from mocobot_sim.trial.trajectories import (
    SETTLE_S,
    Leg,
    PlanarMotion,
    Trajectory,
    carried,
    moved,
    plan,
    random_vias,
    relative,
    sphere_motion,
    static_orientations,
)

SHIPPED = ["a", "b", "c", "d"]
HOME = np.array([0.0, 0.0, 0.355])


@pytest.fixture(scope="module")
def shipped() -> dict[str, TeamScene]:
    return {name: build_team(name) for name in SHIPPED}


@pytest.fixture(scope="module")
def vias(shipped) -> Trajectory:
    return random_vias(shipped["a"].wrist_home_b, np.random.default_rng(1))


def _moves(path: np.ndarray) -> list[tuple[int, int]]:
    """First and last sample of each stretch where the command changes; dwells repeat it bit for bit."""
    moving = np.concatenate([[False], np.any(np.diff(path, axis=0) != 0, axis=1), [False]])
    edges = np.flatnonzero(np.diff(moving.astype(int)))
    return list(zip(edges[::2], edges[1::2], strict=True))


def test_eighty_straight_transits_with_dwells(vias):
    assert vias.trial == "random"
    dwells, transits, points = [], [], []
    for i in range(3):
        path = vias.ref_b[:, i]
        moves = _moves(path)
        assert len(moves) == 81, "80 vias, then home"
        assert abs(moves[0][0] / 100 - SETTLE_S) < 0.025
        # The ends of a minimum-jerk move are flat: rounding to bits and to samples shortens it slightly.
        transits += [(stop - start) / 100 for start, stop in moves]
        dwells += [(moves[k + 1][0] - moves[k][1]) / 100 for k in range(80)]
        for start, stop in moves:
            segment = path[start : stop + 1] - path[start]
            direction = segment[-1] / np.linalg.norm(segment[-1])
            along = segment @ direction
            assert np.abs(segment - along[:, None] * direction).max() < 1e-14
            assert np.all(np.diff(along) > -1e-16)
            points.append(path[stop])
        np.testing.assert_array_equal(path[0], [0, 0, 0.355])
        np.testing.assert_array_equal(path[-1], [0, 0, 0.355])
    assert len(transits) == 243
    assert len(dwells) == 240
    for durations in (transits, dwells):
        assert min(durations) > 0.475
        assert max(durations) < 0.825
        assert np.ptp(durations) > 0.25
        assert abs(np.mean(durations) - 0.65) < 0.03
    offsets = np.array(points).reshape(3, 81, 3)[:, :80] - HOME
    assert np.all(np.abs(offsets) <= [0.060, 0.060, 0.037])
    assert np.all(np.abs(offsets).max(axis=1) > 0.9 * np.array([0.060, 0.060, 0.037]))
    flat = offsets.transpose(1, 0, 2).reshape(80, 9)
    assert np.abs(np.corrcoef(flat.T) - np.eye(9)).max() < 0.4, "robots and axes move independently"
    assert vias.duration_s == (len(vias.ref_b) - 1) / 100
    assert not np.any(np.diff(vias.ref_b[-round(SETTLE_S * 100) :], axis=0)), "at rest at the end"


def test_same_seed_same_bits(shipped):
    scene = shipped["d"]

    def make(seed):
        rng = np.random.default_rng(seed)
        return random_vias(scene.wrist_home_b, rng, 5), sphere_motion(scene.wrist_home_b, scene.X_1i, 10, rng)

    for one, two, other in zip(make(4), make(4), make(5), strict=True):
        np.testing.assert_array_equal(one.ref_b, two.ref_b)
        assert one.ref_b.shape != other.ref_b.shape or np.any(one.ref_b != other.ref_b)


@pytest.mark.parametrize("name", SHIPPED)
def test_the_papers_trials_stay_in_the_workspace_and_move_gently(shipped, name):
    scene = shipped[name]
    for seed in range(5):
        rng = np.random.default_rng(seed)
        trajectories = [
            random_vias(scene.wrist_home_b, rng),
            sphere_motion(scene.wrist_home_b, scene.X_1i, 60.0, rng),
            static_orientations(scene.wrist_home_b, scene.X_1i),
        ]
        for trajectory in trajectories:
            reach = np.linalg.norm(trajectory.ref_b - HOME, axis=-1)
            assert reach.max() < 0.13, trajectory.trial
            assert reach.max() > 0.05, "uses the workspace"
            np.testing.assert_array_equal(trajectory.ref_b[0], scene.wrist_home_b)
            np.testing.assert_array_equal(trajectory.ref_b[-1], scene.wrist_home_b)
            speed = np.linalg.norm(np.diff(trajectory.ref_b, axis=0), axis=-1) * 100
            assert speed.max() < 0.75, trajectory.trial


def _equidistant(points: np.ndarray) -> np.ndarray:
    """Point in the plane of three points at one distance from all: |x - a|^2 = |x - b|^2 is linear in x."""
    a, b, c = points
    rows = np.array([b - a, c - a, np.cross(b - a, c - a)])
    right = [(b @ b - a @ a) / 2, (c @ c - a @ a) / 2, rows[2] @ a]
    return np.linalg.solve(rows, right)


def _worn_by_a_rigid_body(world: np.ndarray) -> None:
    start = world[0]
    gaps = np.linalg.norm(world[:, :, None] - world[:, None], axis=-1)
    np.testing.assert_allclose(gaps, np.broadcast_to(gaps[0], gaps.shape), rtol=0, atol=1e-12)
    if world.shape[1] > 3:
        for now in world[:: len(world) // 20]:  # not mirrored
            _, error = Rotation.align_vectors(now - now.mean(0), start - start.mean(0))
            assert error < 1e-6


@pytest.mark.parametrize("name", SHIPPED)
def test_periodic_wrists_share_a_sphere_and_fit_the_payload(shipped, name):
    scene = shipped[name]
    motion = sphere_motion(scene.wrist_home_b, scene.X_1i, 20.0, np.random.default_rng(0))
    assert motion.trial == "periodic"
    world = in_world(scene, motion.ref_b)
    lift = world[0, 0, 2]
    np.testing.assert_allclose(world[0] - [0, 0, lift], scene.X_1i.translation, rtol=0, atol=1e-12)
    centre = _equidistant(scene.X_1i.translation) + np.array([0, 0, lift])
    radius = np.linalg.norm(world - centre, axis=-1)
    np.testing.assert_allclose(radius, radius[0, 0], rtol=0, atol=1e-12)
    _worn_by_a_rigid_body(world)
    assert np.ptp(world, axis=0).max(axis=1).min() > 0.03, "every wrist moves"


def test_periodic_rotation_has_the_amplitude_and_frequencies_asked_for(shipped):
    scene = shipped["a"]
    motion = sphere_motion(
        scene.wrist_home_b, scene.X_1i, 60.0, amplitude_rad=0.02, frequency_hz=(0.3, 0.5, 0.8)
    )
    world = in_world(scene, motion.ref_b)
    arms = world - _equidistant(world[0])
    rotvec = np.array([Rotation.align_vectors(now, arms[0])[0].as_rotvec() for now in arms])
    middle = slice(
        round((SETTLE_S + 10) * 100), round((SETTLE_S + 50) * 100)
    )  # 40 s: whole cycles of all three
    spectrum = np.abs(np.fft.rfft(rotvec[middle], axis=0)) / 2000
    np.testing.assert_array_equal(spectrum.argmax(axis=0) / 40.0, [0.3, 0.5, 0.8])
    np.testing.assert_allclose(spectrum.max(axis=0), 0.02, rtol=1e-6)
    still = round(SETTLE_S * 100)
    np.testing.assert_array_equal(motion.ref_b[: still + 1], np.tile(scene.wrist_home_b, (still + 1, 1, 1)))
    assert motion.duration_s == 60.0 + 2 * SETTLE_S


@pytest.mark.parametrize("name", SHIPPED)
def test_six_distinct_still_orientations(shipped, name):
    scene = shipped[name]
    motion = static_orientations(scene.wrist_home_b, scene.X_1i)
    assert motion.trial == "static"
    still = ~np.any(np.diff(motion.ref_b, axis=0) != 0, axis=(1, 2))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    holds = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 50]
    assert len(holds) == 8, "home, six orientations, home"
    world = in_world(scene, motion.ref_b)
    normal = []
    for start, stop in holds[1:-1]:
        assert (stop - start) / 100 > 9.9
        arms = world[start] - world[start].mean(axis=0)
        R, error = Rotation.align_vectors(arms, world[0] - world[0].mean(axis=0))
        assert error < 1e-6
        assert abs(R.magnitude() - np.deg2rad(7.0)) < 1e-9
        normal.append(R.apply([0, 0, 1]))
    angles = np.rad2deg(np.arccos(np.clip(np.array(normal) @ np.array(normal).T, -1, 1)))
    # Six points on a circle of 7 deg: neighbours 7 deg apart (chords on the sphere), opposites 14.
    np.testing.assert_allclose(angles[0], [0, 7, 12.1, 14, 12.1, 7], atol=0.06)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda home, X: random_vias(home, np.random.default_rng(0), 0), "vias is 0; it must be at least 1"),
        (
            lambda home, X: random_vias(home, np.random.default_rng(0), 10**9),
            "vias is 1000000000; that many could last longer than 3600 s",
        ),
        (lambda home, X: random_vias(home, np.random.default_rng(0), 2, transit_s=(0, 1)), "transit is"),
        (lambda home, X: sphere_motion(home, X, 3.9), "duration is 3.9 s; it must be at least 4 s"),
        (lambda home, X: sphere_motion(home, X, float("nan")), "duration is nan s"),
        (lambda home, X: sphere_motion(home, X, float("inf")), "duration is inf s"),
        (lambda home, X: sphere_motion(home, X, 1e9), "at least 4 s and at most 3600 s"),
        (lambda home, X: static_orientations(home, X, 0), "orientations is 0; it must be at least 1"),
    ],
)
def test_bad_arguments_are_named(shipped, make, sentence):
    with pytest.raises(InputError, match=sentence):
        make(shipped["a"].wrist_home_b, shipped["a"].X_1i)


@pytest.mark.parametrize("motion", [sphere_motion, static_orientations])
def test_one_robot_cannot_turn_a_payload_about_a_point(motion, teams):
    with pytest.raises(InputError, match="two or more"):
        motion(teams[1].wrist_home_b, teams[1].X_1i)


def _matrix(pose: np.ndarray) -> np.ndarray:
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return np.array([[cos, -sin, pose[0]], [sin, cos, pose[1]], [0.0, 0.0, 1.0]])


@pytest.fixture
def poses() -> np.ndarray:
    return np.random.default_rng(2).uniform(-3.0, 3.0, (30, 2, 3))


def test_odometry_is_the_exponential_of_the_twist(poses):
    for pose, step in poses:
        twist = np.array([[0.0, -step[0], step[1]], [step[0], 0.0, step[2]], [0.0, 0.0, 0.0]])
        np.testing.assert_allclose(_matrix(moved(pose, step)), _matrix(pose) @ expm(twist), atol=1e-12)
    # Without turning it is a straight line, where the formula has 0 / 0.
    np.testing.assert_allclose(
        moved([1.0, 2.0, np.pi / 2], [0.0, 0.3, 0.1]), [0.9, 2.3, np.pi / 2], atol=1e-15
    )


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

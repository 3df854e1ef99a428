"""Every body of a replay is where MuJoCo's forward solution of the closed chains has it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from mocobot_sim.scene.scene import TeamScene
from mocobot_view.payload import Grasps, payload_motion, place_bases
from mocobot_view.replay_trial import ReplayTrial, replay_trial
from mocobot_view.stream import save_replay
from replay_case import BODIES, Placed, Replayed, payload_body, placed_trial, robot_body, true_estimate

ENCODER_RAD = np.pi / 2**16
"""Largest error of a 16-bit encoder."""


@pytest.fixture(scope="module")
def placed_a(team_a: TeamScene) -> Placed:
    return placed_trial(team_a)


def replayed(placed: Placed, folder: Path, preset: str = "ideal") -> tuple[ReplayTrial, Replayed]:
    trial = replay_trial(placed.recording(preset), "trial", true_estimate(placed.scene))
    save_replay([trial], folder / "out.rrd")
    return trial, Replayed(folder / "out.rrd")


def errors(ours: RigidTransform, mujoco: RigidTransform) -> tuple[float, float]:
    """Largest distance [m] and angle [rad]."""
    assert len(ours) == len(mujoco) > 300
    apart = ours.inv() * mujoco
    return float(np.linalg.norm(apart.translation, axis=1).max()), float(apart.rotation.magnitude().max())


def check_all(placed: Placed, file: Replayed, distance_m: float, angle_rad: float) -> None:
    samples = len(placed.log.time)
    moved = []
    for robot in range(1, placed.scene.robots + 1):
        for body in BODIES:
            true = robot_body(placed, robot, body)
            moved.append(np.ptp(true.translation, axis=0).max() + true.rotation.magnitude().std())
            distance, angle = errors(file.pose(placed.entity(robot, body), samples), true)
            assert distance < distance_m, (robot, body)
            assert angle < angle_rad, (robot, body)
    assert np.sort(moved)[-9 * placed.scene.robots] > 2e-3, "the bodies moved"
    distance, angle = errors(file.pose("trial/payload", samples), payload_body(placed))
    assert distance < distance_m
    assert angle < angle_rad


def test_bodies_agree_with_mujoco(placed_a: Placed, tmp_path: Path) -> None:
    """As far as MuJoCo's own rods and welds stay closed, and single precision goes."""
    check_all(placed_a, replayed(placed_a, tmp_path)[1], 2e-6, 5e-6)


def test_bodies_agree_to_encoder_accuracy(placed_a: Placed, tmp_path: Path) -> None:
    """A driven angle's error moves the wrist by up to 0.205 m/rad per leg, and the payload turns about its grasps."""
    trial, file = replayed(placed_a, tmp_path, "nominal")
    check_all(placed_a, file, 2.0 * ENCODER_RAD, 5.0 * ENCODER_RAD)
    assert trial.motion is not None
    assert 1e-6 < trial.motion.gap_position_m.max() < 2.0 * ENCODER_RAD


@pytest.mark.slow
@pytest.mark.parametrize("robots", [1, 2, 5])
def test_any_number_of_robots(teams: dict[int, TeamScene], tmp_path: Path, robots: int) -> None:
    placed = placed_trial(teams[robots], vias=1)
    check_all(placed, replayed(placed, tmp_path)[1], 2e-5, 2e-5)


def test_bases_stand_where_the_robots_were_parked(placed_a: Placed, tmp_path: Path) -> None:
    trial, _ = replayed(placed_a, tmp_path)
    scene = placed_a.scene
    assert trial.bases.p_Wb == pytest.approx(scene.X_Wb.translation, abs=1e-6)
    assert trial.bases.R_Wb == pytest.approx(scene.X_Wb.rotation.as_matrix(), abs=1e-6)
    assert trial.motion is not None
    assert trial.motion.gap_position_m.max() < 2e-6
    assert trial.motion.gap_rotation_rad.max() < 1e-6


def held(rng: np.random.Generator, bases: int, samples: int = 40) -> tuple[RigidTransform, ...]:
    """X_1i, X_Wb and X_bi (as Q x N transforms) of a payload that moves at random in random, level bases."""
    X_1i = RigidTransform.from_components(
        rng.normal(size=(bases, 3)), Rotation.from_rotvec(rng.normal(0, 0.1, (bases, 3)))
    )
    X_1i = X_1i[0].inv() * X_1i
    X_W1 = RigidTransform.from_components(
        rng.normal(0, 0.05, (samples, 3)), Rotation.from_rotvec(rng.normal(0, 0.1, (samples, 3)))
    )
    yaw = Rotation.from_rotvec(np.outer([0.0, *rng.uniform(-3, 3, bases - 1)], [0.0, 0.0, 1.0]))
    place = np.concatenate([[[0.0, 0.0, 0.4]], rng.normal(size=(bases - 1, 3))])  # {b1} is the world's
    X_Wb = RigidTransform.from_components(place, yaw)
    return X_1i, X_Wb, X_W1


def in_bases(
    X_1i: RigidTransform, X_Wb: RigidTransform, X_W1: RigidTransform
) -> tuple[np.ndarray, np.ndarray]:
    X_bi = [X_Wb[i].inv() * X_W1 * X_1i[i] for i in range(len(X_1i))]
    return (
        np.stack([X.rotation.as_matrix() for X in X_bi], axis=1),
        np.stack([X.translation for X in X_bi], axis=1),
    )


def test_placement_of_made_up_motion() -> None:
    X_1i, X_Wb, X_W1 = held(np.random.default_rng(2), 4)
    R_bi, p_bi = in_bases(X_1i, X_Wb, X_W1)
    grasps = Grasps(X_1i.rotation.as_matrix(), X_1i.translation)
    bases = place_bases(R_bi, p_bi, grasps, 0.4)
    assert bases.p_Wb == pytest.approx(X_Wb.translation, abs=1e-12)
    assert bases.R_Wb == pytest.approx(X_Wb.rotation.as_matrix(), abs=1e-12)
    motion = payload_motion(R_bi, p_bi, grasps, bases)
    np.testing.assert_allclose(motion.R_W1, X_W1.rotation.as_matrix(), atol=1e-12)
    assert motion.p_W1 == pytest.approx(X_W1.translation, abs=1e-12)
    assert motion.gap_position_m.max() < 1e-12


def test_gaps_show_which_robot_let_go() -> None:
    """One of four shifts by 4 mm at one instant: the payload goes a quarter with it, the others stay."""
    X_1i, X_Wb, X_W1 = held(np.random.default_rng(3), 4)
    R_bi, p_bi = in_bases(X_1i, X_Wb, X_W1)
    grasps = Grasps(X_1i.rotation.as_matrix(), X_1i.translation)
    bases = place_bases(R_bi, p_bi, grasps, 0.4)
    p_bi[7, 2] += [4e-3, 0.0, 0.0]
    motion = payload_motion(R_bi, p_bi, grasps, bases)
    assert motion.gap_position_m[7] == pytest.approx([1e-3, 1e-3, 3e-3, 1e-3], rel=1e-9)
    turned = Rotation.from_rotvec([0.0, 0.02, 0.0]).as_matrix()
    R_bi[9, 0] = turned @ R_bi[9, 0]
    motion = payload_motion(R_bi, p_bi, grasps, bases)
    assert motion.gap_rotation_rad[9, 0] == pytest.approx(0.015, rel=1e-3)
    assert motion.gap_rotation_rad[9, 1:] == pytest.approx(0.005, rel=1e-3)
    assert np.delete(motion.gap_rotation_rad, 9, axis=0).max() < 1e-9

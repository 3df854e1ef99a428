"""Teams on their wheels: at rest, carrying a payload by driving, following it."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.errors import InputError
from mocobot_sim.base.design import base_design
from mocobot_sim.base.drive import BaseDrive, FollowingDrive, Snapshots
from mocobot_sim.guided import FLOAT_GAINS, FloatArms, PushingHand
from mocobot_sim.scene.scene import TeamScene, build_team
from mocobot_sim.scene.team_index import TeamIndex
from mocobot_sim.trial.assemble import assemble_at_home
from mocobot_sim.trial.trajectories import (
    RATE_HZ,
    Leg,
    PlanarMotion,
    Trajectory,
    carried,
    compose,
    plan,
    relative,
    yaw_of,
)
from mocobot_sim.trial.trial import run_trial

DESIGN = base_design()


@pytest.fixture(scope="module")
def scene() -> TeamScene:
    return build_team("a", released=True)


def _places(scene: TeamScene) -> np.ndarray:
    return np.column_stack([scene.mounts.translation[:, :2], yaw_of(scene.mounts.rotation.as_matrix())])


def _hold(scene: TeamScene, seconds: float) -> Trajectory:
    return Trajectory("static", np.tile(scene.wrist_home_b, (round(seconds * RATE_HZ) + 1, 1, 1)))


def _standing(scene: TeamScene) -> PlanarMotion:
    return PlanarMotion(1000.0, _places(scene)[None], np.zeros((1, scene.robots, 3)))


def test_a_released_team_is_assembled_like_a_parked_one(scene):
    torques = []
    for team in (scene, build_team("a")):
        model = team.compile()
        data = mujoco.MjData(model)
        torques.append(assemble_at_home(team, model, data, TeamIndex.of(model)))
    np.testing.assert_allclose(torques[0], torques[1], rtol=0, atol=1e-12)


def test_standing_on_wheels_is_like_being_parked(scene):
    """One second of holding payload (a): joints and torques agree, and the floor carries everything."""
    drive = BaseDrive(_standing(scene))
    rolling, parked = (
        run_trial(scene, _hold(scene, 1.0), actors=[drive]),
        run_trial(build_team("a"), _hold(scene, 1.0)),
    )
    np.testing.assert_allclose(rolling.phi[-1], parked.phi[-1], rtol=0, atol=1e-4)
    np.testing.assert_allclose(rolling.tau[-1], parked.tau[-1], rtol=0, atol=2e-3)
    # Wheels give by 0.15 mm, and nobody rolls away.
    np.testing.assert_allclose(rolling.p_W1[-1] - parked.p_W1[-1], [0, 0, -0.15e-3], rtol=0, atol=0.03e-3)
    log = drive.log()
    assert np.abs(log.true[-1] - log.true[0]).max() < 1e-6
    model = scene.compile()
    assert log.load[-1].sum() == pytest.approx(model.body_mass.sum() * 9.81, rel=1e-3)
    np.testing.assert_allclose(log.load[-1].sum(axis=-1) - 35.25 * 9.81, _shares(), rtol=0, atol=0.1)


def _shares() -> np.ndarray:
    """What robots 1..3 carry of payload (a), by the balance of moments over its grasps [N]; Table I."""
    grasps = np.array([[0.0, 0.0], [0.647, 0.533], [1.105, -0.305]])
    rows = np.vstack([np.ones(3), grasps.T])
    return np.linalg.solve(rows, 11.672 * 9.81 * np.array([1.0, 0.537, 0.156]))


@pytest.fixture(scope="module")
def carrying(scene):
    """0.15 m sideways, then 6 deg of yaw about the middle of the grasps."""
    middle = scene.X_1i.translation[:, :2].mean(axis=0)
    aside = (middle[0], middle[1] + 0.15)
    legs = [Leg((*aside, 0.0), 2.0, 0.4), Leg((*aside, np.deg2rad(6.0)), 2.0, 0.8)]
    motion = plan((*middle, 0.0), legs, rest_s=1.2)  # the arms take the load up in the first second
    drive = BaseDrive(carried(motion, _places(scene)))
    log = run_trial(scene, _hold(scene, motion.duration_s), actors=[drive])
    return motion, log, drive.log()


@pytest.mark.slow
def test_a_payload_is_carried_by_driving(scene, carrying):
    motion, log, bases = carrying
    middle = [*scene.X_1i.translation[:, :2].mean(axis=0), 0.0]
    payload = np.column_stack([log.p_W1[:, :2], yaw_of(log.R_W1)])
    held = compose(payload, relative(payload[0], middle))
    planned = motion.pose[::10, 0]
    off = held - planned
    # Bases by their odometry, the payload through soft arms.
    assert np.linalg.norm(off[-1, :2]) < 0.7e-3
    assert abs(off[-1, 2]) < np.deg2rad(0.1)
    assert np.linalg.norm(off[:, :2], axis=1).max() < 5e-3
    assert held[-1, 1] - held[0, 1] == pytest.approx(0.15, abs=1e-3)
    assert np.linalg.norm((bases.true - bases.planned)[..., :2], axis=-1).max() < 2e-3
    # Level, at its height.
    assert np.ptp(log.p_W1[:, 2]) < 1e-3
    assert log.R_W1[:, 2, 2].min() > np.cos(np.deg2rad(0.2))


@pytest.mark.slow
def test_bases_keep_their_places_under_the_payload(carrying):
    """Independent of any plan: the distances between true bases stay, so they moved as one rigid body."""
    _, _, bases = carrying
    for i, j in ((0, 1), (1, 2), (2, 0)):
        distance = np.linalg.norm(bases.true[:, i, :2] - bases.true[:, j, :2], axis=1)
        assert np.ptp(distance) < 1.5e-3
    turned = bases.true[-1, :, 2] - bases.true[0, :, 2]
    np.testing.assert_allclose(turned, np.deg2rad(6.0), atol=np.deg2rad(0.15))


@pytest.mark.slow
def test_bases_follow_what_somebody_moves(scene):
    """A push moves the floating payload; every base comes after its own wrist."""
    drive, hand = FollowingDrive(scene.mounts), PushingHand([0.537, 0.156, 0.072], [0.0, 8.0, 0.0], 0.2, 1.0)
    log = run_trial(scene, _hold(scene, 3.0), FLOAT_GAINS, actors=[drive, FloatArms(None), hand])
    bases = drive.log()
    moved = log.p_W1[-1] - log.p_W1[0]
    assert moved[1] > 0.15
    ways = (bases.true[-1] - bases.true[0])[:, 1]
    # They lag by speed over gain.
    speed = (log.p_W1[-1, 1] - log.p_W1[-11, 1]) / 0.1
    np.testing.assert_allclose(moved[1] - ways, speed / 3.0, atol=0.02)
    np.testing.assert_allclose(np.ptp(ways), 0.0, atol=0.03)


def test_snapshots_take_part_in_trials(scene):
    snapshots = Snapshots([0.0, 0.1])
    run_trial(build_team("a"), _hold(scene, 0.1), actors=[snapshots])
    assert [len(qpos) for qpos in snapshots.qpos] == [54, 54]


def test_plans_for_other_teams_and_parked_teams_are_refused(scene):
    hold = _hold(scene, 0.1)
    two = plan((0, 0, 0), [Leg((0, 0, 0), 1.0)], 0.0)
    with pytest.raises(InputError, match="the plan is for 1 bases; the scene has 3 robots"):
        run_trial(scene, hold, actors=[BaseDrive(two)])
    with pytest.raises(InputError, match="omnid1 is parked"):
        run_trial(build_team("a"), hold, actors=[BaseDrive(_standing(scene))])


def test_turned_mounts_are_released_too():
    """A free chassis begins where its mount is."""
    mounts = build_team("b").mounts
    scene = build_team("b", mounts=mounts, released=True)
    model = scene.compile()
    data = mujoco.MjData(model)
    assemble_at_home(scene, model, data, TeamIndex.of(model))
    mujoco.mj_forward(model, data)
    for i in range(3):
        chassis = data.body(f"omnid{i + 1}/chassis")
        np.testing.assert_allclose(chassis.xpos, mounts.translation[i], atol=1e-12)
        R = Rotation.from_matrix(chassis.xmat.reshape(3, 3))
        assert (R.inv() * mounts.rotation[i]).magnitude() < 1e-12

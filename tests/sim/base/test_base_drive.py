"""Omnids on their wheels, one alone and teams: commanded against achieved motion, grip, energy, a payload carried."""

import dataclasses

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.errors import InputError
from mocobot_sim.base.design import BaseDesign, MecanumKinematics, axle_share, base_design
from mocobot_sim.base.drive import (
    BaseDrive,
    DriveLog,
    FollowingDrive,
    Snapshots,
    build_solo,
    compile_solo,
    drive_solo,
)
from mocobot_sim.guided import FLOAT_GAINS, FloatArms, PushingHand
from mocobot_sim.kernels import update_drives
from mocobot_sim.scene.scene import TeamScene, build_team
from mocobot_sim.scene.team_index import BaseIndex, TeamIndex
from mocobot_sim.trial.assemble import assemble_at_home
from mocobot_sim.trial.trajectories import (
    RATE_HZ,
    Leg,
    PlanarMotion,
    Trajectory,
    carried,
    compose,
    moved,
    plan,
    relative,
    yaw_of,
)
from mocobot_sim.trial.trial import run_trial

DESIGN = base_design()
TEXTBOOK = MecanumKinematics.textbook(DESIGN)
STILL = plan((0.0, 0.0, 0.0), [Leg((0.0, 0.0, 0.0), 1.0)], 0.0)


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return compile_solo(build_solo())


def _go(model, to, kinematics=None, seconds=3.0, design: BaseDesign | None = None) -> DriveLog:
    motion = plan((0.0, 0.0, 0.0), [Leg(to, seconds, 0.5)], rest_s=0.3)
    return drive_solo(model, BaseDrive(motion, kinematics, design), motion.duration_s)


# What the textbook misses: an axle that is turned by t grips along (sin a cos t, cos a), averaged over t.
SHARE = axle_share(DESIGN)
ARM_X, ARM_Y = DESIGN.half_wheelbase_m, DESIGN.half_track_m
TURNS = np.linspace(-np.pi / DESIGN.rollers, np.pi / DESIGN.rollers, 2001)
YAW_SHARE = np.mean(np.cos(TURNS) * (ARM_X + ARM_Y) / (ARM_X + ARM_Y * np.cos(TURNS)))
WAYS = {
    "forward": ((0.6, 0.0, 0.0), 0, 1.0),
    "backward": ((-0.6, 0.0, 0.0), 0, 1.0),
    "sideways": ((0.0, 0.5, 0.0), 1, SHARE),
    "yaw": ((0.0, 0.0, 1.5), 2, YAW_SHARE),
}


@pytest.mark.parametrize("way", WAYS)
def test_a_base_goes_where_it_is_sent(model, way):
    """Within 0.15 % (of which the wheels' give under load is 0.1 %); with the textbook's kinematics, as predicted."""
    to, k, share = WAYS[way]
    log = _go(model, to)
    ratio = log.true[-1, 0] / np.where(np.abs(to) > 0, to, np.inf)
    assert ratio[k] == pytest.approx(1.0, abs=1.5e-3)
    off = log.true[:, 0] - log.planned[:, 0]
    others = [j for j in range(3) if j != k]
    assert np.abs(off[:, others]).max() < 3e-4
    # It follows its odometry, and that is what it believes it did.
    np.testing.assert_allclose(log.odometry[-1, 0], to, atol=4e-4)
    assert np.abs(log.speed - log.commanded_speed).max() < 0.25

    textbook = _go(model, to, TEXTBOOK)
    assert textbook.true[-1, 0, k] / to[k] == pytest.approx(share, abs=1.5e-3)
    if way == "sideways":
        assert textbook.true[-1, 0, k] / to[k] < 0.991  # so the correction is needed


def test_fewer_rollers_lose_more_sideways():
    """Eight rollers: 2.6 %. The half length makes them as round as eight can be."""
    design = dataclasses.replace(DESIGN, rollers=8, roller_mass_kg=0.045, roller_half_length_m=0.0422)
    model = compile_solo(build_solo(design))
    log = _go(model, (0.0, 0.5, 0.0), MecanumKinematics.textbook(design), design=design)
    assert log.true[-1, 0, 1] / 0.5 == pytest.approx(axle_share(design), abs=4e-3)
    assert axle_share(design) == pytest.approx(0.9745, abs=1e-4)


def test_curves_are_driven_too(model):
    """Forward, sideways and turning at once, and on to another pose."""
    motion = plan((0.0, 0.0, 0.0), [Leg((0.4, 0.3, 0.8), 3.0), Leg((0.1, 0.5, 0.3), 3.0, 0.5)], rest_s=0.3)
    log = drive_solo(model, BaseDrive(motion), motion.duration_s)
    off = log.true[:, 0] - log.planned[:, 0]
    assert np.linalg.norm(off[:, :2], axis=1).max() < 4e-3
    assert np.abs(off[:, 2]).max() < np.deg2rad(0.4)


def test_wheels_carry_the_weight_and_push_the_mass(model):
    """Loads add up to m g; with no other force the friction of the floor accelerates the robot."""
    log = _go(model, (0.6, 0.0, 0.0), seconds=2.0)
    weight = model.body_mass.sum() * 9.81
    loads = log.load.sum(axis=(1, 2))
    np.testing.assert_allclose(loads[20:30], weight, rtol=1e-5)
    assert loads[30:].mean() == pytest.approx(weight, rel=1e-2)
    assert (log.grip <= DESIGN.friction * log.load * (1.0 + 1e-6)).all()
    # All four axles are at 45 deg to the way, so each carries m a / (4 cos 45 deg), whether it drives or brakes.
    t = log.time[30:230] - 0.3
    s = t / 2.0
    acceleration = 0.6 * (60.0 * s - 180.0 * s**2 + 120.0 * s**3) / 4.0
    expected = model.body_mass.sum() * np.abs(acceleration) / (4.0 * np.sqrt(0.5))
    smooth = np.convolve(log.grip[:, 0].mean(axis=1), np.ones(15) / 15.0, "same")[30:230]
    np.testing.assert_allclose(smooth[10:-10], expected[10:-10], atol=0.15 * expected.max())


def test_drives_do_the_work_of_the_kinetic_energy(model):
    """Closed-form energy at the fastest point; the rest of the work is what MuJoCo's contacts take, 0.3 % of m g s."""
    motion = plan((0.0, 0.0, 0.0), [Leg((0.8, 0.0, 0.0), 2.0)], rest_s=0.3)
    data, drive, index = mujoco.MjData(model), BaseDrive(motion), BaseIndex.of(model)
    mujoco.mj_forward(model, data)
    drive.begin(model, data, 1000.0, 10)
    work = contacts = 0.0
    for tick in range(1300):
        drive.act(tick)
        speed = data.qvel[index.wheel_dof]
        mujoco.mj_step(model, data)
        work += 1e-3 * np.sum(data.ctrl[index.drive] * 0.5 * (speed + data.qvel[index.wheel_dof]))
        contacts += 1e-3 * data.efc_force @ data.efc_vel
    v = data.qvel[0]
    assert v == pytest.approx(0.8 * 30.0 / 16.0 / 2.0, rel=0.01)
    turning = 4.0 * (0.0023 + model.dof_armature[index.wheel_dof[0, 0]]) * (v / DESIGN.wheel_radius_m) ** 2
    kinetic = 0.5 * (model.body_mass.sum() * v**2 + turning)
    mujoco.mj_energyVel(model, data)
    assert data.energy[1] == pytest.approx(kinetic, rel=2e-3)
    assert work == pytest.approx(kinetic - contacts, rel=0.01)
    rolling = -contacts / (model.body_mass.sum() * 9.81 * data.qpos[0])
    assert 0.0 < rolling < 0.005


def _stand(
    model: mujoco.MjModel, force: tuple[float, float], seconds: float, then: list[np.ndarray] | None = None
) -> tuple[mujoco.MjData, BaseIndex]:
    """Stand still under a horizontal force at the floor, drives holding; ``then`` takes the pose one second before."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    drive, index = BaseDrive(STILL), BaseIndex.of(model)
    drive.begin(model, data, 1000.0, 10)
    body = index.chassis[0]
    for tick in range(round(seconds * 1000)):
        if then is not None and tick == round(seconds * 1000) - 1000:
            then.append(index.poses(data))
        push = np.array([*force, 0.0])
        data.xfrc_applied[body, :3] = push
        data.xfrc_applied[body, 3:] = np.cross([0.0, 0.0, -data.xipos[body, 2]], push)
        drive.act(0)
        mujoco.mj_step(model, data)
    return data, index


def test_a_released_base_that_is_told_to_stand_does_not_creep(model):
    data, index = _stand(model, (0.0, 0.0), 1.0)
    at = index.poses(data)
    for _ in range(2000):
        mujoco.mj_step(model, data)  # the drives go on holding
    assert np.abs(index.poses(data) - at).max() < 1e-9
    assert np.abs(data.qvel[:6]).max() < 1e-8


@pytest.mark.slow
def test_under_a_steady_force_it_creeps_by_micrometres(model):
    """MuJoCo's friction yields at a rate; it must stay small beside everything else."""
    before: list[np.ndarray] = []
    data, index = _stand(model, (16.0, 12.0), 6.0, then=before)
    assert np.abs(index.poses(data) - before[0]).max() < 10e-6  # in the last second


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, 1.0)])
def test_held_wheels_grip_up_to_the_closed_form(model, direction):
    """Wheels that hold can push along their rollers' axles only, at 45 deg: mu m g / sqrt(2) in all."""
    limit = DESIGN.friction * model.body_mass.sum() * 9.81 / np.sqrt(2.0)
    held, _ = _stand(model, tuple(0.94 * limit * np.array(direction)), 1.0)
    slid, _ = _stand(model, tuple(1.06 * limit * np.array(direction)), 1.0)
    assert np.abs(held.qvel[:2]).max() < 2e-3
    assert np.abs(slid.qvel[:2]).max() > 0.1


def test_beyond_the_grip_odometry_lies(model):
    """0.8 m in 0.6 s needs 12.8 m/s^2 at its peak; mu g / sqrt(2) is 4.9."""
    hasty, calm = _go(model, (0.8, 0.0, 0.0), seconds=0.6), _go(model, (0.8, 0.0, 0.0), seconds=2.0)
    assert np.abs(calm.slip).max() < 5e-3
    assert np.abs(hasty.slip).max() > 0.2
    lie = lambda log: np.abs(log.odometry - log.true)[:, 0, 0].max()  # noqa: E731
    assert lie(calm) < 1e-3
    assert lie(hasty) > 10e-3


@pytest.mark.slow
def test_time_steps_agree():
    """The same drive at 0.25 ms ends within 0.3 mm of that at 1 ms."""
    ends = []
    for step in (0.001, 0.00025):
        model = compile_solo(build_solo(timestep_s=step))
        ends.append(_go(model, (0.2, 0.2, 0.3), seconds=1.5).true[-1, 0])
    np.testing.assert_allclose(ends[0][:2], ends[1][:2], rtol=0, atol=3e-4)
    np.testing.assert_allclose(ends[0][2], ends[1][2], rtol=0, atol=1e-3)


def test_full_turns_are_counted(model):
    motion = plan((0.0, 0.0, 0.0), [Leg((0.0, 0.0, 4.0), 3.0, 0.3)], rest_s=0.3)
    log = drive_solo(model, BaseDrive(motion), motion.duration_s)
    assert log.true[-1, 0, 2] == pytest.approx(4.0, abs=0.02)
    assert np.abs(np.diff(log.true[:, 0, 2])).max() < 0.1


class Tick:
    """One base in the drives' arithmetic alone: wheels that do what the test says."""

    def __init__(self, gain: float = 2.0, limit: float = 12.0) -> None:
        self.kinematics = MecanumKinematics.with_rollers(DESIGN)
        self.qpos, self.qvel, self.ctrl = np.zeros(4), np.zeros(4), np.zeros(4)
        self.at = np.arange(4)[None]
        self.constants = (gain, 3.0, 40.0, limit, 0.001)
        self.odometry, self.angle = np.zeros((1, 3)), np.zeros((1, 4))
        self.lag, self.speed = np.zeros((1, 4)), np.zeros((1, 4))

    def go(self, pose: np.ndarray, twist: np.ndarray) -> None:
        update_drives(
            self.qpos, self.qvel, self.ctrl, self.at, self.at, self.at, self.kinematics.matrix[None],
            self.kinematics.inverse[None], self.constants, pose[None], twist[None],
            self.odometry, self.angle, self.lag, self.speed,
        )  # fmt: skip


def test_odometry_follows_arcs_however_long():
    """Large steps of the wheels, against the exponential of the twist."""
    tick, pose = Tick(), np.zeros(3)
    for step in np.random.default_rng(8).normal(size=(5, 3)):
        tick.qpos = tick.qpos + tick.kinematics.wheel_speeds(step)
        tick.go(np.zeros(3), np.zeros(3))
        pose = moved(pose, step)
        np.testing.assert_allclose(tick.odometry[0], pose, atol=1e-12)


def test_commands_are_in_the_axes_of_the_base():
    """A base that is turned against its plan, and beside it, drives where the plan goes, and toward it."""
    tick = Tick(gain=1.5)
    tick.odometry[0] = [0.1, -0.2, 0.4]
    pose, twist = np.array([0.3, 0.1, 1.0]), np.array([0.2, 0.5, -0.3])
    tick.go(pose, twist)
    world = Rotation.from_euler("z", 1.0).apply([twist[1], twist[2], 0.0])
    toward = 1.5 * np.array([0.2, 0.3, 0.0])
    v = Rotation.from_euler("z", -0.4).apply(world + toward)
    expected = tick.kinematics.wheel_speeds([0.2 + 1.5 * 0.6, v[0], v[1]])
    np.testing.assert_allclose(tick.speed[0], expected, atol=1e-12)
    np.testing.assert_allclose(tick.ctrl, np.clip(3.0 * expected, -12.0, 12.0), atol=1e-12)


def test_a_drive_at_its_limit_does_not_wind_up():
    """A wheel that is stuck for ten seconds owes no more than its limit, and lets go at once."""
    tick = Tick(gain=0.0, limit=6.0)
    for _ in range(10000):
        tick.go(np.zeros(3), np.array([0.0, 0.05, 0.0]))
    np.testing.assert_allclose(tick.ctrl, 6.0, atol=0.01)
    for _ in range(400):
        tick.go(np.zeros(3), np.array([0.0, -0.05, 0.0]))
    assert (tick.ctrl < -5.0).all()


def test_snapshots_are_of_their_times(model):
    motion = plan((0.0, 0.0, 0.0), [Leg((0.2, 0.0, 0.0), 1.0)], rest_s=0.0)
    snapshots = Snapshots([1.0, 0.0, 0.5])
    drive_solo(model, BaseDrive(motion), 1.0, snapshots=snapshots)
    assert [round(float(qpos[0]), 2) for qpos in snapshots.qpos] == [0.0, 0.1, 0.2]


def test_what_does_not_fit_is_refused(model):
    data = mujoco.MjData(model)
    with pytest.raises(InputError, match="the plan has 500 ticks per second; control has 1000"):
        BaseDrive(plan((0, 0, 0), [Leg((1, 0, 0), 1.0)], 0.0, rate_hz=500.0)).begin(model, data, 1000.0, 10)
    two = dataclasses.replace(STILL, pose=np.zeros((5, 2, 3)), twist=np.zeros((5, 2, 3)))
    with pytest.raises(InputError, match="the plan is for 2 bases; the scene has 1 robots"):
        BaseDrive(two).begin(model, data, 1000.0, 10)


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

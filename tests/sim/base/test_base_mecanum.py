"""Kinematics of the mecanum base against the textbook's matrix, vector algebra and MuJoCo's contact Jacobian."""

import dataclasses

import mujoco
import numpy as np
import pytest
from scipy.integrate import quad

from mocobot_sim.base.design import HAND, MecanumKinematics, axle_share, base_design
from mocobot_sim.base.drive import WheelContacts, build_solo, compile_solo
from mocobot_sim.scene.omnid import wheel_reach
from mocobot_sim.scene.team_index import BaseIndex

DESIGN = base_design()


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return compile_solo(build_solo())


def test_the_matrix_is_the_textbooks():
    """Lynch and Park, Modern Robotics, equation (13.10); its wheels 3 and 4 are rear right and rear left."""
    r, length, width = DESIGN.wheel_radius_m, DESIGN.half_wheelbase_m, DESIGN.half_track_m
    printed = np.array(
        [
            [-length - width, 1, -1],
            [length + width, 1, 1],
            [length + width, 1, -1],
            [-length - width, 1, 1],
        ]
    )
    ours = MecanumKinematics.textbook(DESIGN).matrix
    np.testing.assert_allclose(ours[[0, 1, 3, 2]], printed / r, rtol=1e-14)


@pytest.mark.parametrize("angle_deg", [30.0, 45.0, 60.0])
def test_contacts_do_not_move_along_the_axles(angle_deg):
    """Velocity of the wheel's lowest point by plain vector algebra; the rest is across the axle, where rollers turn."""
    design = dataclasses.replace(DESIGN, roller_angle_rad=float(np.deg2rad(angle_deg)))
    rng = np.random.default_rng(0)
    twists = rng.normal(size=(50, 3))
    speeds = MecanumKinematics.textbook(design).wheel_speeds(twists)
    for k, (x, y) in enumerate(design.wheel_positions):
        axle = np.array([np.sin(design.roller_angle_rad), HAND[k] * np.cos(design.roller_angle_rad), 0.0])
        for twist, speed in zip(twists, speeds[:, k], strict=True):
            chassis = np.array([twist[1], twist[2], 0.0]) + np.cross([0.0, 0.0, twist[0]], [x, y, 0.0])
            spin = np.cross([0.0, speed, 0.0], [0.0, 0.0, -design.wheel_radius_m])
            assert abs((chassis + spin) @ axle) < 1e-12


@pytest.mark.parametrize("make", [MecanumKinematics.textbook, MecanumKinematics.with_rollers])
def test_twists_come_back_from_wheel_speeds(make):
    kinematics = make(DESIGN)
    twists = np.random.default_rng(1).normal(size=(20, 3))
    np.testing.assert_allclose(kinematics.twist(kinematics.wheel_speeds(twists)), twists, rtol=0, atol=1e-13)
    # Wheels that fight each other (front against rear) move nothing.
    np.testing.assert_allclose(
        MecanumKinematics.textbook(DESIGN).twist([1.0, 1.0, -1.0, -1.0]), 0.0, atol=1e-15
    )


def test_least_squares_over_four_wheels():
    """The normal equations, solved by hand: every wheel counts a quarter."""
    r, arm = DESIGN.wheel_radius_m, DESIGN.half_wheelbase_m + DESIGN.half_track_m
    u = np.array([3.0, -1.0, 2.0, 0.5])
    by_hand = [
        r * (-u[0] + u[1] - u[2] + u[3]) / (4.0 * arm),
        r * u.sum() / 4.0,
        r * (-u[0] + u[1] + u[2] - u[3]) / 4.0,
    ]
    np.testing.assert_allclose(MecanumKinematics.textbook(DESIGN).twist(u), by_hand, rtol=1e-13)


@pytest.mark.parametrize("rollers", [6, 9, 12, 24])
def test_share_of_the_axle_is_the_mean_of_the_cosine(rollers):
    pitch = 2.0 * np.pi / rollers
    mean = quad(np.cos, -0.5 * pitch, 0.5 * pitch)[0] / pitch
    assert axle_share(dataclasses.replace(DESIGN, rollers=rollers)) == pytest.approx(mean, rel=1e-12)


def _slip(model: mujoco.MjModel, twist: np.ndarray, speeds: np.ndarray, wheel_angle: float) -> np.ndarray:
    """Sliding velocity along every roller's axle by MuJoCo's contact Jacobian, rollers not turning."""
    data, index = mujoco.MjData(model), BaseIndex.of(model)
    data.qpos[index.wheel_qpos] = wheel_angle
    # Down until the lowest rollers touch.
    data.qpos[index.free_qpos[0] + 2] = wheel_reach(DESIGN, wheel_angle) - DESIGN.wheel_radius_m - 1e-6
    data.qvel[:3], data.qvel[5] = [twist[1], twist[2], 0.0], twist[0]
    data.qvel[index.wheel_dof[0]] = speeds
    mujoco.mj_forward(model, data)
    assert data.ncon == 4
    slips = np.full(4, np.nan)
    for contact in data.contact:
        wheel = index.geom_wheel[contact.geom].max()
        jacobian = np.zeros((2, 3, model.nv))
        for side, geom in enumerate(contact.geom):
            mujoco.mj_jac(model, data, jacobian[side], None, contact.pos, model.geom_bodyid[geom])
        roller = contact.geom[index.geom_wheel[contact.geom].argmax()]
        axle = data.geom_xmat[roller].reshape(3, 3)[:, 2] * [1.0, 1.0, 0.0]
        slips[wheel] = (jacobian[1] - jacobian[0]) @ data.qvel @ axle / np.linalg.norm(axle)
    return slips


@pytest.mark.parametrize("twist", [(0.0, 0.3, 0.0), (0.0, 0.0, 0.3), (0.8, 0.0, 0.0), (0.5, -0.2, 0.3)])
def test_rollers_in_mujoco_do_not_slide_at_the_textbooks_speeds(model, twist):
    speeds = MecanumKinematics.textbook(DESIGN).wheel_speeds(twist)
    np.testing.assert_allclose(_slip(model, np.array(twist), speeds, 0.0), 0.0, atol=1e-5)
    assert np.abs(_slip(model, np.array(twist), 1.01 * speeds, 0.0)).max() > 1e-3


@pytest.mark.parametrize("wheel_angle", [-0.2, 0.1, 0.22])
def test_a_turned_axle_asks_for_another_speed(model, wheel_angle):
    """Sideways, a roller turned by t from straight down sticks at v / (height cot(a)^-1 cos t)."""
    height = wheel_reach(DESIGN, wheel_angle) - 0.5e-6  # MuJoCo puts the contact amid the overlap
    speeds = HAND * 0.3 / (np.tan(DESIGN.roller_angle_rad) * np.cos(wheel_angle) * height)
    np.testing.assert_allclose(_slip(model, np.array([0.0, 0.0, 0.3]), speeds, wheel_angle), 0.0, atol=1e-6)


def test_measured_slip_is_the_one_along_the_axle(model):
    """A base that is pushed along x with its wheels locked slides by v sin(a) along every axle."""
    data, index = mujoco.MjData(model), BaseIndex.of(model)
    data.qpos[index.free_qpos[0] + 2] = -1e-5
    data.qvel[0] = 0.2
    mujoco.mj_forward(model, data)
    slip, load, grip = WheelContacts(model, data, index, DESIGN).measure()
    np.testing.assert_allclose(slip, 0.2 * np.sin(DESIGN.roller_angle_rad), rtol=1e-6)
    assert (load > 0).all()
    # Sliding: friction is at its limit.
    np.testing.assert_allclose(grip, DESIGN.friction * load, rtol=1e-3)
    data.qpos[index.free_qpos[0] + 2] = 0.1
    mujoco.mj_forward(model, data)
    for values in WheelContacts(model, data, index, DESIGN).measure():
        np.testing.assert_array_equal(values, 0.0)

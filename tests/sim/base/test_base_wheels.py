"""The mecanum base: kinematics against the textbook's, rollers as MuJoCo compiles them, and their files."""

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest

from estimator.errors import InputError
from mocobot_sim.base.design import (
    HAND,
    WHEELS,
    BaseDesign,
    MecanumKinematics,
    base_design,
    load_base_design,
)
from mocobot_sim.base.drive import WheelContacts, build_solo, compile_solo
from mocobot_sim.scene.omnid import wheel_reach
from mocobot_sim.scene.scene import build_team
from mocobot_sim.scene.team_index import BaseIndex, TeamIndex

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


OMNID = Path(__file__).resolve().parents[3] / "models" / "omnid"


@pytest.fixture(scope="module")
def parked() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(OMNID / "omnid.xml"))


@pytest.fixture(scope="module")
def solo() -> mujoco.MjModel:
    return compile_solo(build_solo())


def test_wheels_keep_their_mass_and_inertia(parked, solo):
    data, before = mujoco.MjData(solo), mujoco.MjData(parked)
    for model, state in ((solo, data), (parked, before)):
        mujoco.mj_forward(model, state)
    index = BaseIndex.of(solo)
    for k, wheel in enumerate(WHEELS):
        old = parked.body(f"wheel_{wheel}")
        hub = solo.body(f"omnid1/wheel_{wheel}").id
        assert solo.body_subtreemass[hub] == pytest.approx(old.subtreemass[0], rel=1e-12)
        # The hub and its rollers, about the wheel's centre; nothing is left beside the axes.
        parts = [hub, *np.flatnonzero(solo.body_parentid == hub)]
        total = np.zeros((3, 3))
        for body in parts:
            R, arm = data.ximat[body].reshape(3, 3), data.xipos[body] - data.xpos[hub]
            total += R @ np.diag(solo.body_inertia[body]) @ R.T
            total += solo.body_mass[body] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        np.testing.assert_allclose(total, np.diag(old.inertia), rtol=0, atol=1e-12)
        unit, column = np.zeros(solo.nv), np.zeros(solo.nv)
        unit[index.wheel_dof[0, k]] = 1.0
        mujoco.mj_mulM(solo, data, column, unit)
        assert unit @ column == pytest.approx(
            old.inertia[1] + parked.joint(f"wheel_{wheel}").armature[0], rel=1e-9
        )
    assert solo.body_mass.sum() == pytest.approx(parked.body_mass.sum(), rel=1e-12)


def test_every_roller_turns_about_its_long_axis_at_45_deg_to_the_wheels(solo):
    data = mujoco.MjData(solo)
    mujoco.mj_forward(solo, data)
    lowest = {}
    for k, wheel in enumerate(WHEELS):
        hub = solo.body(f"omnid1/wheel_{wheel}").id
        rollers = np.flatnonzero(solo.body_parentid == hub)
        assert len(rollers) == DESIGN.rollers
        for body in rollers:
            joint, geom = solo.body_jntadr[body], solo.body_geomadr[body]
            axle = data.xaxis[joint]
            np.testing.assert_allclose(axle, data.geom_xmat[geom].reshape(3, 3)[:, 2], atol=1e-12)
            assert abs(axle[1]) == pytest.approx(np.cos(DESIGN.roller_angle_rad), abs=1e-12)
            # At right angles to the line from the wheel's centre.
            assert abs(axle @ (data.xpos[body] - data.xpos[hub])) < 1e-12
            if data.xpos[body][2] < DESIGN.roller_radius_m + 1e-9:
                lowest[k] = axle[:2] * np.sign(axle[0])
    # The rollers on the floor form a diamond: each axle passes left or right of the chassis' middle.
    for k, sign in enumerate((-1, 1, 1, -1)):
        np.testing.assert_allclose(lowest[k], np.sqrt(0.5) * np.array([1.0, sign]), atol=1e-12)


def test_released_teams_stand_on_their_wheels_and_parked_ones_have_none():
    released, parked = build_team("a", released=True).compile(), build_team("a").compile()
    assert BaseIndex.of(released).robots == 3
    assert len(TeamIndex.of(released).base_dof) == 3 * (6 + 4 + 4 * DESIGN.rollers)
    assert released.nv == parked.nv + 3 * (6 + 4 + 4 * DESIGN.rollers)
    assert len(TeamIndex.of(parked).base_dof) == 0
    assert parked.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT
    assert not [parked.body(i).name for i in range(parked.nbody) if "roller" in parked.body(i).name]
    with pytest.raises(InputError, match="omnid1 is parked; a base that is to drive must be released"):
        BaseIndex.of(parked)
    with pytest.raises(InputError, match="has no Omnid"):
        BaseIndex.of(mujoco.MjModel.from_xml_string("<mujoco/>"))


NUMBERS = dataclasses.asdict(DESIGN)
BAD = {
    "rollers": ({"rollers": 2}, "rollers is 2; it must be a whole number from 3 to 60"),
    "half a roller": ({"rollers": 12.0}, "rollers is 12.0; it must be a whole number"),
    "angle": ({"roller_angle_rad": 0.0}, "roller_angle_rad is 0.0; it must be a number from 0.1 to 1.47"),
    "negative": ({"friction": -0.1}, "friction is -0.1; it must be a finite number greater than 0"),
    "nan": ({"wheel_radius_m": float("nan")}, "wheel_radius_m is nan; it must be a finite number"),
    "text": ({"half_track_m": "wide"}, "half_track_m is 'wide'; it must be a finite number"),
    "true": ({"half_track_m": True}, "half_track_m is True; it must be a finite number"),
    "thick": (
        {"roller_radius_m": 0.05},
        "roller_radius_m is 0.05; it must be less than half of wheel_radius_m",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_designs_are_refused(case):
    change, sentence = BAD[case]
    with pytest.raises(InputError, match=sentence):
        BaseDesign(**(NUMBERS | change))


@pytest.mark.parametrize(
    ("edit", "sentence"),
    [
        (
            lambda text: text.replace("friction", "grip"),
            r"base\.toml: unknown key 'grip'; the keys are wheel_radius_m",
        ),
        (lambda text: text.replace("friction = 0.7", ""), r"base\.toml: missing key 'friction'"),
        (lambda text: text.replace("= 12 ", '= "many" '), r"base\.toml: base design: rollers is 'many'"),
        (lambda text: "wheels, four", r"base\.toml: not a readable design file"),
    ],
)
def test_bad_design_files_are_refused(tmp_path, edit, sentence):
    path = tmp_path / "base.toml"
    path.write_text(edit((OMNID / "base.toml").read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(InputError, match=sentence):
        load_base_design(path)
    with pytest.raises(InputError, match="nowhere"):
        load_base_design(tmp_path / "nowhere.toml")

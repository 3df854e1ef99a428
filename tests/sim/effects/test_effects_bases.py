"""Tilted, creeping and yielding bases, yielding and loose grasps, against MuJoCo's forces and closed forms."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from closed_loop import BASE_HEIGHT_M, ClosedLoop
from effect_cases import example, team_with
from mocobot_sim.scene.scene import build_team
from mocobot_sim.scene.soft import row_relaxation_s, spring_parameters
from mocobot_sim.trial.actors import Stage
from mocobot_sim.trial.trajectories import random_vias
from mocobot_sim.trial.trial import run_trial

ROBOT = pytest.mark.parametrize("robot", [1, 2])


def _gap(loop: ClosedLoop, robot: int) -> np.ndarray:
    """Payload's grasp minus flange in the world [m]."""
    return loop.data.site(f"omnid1/payload/grasp{robot}").xpos - loop.data.site(f"omnid{robot}/grasp").xpos


@ROBOT
def test_a_tilted_base_turns_about_its_place_on_the_floor(robot):
    tilt = [0.03, -0.02]
    effect = example("base_tilt", robot, roll_rad=tilt[0], pitch_rad=tilt[1])
    loop, level = ClosedLoop(team_with("d", effect)), ClosedLoop(build_team("d"))
    for i in (1, 2, 3):
        before, after = (one.data.body(f"omnid{i}/base").xmat.reshape(3, 3) for one in (level, loop))
        foot, old_foot = (one.data.body(f"omnid{i}/chassis").xpos for one in (loop, level))
        np.testing.assert_allclose(foot, old_foot, rtol=0, atol=1e-12)
        turn = Rotation.from_matrix(before.T @ after).as_rotvec()
        np.testing.assert_allclose(turn, [*tilt, 0.0] if i == robot else 0, rtol=0, atol=1e-9)
        up = loop.data.body(f"omnid{i}/base").xpos - foot
        np.testing.assert_allclose(up, BASE_HEIGHT_M * after[:, 2], rtol=0, atol=1e-12)


@ROBOT
def test_creep_is_velocity_times_time(robot):
    velocity = np.array([3e-6, -5e-6])
    effects = [
        example("base_creep", robot, x_mps=velocity[0], y_mps=velocity[1]),
        example("base_tilt", robot),
    ]
    loop = ClosedLoop(team_with("b", *effects))
    R_Wb = loop.scene.X_Wb.rotation[robot - 1].as_matrix()
    start = loop.data.body(f"omnid{robot}/chassis").xpos.copy()
    home = loop.scene.wrist_home_b
    for seconds in (1, 2, 3):
        loop.run(1.0, home + 0.01 * np.array([seconds % 2, 0, 1]))
        moved = R_Wb.T @ (loop.data.body(f"omnid{robot}/chassis").xpos - start)
        np.testing.assert_allclose(moved, [*(velocity * (seconds - 0.01)), 0.0], rtol=0, atol=2e-9)


def test_a_base_creeps_from_its_start_on():
    """A trial of 0.9 s at 1 kHz: still until 0.4 s, then v t, but for the 10 ms in which it gathers speed."""
    velocity, start_s = np.array([2e-4, -1e-4]), 0.4
    scene = team_with("b", example("base_creep", 2, x_mps=velocity[0], y_mps=velocity[1], start_s=start_s))
    loop = ClosedLoop(scene)
    (actor,) = scene.effects[0].actors(1)
    actor.start(
        Stage(
            loop.model,
            loop.data,
            loop.index,
            loop.controller,
            round(1 / loop.model.opt.timestep),
            1,
            900,
        )
    )
    at = [int(loop.model.joint(f"omnid2/creep_{axis}").qposadr[0]) for axis in "xy"]
    for tick in range(900):
        loop.data.qfrc_applied[:] = 0.0
        actor.act(tick)
        loop.controller.update(scene.wrist_home_b, np.zeros((3, 3)))
        mujoco.mj_step(loop.model, loop.data)
        if tick == 399:
            assert np.abs(loop.data.qpos[at]).max() < 1e-8
    np.testing.assert_allclose(loop.data.qpos[at], velocity * (0.5 - 0.01), rtol=0.01)


@pytest.mark.parametrize("timestep_s", [1e-3, 0.25e-3])
@pytest.mark.parametrize("compliance", [1e-7, 1e-4])
@pytest.mark.parametrize("mass", [0.03, 40.0])
def test_a_spring_row_hangs_a_weight_by_its_compliance(timestep_s, compliance, mass):
    solref, solimp = spring_parameters(compliance, 1.0 / mass)
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{timestep_s}" integrator="implicitfast"/><worldbody><body>
        <joint name="j" type="slide" axis="0 0 1"/><inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/>
        </body></worldbody><equality><joint joint1="j" solref="{solref[0]} {solref[1]}"
        solimp="{" ".join(map(repr, solimp))}"/></equality></mujoco>"""
    )
    data = mujoco.MjData(model)
    lowest = 0.0
    for _ in range(round(3.0 / timestep_s)):
        mujoco.mj_step(model, data)
        lowest = min(lowest, data.qpos[0])
    sag = -compliance * mass * 9.81
    assert data.qpos[0] == pytest.approx(sag, rel=1e-6)
    assert lowest > 1.06 * sag, "well damped"


def _held(loop: ClosedLoop, i: int) -> np.ndarray:
    loop.run(2.0, loop.scene.wrist_home_b + np.array([0.01, -0.02, 0.015]) * [[1], [-1], [1]])
    return loop.forces_on_payload()[i - 1]


@ROBOT
@pytest.mark.parametrize("compliance", [1e-7, 1e-6, 1e-5])
def test_a_flexible_grasp_gives_way_by_compliance_times_force(robot, compliance):
    """In all directions alike: the payload sags relative to the flange along the force of payload on robot."""
    loop = ClosedLoop(team_with("a", example("grasp_flex", robot, compliance_m_per_N=compliance)))
    force = _held(loop, robot)
    assert np.abs(force[:2]).max() > 3.0
    np.testing.assert_allclose(
        _gap(loop, robot), -compliance * force, rtol=0, atol=0.015 * compliance * 40 + 0.2e-6
    )


@ROBOT
@pytest.mark.parametrize("offset_m", [0.06, -0.03])
def test_a_grasp_turns_by_the_moment_of_its_force(robot, offset_m):
    """About its point, by turning times the force across its axis; nothing turns about the gimbal's centre."""
    turning = 1e-4
    effect = example("grasp_flex", robot, turning_rad_per_N=turning, offset_m=offset_m)
    loop = ClosedLoop(team_with("a", effect))
    prefix = "omnid1/payload/" if robot == 1 else f"omnid{robot}/"
    at = [int(loop.model.joint(f"{prefix}flex_about_{axis}").qposadr[0]) for axis in "xyz"]
    _held(loop, robot)
    R = loop.data.site_xmat[loop.index.payload_site[robot - 1]].reshape(3, 3)
    force = R.T @ loop.forces_on_payload()[robot - 1]
    # What the payload puts on the grasp, over the point's distance.
    moment = -np.cross([0.0, 0.0, -np.sign(offset_m)], force)
    assert np.abs(moment).max() > 3.0
    np.testing.assert_allclose(loop.data.qpos[at], turning * moment, rtol=0.03, atol=1e-5)
    same = team_with("a", example("grasp_flex", robot, turning_rad_per_N=turning))
    assert ClosedLoop(same).model.nq == ClosedLoop(team_with("a", example("grasp_flex", robot))).model.nq


@ROBOT
def test_a_yielding_base_gives_way_by_compliance_times_horizontal_force(robot):
    """The floor's force on the base is all that acts on the robot sideways: payload's reaction, at rest."""
    compliance = 1e-5
    loop = ClosedLoop(team_with("a", example("base_compliance", robot, compliance_m_per_N=compliance)))
    start = loop.scene.mounts.translation[robot - 1]
    force = _held(loop, robot)
    moved = loop.data.body(f"omnid{robot}/chassis").xpos - start
    assert np.abs(force[:2]).max() > 3.0
    np.testing.assert_allclose(moved[:2], -compliance * force[:2], rtol=0, atol=0.01 * compliance * 30)
    assert moved[2] == 0


@ROBOT
@pytest.mark.parametrize(
    ("timestep_s", "cause", "size", "relaxation_s"),
    [
        (1e-3, "grasp_flex", 1e-7, 0.0),
        (0.25e-3, "grasp_flex", 1e-5, 0.0),
        (1e-3, "grasp_flex", 1e-5, 0.03),
        (1e-3, "base_compliance", 1e-5, 0.0),
        (0.25e-3, "base_compliance", 1e-7, 0.005),
    ],
)
def test_what_yields_is_stable_and_leaves_the_rods_closed(robot, timestep_s, cause, size, relaxation_s):
    effect = example(cause, robot, compliance_m_per_N=size, relaxation_s=relaxation_s)
    scene = team_with("a", effect, timestep_s=timestep_s)
    log = run_trial(scene, random_vias(scene.wrist_home_b, np.random.default_rng(0), 1))
    assert log.rod_error_m < 2e-6
    assert log.weld_error_rad < 1e-6
    assert log.weld_error_m < (200.0 * size if cause == "grasp_flex" else 1e-6) + 1e-6
    wiggle = np.diff(log.phi[:, robot - 1], n=2, axis=0)
    assert np.abs(wiggle).max() < 2e-3, "no oscillation from row to row"


@ROBOT
@pytest.mark.parametrize("play", [5e-6, 2e-4])
def test_a_loose_grasp_uses_its_gap_and_no_more(robot, play):
    """Impacts may go a few micrometres deep; limits are constraints of MuJoCo's."""
    loop = ClosedLoop(team_with("a", example("grasp_play", robot, play_m=play)))
    home, gaps = loop.scene.wrist_home_b, []
    for tick in range(3000):
        t = tick / 1000
        loop.controller.update(
            home + 0.03 * np.sin(2 * np.pi * np.array([0.9, 1.1, 0.7]) * t), np.zeros((3, 3))
        )
        mujoco.mj_step(loop.model, loop.data)
        R_Wi = loop.data.site(f"omnid{robot}/grasp").xmat.reshape(3, 3)
        gaps.append(R_Wi.T @ _gap(loop, robot))
    gaps = np.array(gaps)[10:]
    assert np.abs(gaps).max() < play + 40e-6
    assert np.median(np.abs(gaps), axis=0).max() > 0.98 * play, "the weight lies on one side"
    mujoco.mj_forward(loop.model, loop.data)


@ROBOT
@pytest.mark.parametrize(("given_kg", "moves_kg"), [(0.0, None), (90.0, 90.0)])
def test_a_base_on_springs_moves_as_much_mass_as_it_is_said_to(robot, given_kg, moves_kg):
    """The mass matrix of the slides, of a robot that holds nothing."""
    effect = example("base_compliance", robot, compliance_m_per_N=1e-5, mass_kg=given_kg)
    model = team_with("a", effect).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    dof = model.jnt_dofadr[model.joint(f"omnid{robot}/compliance_x").id]
    bodies = [k for k in range(model.nbody) if f"omnid{robot}/" in model.body(k).name]
    own = sum(model.body_mass[k] for k in bodies if "payload" not in model.body(k).name)
    payload = model.body_subtreemass[bodies[0]] - own  # on the flange of robot 1
    assert full[dof, dof] - payload == pytest.approx(own + 1.0 if moves_kg is None else moves_kg, rel=1e-9)


@pytest.mark.parametrize("compliance", [1e-7, 1e-5])
def test_a_spring_follows_a_growing_force_as_late_as_its_row_says(compliance):
    """Behind a ramp it stays by its time constant, however much mass moves along."""
    inverse_kg, grows_N_per_s = 0.5, 100.0
    (s, b), impedance = spring_parameters(compliance, inverse_kg)
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.0005" gravity="0 0 0" tolerance="0"/><worldbody><body>
        <joint name="x" type="slide" axis="1 0 0"/><geom size="0.1" mass="{1.0 / inverse_kg}"/></body></worldbody>
        <equality><joint name="spring" joint1="x" solref="{s} {b}" solimp="{" ".join(map(str, impedance))}"/></equality>
        </mujoco>"""
    )
    data = mujoco.MjData(model)
    for _ in range(2000):
        data.qfrc_applied[0] = grows_N_per_s * data.time
        mujoco.mj_step(model, data)
    late_s = data.time - data.qpos[0] / (compliance * grows_N_per_s)
    assert late_s > 5e-3
    assert row_relaxation_s(model, "spring") == pytest.approx(late_s, rel=0.1)

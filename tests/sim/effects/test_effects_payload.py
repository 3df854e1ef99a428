"""What acts on the payload or changes it: drag, tether, pendulum, pushes, masses; against Newton and closed forms."""

import itertools
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from closed_loop import ClosedLoop, base_poses
from effect_cases import SIZES, example, one_robot, team_with
from mocobot_sim.effects import make_effect
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.trajectories import SETTLE_S, Trajectory, random_vias
from mocobot_sim.trial.trial import between_commands, run_trial


def _still(scene, samples: int) -> Trajectory:
    return Trajectory("static", np.tile(scene.wrist_home_b, (samples, 1, 1)))


def test_drag_is_minus_c_v():
    """MuJoCo's actuator force against the path of the centre of mass."""
    c = 7.0
    loop = ClosedLoop(team_with("a", example("drag", coefficient_Ns_per_m=c)))
    ids = [loop.model.actuator(f"drag_{axis}").id for axis in "xyz"]
    home, path, force = loop.scene.wrist_home_b, [], []
    for tick in range(1500):
        t = tick / 1000
        loop.controller.update(
            home + 0.03 * np.sin(2 * np.pi * np.array([0.9, 1.1, 0.7]) * t), np.zeros((3, 3))
        )
        mujoco.mj_step(loop.model, loop.data)
        path.append(loop.data.xipos[loop.index.payload_body].copy())
        force.append(loop.data.actuator_force[ids].copy())
    # A step moves by its last velocity, so the difference to the state before is the velocity of a state.
    velocity = np.diff(path, axis=0) / 1e-3
    assert np.abs(velocity).max() > 0.03
    np.testing.assert_allclose(force[2:], -c * velocity[1:], rtol=0, atol=1e-3 * c * np.abs(velocity).max())


def test_a_tether_of_the_payload_pulls_with_stiffness_times_distance():
    """At rest the robots hold the weight less the pull, at the point of the payload where the tether is tied."""
    k, anchor, point = 40.0, np.array([0.3, -0.2, 0.9]), np.array([0.1, 0.2, -0.05])
    values = [*anchor.tolist(), *point.tolist()]
    names = [f"{name}_{axis}_m" for name in ("anchor", "point") for axis in "xyz"]
    effect = example("payload_tether", stiffness_N_per_m=k, **dict(zip(names, values, strict=True)))
    loop = ClosedLoop(team_with("b", effect))
    p_Wb, R_Wb = base_poses(loop.scene)
    site = loop.index.payload_site[0]
    tied = loop.data.site_xpos[site] + loop.data.site_xmat[site].reshape(3, 3) @ point
    pull = k * (p_Wb[0] + R_Wb[0] @ anchor - tied)
    assert np.linalg.norm(pull) > 10.0
    weight = np.array([0, 0, 9.81 * loop.model.body_mass[loop.index.payload_body]])
    total = loop.forces_on_payload().sum(axis=0) + pull - weight
    np.testing.assert_allclose(total, 0, rtol=0, atol=5e-4 * weight[2])


@pytest.mark.parametrize("name", ["tether", "payload_tether"])
@pytest.mark.parametrize("stretch_m", [0.05, -0.05])
@pytest.mark.parametrize(("k", "stiffening"), [(200.0, 0.0), (200.0, 3000.0), (0.0, 6000.0)])
def test_a_cable_pulls_by_what_it_is_longer_than_its_length_and_never_pushes(name, stretch_m, k, stiffening):
    """At rest the robots hold the weight less the pull."""
    away = np.array([0.5, -0.3, 0.4])
    changes = {"stiffness_N_per_m": k, "length_m": float(np.linalg.norm(away)) - stretch_m}
    changes["stiffening_N_per_m2"] = stiffening
    home = build_team("b").wrist_home_b[0]
    if name == "payload_tether":
        changes |= {f"point_{a}_m": 0.1 for a in "xyz"}
    anchor = home + away + (0.1 if name == "payload_tether" else 0.0)
    changes |= {f"anchor_{a}_m": float(x) for a, x in zip("xyz", anchor, strict=True)}
    loop = ClosedLoop(team_with("b", example(name, **changes)))
    p_Wb, R_Wb = base_poses(loop.scene)
    site = loop.index.payload_site[0]
    point = 0.1 * np.ones(3) if name == "payload_tether" else np.zeros(3)
    tied = loop.data.site_xpos[site] + loop.data.site_xmat[site].reshape(3, 3) @ point
    now = p_Wb[0] + R_Wb[0] @ anchor - tied
    distance = np.linalg.norm(now)
    longer = max(distance - changes["length_m"], 0.0)
    pull = (k * longer + stiffening * longer**2) * now / distance
    assert (np.linalg.norm(pull) > 5.0) == (stretch_m > 0.0)
    weight = np.array([0, 0, 9.81 * loop.model.body_mass[loop.index.payload_body]])
    total = loop.forces_on_payload().sum(axis=0) + pull - weight
    np.testing.assert_allclose(total, 0, rtol=0, atol=5e-4 * weight[2])


def test_drag_resists_turning_with_minus_c_omega():
    """Its generalised force is that of a moment against MuJoCo's own angular velocity, and of no force."""
    c = 3.0
    scene = team_with("a", example("drag", coefficient_Ns_per_m=0.0, turning_Nms_per_rad=c))
    model = scene.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = 0.02 * np.random.default_rng(0).standard_normal(model.nq)
    data.qvel[:] = np.random.default_rng(1).standard_normal(model.nv)
    mujoco.mj_forward(model, data)
    turn = np.zeros((3, model.nv))
    mujoco.mj_jacBody(model, data, None, turn, model.body("omnid1/payload/payload").id)
    np.testing.assert_allclose(data.qfrc_actuator, -c * turn.T @ (turn @ data.qvel), atol=1e-9)
    assert np.abs(turn @ data.qvel).max() > 0.1


def test_drag_with_the_squares_of_the_speeds():
    """The fluid's generalised force is -q |v| v at the centre of mass and a moment -q_r |omega| omega."""
    q, turning = 5.0, 2.0
    squares = {"quadratic_Ns2_per_m2": q, "turning_quadratic_Nms2_per_rad2": turning}
    scene = team_with("a", example("drag", coefficient_Ns_per_m=0.0, turning_Nms_per_rad=0.0, **squares))
    model = scene.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = 0.02 * np.random.default_rng(0).standard_normal(model.nq)
    data.qvel[:] = np.random.default_rng(1).standard_normal(model.nv)
    mujoco.mj_forward(model, data)
    along, turn = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jacBodyCom(model, data, along, turn, model.body("omnid1/payload/payload").id)
    v, omega = along @ data.qvel, turn @ data.qvel
    expected = -q * np.linalg.norm(v) * along.T @ v - turning * np.linalg.norm(omega) * turn.T @ omega
    assert np.abs(expected).max() > 1.0
    np.testing.assert_allclose(data.qfrc_fluid, expected, atol=1e-6)


def test_a_pendulum_of_two_lengths_and_a_second_one_swing_at_their_own_frequencies():
    """Their inertia about each hinge, and how gravity turns them back, are those of points on strings."""
    shape = {"length_m": 0.2, "across_length_m": 0.08, "heading_rad": 0.6}
    second = {"second_length_m": 0.05, "second_share": 0.3}
    model = team_with("a", example("slosh", **shape, **second)).compile()
    data = mujoco.MjData(model)
    for name, length_m in (
        ("slosh_y", 0.2),
        ("slosh_x", 0.08),
        ("slosh_second_x", 0.05),
        ("slosh_second_y", 0.05),
    ):
        joint = model.joint(f"omnid1/payload/{name}")
        at, dof, full = int(joint.qposadr[0]), int(joint.dofadr[0]), np.zeros((model.nv, model.nv))
        sides = []
        for side in (1e-4, -1e-4):
            data.qpos[:] = 0.0
            data.qpos[at] = side
            mujoco.mj_forward(model, data)
            sides.append(data.qfrc_bias[dof])
        mujoco.mj_fullM(model, data, full)
        frequency = np.sqrt((sides[0] - sides[1]) / 2e-4 / full[dof, dof])
        assert frequency == pytest.approx(np.sqrt(9.81 / length_m), rel=1e-4), name
        x, y = np.array([[np.cos(0.6), np.sin(0.6), 0.0], [-np.sin(0.6), np.cos(0.6), 0.0]])
        R = data.body("omnid1/payload/payload").xmat.reshape(3, 3)
        np.testing.assert_allclose(R.T @ data.xaxis[joint.id], x if name[-1] == "x" else y, atol=1e-3)
    masses = [float(model.body(f"omnid1/payload/{name}").mass[0]) for name in ("slosh", "slosh_second")]
    np.testing.assert_allclose(masses, [0.21, 0.09])


@pytest.mark.parametrize("robot", [1, 3])
def test_a_tether_pulls_with_stiffness_times_distance(robot):
    """At rest the robots hold weight and tether; Newton's balance is MuJoCo's, the tether's force is Hooke's."""
    k, anchor = 40.0, np.array([0.3, -0.2, 0.9])
    names = ("anchor_x_m", "anchor_y_m", "anchor_z_m")
    changes = dict(zip(names, anchor.tolist(), strict=True)) | {"stiffness_N_per_m": k}
    effects = [example("tether", robot, **changes), example("base_tilt", robot, roll_rad=1e-3, pitch_rad=0.0)]
    loop = ClosedLoop(team_with("b", *effects))
    p_Wb, R_Wb = base_poses(loop.scene)
    at = p_Wb[robot - 1] + R_Wb[robot - 1] @ anchor
    pull = k * (at - loop.data.site(f"omnid1/payload/grasp{robot}").xpos)
    assert np.linalg.norm(pull) > 10.0
    weight = np.array([0, 0, 9.81 * loop.model.body_mass[loop.index.payload_body]])
    total = loop.forces_on_payload().sum(axis=0) + pull - weight
    np.testing.assert_allclose(total, 0, rtol=0, atol=5e-4 * weight[2])
    start = loop.data.site_xpos.copy()
    for _ in range(500):
        mujoco.mj_step(loop.model, loop.data)
    assert np.abs(loop.data.site_xpos - start).max() < 0.02e-3


@pytest.mark.parametrize(("length", "damping"), [(0.05, 0.0), (0.2, 0.02), (0.4, 0.1)])
def test_a_pendulum_swings_with_its_own_period_and_damping(length, damping):
    """Light against a heavy payload: 2 pi sqrt(l / g) / sqrt(1 - zeta^2), and the logarithmic decrement."""
    effect = example(
        "slosh",
        mass_kg=1e-3,
        length_m=length,
        damping_ratio=damping,
        point_x_m=0.5,
        point_y_m=0.2,
        point_z_m=0.0,
    )
    loop = ClosedLoop(team_with("a", effect))
    for axis in "xy":
        angle = []
        joint = loop.data.joint(f"omnid1/payload/slosh_{axis}")
        joint.qpos[0] = 0.05
        for _ in range(4000):
            loop.controller.update(loop.scene.wrist_home_b, np.zeros((3, 3)))
            mujoco.mj_step(loop.model, loop.data)
            angle.append(joint.qpos[0])
        angle = np.array(angle)
        falling = np.flatnonzero((angle[:-1] > 0) & (angle[1:] <= 0))
        crossings = falling + angle[falling] / (angle[falling] - angle[falling + 1])
        period = 2e-3 * np.pi * np.sqrt(length / 9.81) * 1e3 / np.sqrt(1 - damping**2)
        np.testing.assert_allclose(np.diff(crossings[:4]), 1e3 * period, rtol=3e-3)
        peaks = [angle[a:b].max() for a, b in itertools.pairwise(falling)]
        expected = 2 * np.pi * damping / np.sqrt(1 - damping**2)
        assert np.log(peaks[0] / peaks[1]) == pytest.approx(expected, abs=0.01 + 0.02 * expected)
        joint.qpos[0] = joint.qvel[0] = 0.0


PUSH = SIZES["push"] | {
    "trial": 2, "start_s": 1.2, "duration_s": 2.0, "force_x_N": 2.0, "force_y_N": -1.0, "force_z_N": 3.0,
    "point_x_m": 0.6, "point_y_m": 0.1, "point_z_m": 0.05,
}  # fmt: skip


def test_a_push_is_carried_by_the_wrists_springs():
    """Settled, the wrists have given way until K times their shifts add up to the force; nothing moves before."""
    scene = team_with("c", example("push", **PUSH))
    clean = run_trial(build_team("c"), _still(scene, 450))
    log = run_trial(scene, _still(scene, 450), trial_number=2)
    np.testing.assert_array_equal(log.phi[:121], clean.phi[:121])
    assert np.any(log.phi[122] != clean.phi[122])
    other = run_trial(scene, _still(scene, 450), trial_number=1)
    np.testing.assert_array_equal(other.tau, clean.tau)
    any_number = run_trial(scene, _still(scene, 450))
    np.testing.assert_array_equal(any_number.tau, log.tau)
    p_1i = scene.X_1i.translation
    grasps, before = (one.p_W1[318] + p_1i @ one.R_W1[318].T for one in (log, clean))
    shift = 400.0 * (grasps - before).sum(axis=0)
    np.testing.assert_allclose(shift, base_poses(scene)[1][0] @ [2.0, -1.0, 3.0], rtol=0, atol=0.1)
    assert np.linalg.norm(log.p_W1[449] - clean.p_W1[449]) < 0.1e-3, "let go"


def test_a_push_is_force_and_moment_about_the_centre_of_mass():
    effect = example("push", **PUSH | {"start_s": 0.4})
    scene = team_with("c", effect)
    loop = ClosedLoop(scene)
    ref, rate = between_commands(scene.wrist_home_b + np.linspace(0, 0.02, 60)[:, None, None], 10)
    body = loop.index.payload_body
    R_Wb1 = scene.X_Wb.rotation[0].as_matrix()
    np.testing.assert_allclose(R_Wb1, base_poses(scene)[1][0], rtol=0, atol=1e-12)
    for tick in range(500):
        loop.controller.update(ref[tick], rate[tick])
        mujoco.mj_step(loop.model, loop.data)
        loop.data.xfrc_applied[:] = 0
        if effect.acts(loop.data.time):
            mujoco.mj_kinematics(loop.model, loop.data)
            effect.act(loop.data, body, R_Wb1)
        assert np.any(loop.data.xfrc_applied != 0) == (loop.data.time > 0.3995)
    mujoco.mj_kinematics(loop.model, loop.data)
    force = R_Wb1 @ [2.0, -1.0, 3.0]
    site = loop.data.site("omnid1/payload/grasp1")
    point = site.xpos + site.xmat.reshape(3, 3) @ [0.6, 0.1, 0.05]
    np.testing.assert_allclose(loop.data.xfrc_applied[body, :3], force, rtol=1e-12)
    moment = np.cross(point - loop.data.xipos[body], force)
    np.testing.assert_allclose(loop.data.xfrc_applied[body, 3:], moment, rtol=0, atol=1e-9)


PAYLOAD = '<geom type="box" size="0.3 0.2 0.05" pos="0.2 0.1 -0.1" euler="10 20 30" mass="5"/>'
ON_TOP = '<geom type="box" size="0.1 0.08 0.06" pos="0.3 -0.1 0.12" euler="40 0 -25" mass="{}"/>'
BOX = '<mujoco><worldbody><body name="payload"><freejoint/>{}</body></worldbody></mujoco>'


def body(*geoms):
    return mujoco.MjModel.from_xml_string(BOX.format("".join(geoms)))


def inertia(model, k=1):
    R = Rotation.from_quat(model.body_iquat[k], scalar_first=True).as_matrix()
    return R @ np.diag(model.body_inertia[k]) @ R.T


def on(model, duration_s=10.0):
    index = SimpleNamespace(payload_body=1)
    return SimpleNamespace(
        model=model, data=None, index=index, rate_hz=1000, duration=round(1000 * duration_s)
    )


def effect_of(mass, **size):
    """The box on top, of MuJoCo's own inertia."""
    alone = body(ON_TOP.format(mass))
    rows, columns = np.triu_indices(3)
    names = [f"inertia_{'xyz'[i]}{'xyz'[j]}_m2" for i, j in zip(rows, columns, strict=True)]
    own = dict(zip(names, (inertia(alone)[rows, columns] / mass).tolist(), strict=True))
    at = dict(zip(("point_x_m", "point_y_m", "point_z_m"), alone.body_ipos[1].tolist(), strict=True))
    return make_effect("payload_mass", size | own | at)


def test_a_box_on_top_is_what_mujoco_makes_of_both():
    both, model = body(PAYLOAD, ON_TOP.format(0.7)), body(PAYLOAD)
    effect_of(0.7, mass_kg=0.7).load(model, on(model).index, 1)
    assert model.body_mass[1] == pytest.approx(both.body_mass[1])
    np.testing.assert_allclose(model.body_ipos[1], both.body_ipos[1], atol=1e-12)
    np.testing.assert_allclose(inertia(model), inertia(both), atol=1e-10)
    # And it moves like it.
    motion = []
    for one in (model, both):
        data = mujoco.MjData(one)
        data.qvel[:] = [0.3, -0.2, 0.1, 1.0, -2.0, 1.5]
        mujoco.mj_step(one, data, nstep=200)
        motion.append(data.qpos.copy())
    np.testing.assert_allclose(motion[0], motion[1], atol=1e-9)


def test_it_is_there_in_its_trials_only():
    effect = example("payload_mass", trial=2, last_trial=3)
    assert [len(effect.actors(number)) for number in (1, 2, 3, 4)] == [0, 1, 1, 0]
    assert [len(example("payload_mass", trial=3).actors(number)) for number in (2, 3, 9)] == [0, 1, 1]


def test_a_robot_moves_as_with_a_box_that_is_welded_on(tmp_path):
    """In a trial, against MuJoCo's own body on the payload; without either it moves otherwise."""
    at = {"point_x_m": 0.1, "point_y_m": 0.05, "point_z_m": 0.1}
    plain, changed, welded = (
        one_robot(tmp_path, *hidden)
        for hidden in ((), (make_effect("payload_mass", {"mass_kg": 0.5, "trial": 2} | at),), ())
    )
    payload = welded.root.find("body", "omnid1/payload/payload")
    box = payload.add("body", name="box", pos=list(at.values()))
    box.add("inertial", pos=[0.0, 0.0, 0.0], mass=0.5, diaginertia=[1e-9] * 3)
    motion = random_vias(plain.wrist_home_b, np.random.default_rng(0), 1, box_m=(0.03, 0.03, 0.03))
    start = round(100 * SETTLE_S)
    phi = [run_trial(scene, motion, trial_number=2).phi[start:] for scene in (plain, changed, welded)]
    assert np.abs(phi[0] - phi[2]).max() > 3e-3
    assert np.abs(phi[1] - phi[2]).max() < 1e-5
    np.testing.assert_array_equal(run_trial(changed, motion, trial_number=1).phi[start:], phi[0])

"""Forms in the simulated team, against closed forms of what they are."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from closed_loop import ClosedLoop
from mocobot_sim.effects import apply_effects
from mocobot_sim.scene.scene import build_team
from mocobot_sim.scene.soft import viscoelastic_parameters
from mocobot_sim.trial.actors import Stage
from mocobot_sim.trial.resimulate import predicted
from mocobot_sim.trial.trajectories import Trajectory, random_vias
from mocobot_sim.trial.trial import run_trial
from mocobot_sim.trial.truth import GroundTruth
from sealed.form import Form, Ground, JointTorque, PayloadWrench, PointForce
from sealed.joints import LateCreep, SingleTorqueLag, SoftPlay, TurningGrasp
from sealed.payload import (
    DoublePendulum,
    MassDrift,
    PayloadCable,
    PowerDrag,
    QuadraticDrag,
    RobotCable,
    RubberCord,
    StiffeningStrap,
    UnequalPendulum,
)
from sealed.readings import (
    AngleInTorque,
    CrossTalk,
    CyclicPhi,
    EccentricPhi,
    EccentricTheta,
    QuadraticReading,
    Saturation,
    SlippingZero,
    SoftEncoderMount,
    TorqueBacklash,
    TorqueHum,
    WarmingScale,
    WarmingZero,
)
from sealed.sets import FORMS, draw

GRAVITY = 9.81
HOME_PHI = 0.6230299772752583


def team(*effects: Form):
    return apply_effects(build_team("a"), effects)


def stage_of(loop: ClosedLoop) -> Stage:
    return Stage(loop.model, loop.data, loop.index, loop.controller, 1000.0, 10, 1000)


def step(loop: ClosedLoop, actor, seconds: float) -> None:
    """Hold the home pose while somebody acts."""
    home = loop.scene.wrist_home_b
    for tick in range(round(1000 * seconds)):
        loop.data.qfrc_applied[:] = 0.0
        loop.data.xfrc_applied[:] = 0.0
        actor.act(tick)
        loop.controller.update(home, 0.0 * home)
        mujoco.mj_step(loop.model, loop.data)
    mujoco.mj_forward(loop.model, loop.data)


@pytest.mark.parametrize("slack", [False, True])
def test_a_cable_on_the_payload_pulls_until_it_is_slack(slack):
    """Robots carry the weight less what the cable holds: k (distance - length) towards its anchor, in the world."""
    point, anchor = np.array([0.1, 0.2, 0.05]), np.array([0.3, -0.4, 1.2])
    distance = float(np.linalg.norm(anchor - point))
    length = distance + (0.02 if slack else -0.03)
    cable = PayloadCable(40.0, length, *point, *anchor)
    scene = team(cable)
    loop = ClosedLoop(scene)
    site = loop.index.payload_site[0]
    mujoco.mj_forward(loop.model, loop.data)
    R_W1, p_W1 = loop.data.site_xmat[site].reshape(3, 3).copy(), loop.data.site_xpos[site].copy()
    fixed = p_W1 + R_W1 @ anchor  # where the payload rests at home
    loop.run(1.0, scene.wrist_home_b)
    arm = fixed - loop.data.site_xpos[site] - loop.data.site_xmat[site].reshape(3, 3) @ point
    stretch = max(float(np.linalg.norm(arm)) - length, 0.0)
    assert (stretch == 0.0) is slack
    force = 40.0 * stretch * arm / np.linalg.norm(arm)
    weight = np.array([0.0, 0.0, GRAVITY * GroundTruth.of(scene).mass_kg])
    np.testing.assert_allclose(loop.forces_on_payload().sum(axis=0), weight - force, atol=2e-3)


def test_a_cable_on_a_robot_pulls_at_its_wrist():
    cable = RobotCable(2, 40.0, 0.9, 0.6, 0.0, 1.155)
    loop = ClosedLoop(team(cable))
    mujoco.mj_forward(loop.model, loop.data)
    pull = (
        40.0 * (np.hypot(0.6, 0.8) - 0.9) * np.array([0.6, 0.0, 0.8])
    )  # in {b}: the wrist is at (0, 0, 0.355)
    np.testing.assert_allclose(loop.data.qfrc_passive[loop.index.slide_dof[1]], pull, rtol=1e-6, atol=1e-9)
    assert np.abs(loop.data.qfrc_passive[loop.index.slide_dof[0]]).max() == 0.0


def test_a_strap_is_twice_as_stiff_where_a_cable_is_not():
    strap = StiffeningStrap(2, 40.0, 0.97, 0.6, 0.0, 1.155, doubled_m=0.015)
    loop = ClosedLoop(team(strap))
    mujoco.mj_forward(loop.model, loop.data)
    pull = 40.0 * 0.03 * (1.0 + 0.03 / 0.015) * np.array([0.6, 0.0, 0.8])
    np.testing.assert_allclose(loop.data.qfrc_passive[loop.index.slide_dof[1]], pull, rtol=1e-6, atol=1e-9)


def test_a_rubber_cord_gets_softer_and_then_stiffer():
    """At rest the robots hold the weight less the pull: of a stretch of 0.02 m 0.85, of 0.06 m 2.05 of Hooke's."""
    for stretch, share in ((0.02, 0.85), (0.06, 2.05)):
        cord = RubberCord(100.0, 1.0 - stretch, 0.1, 0.1, 0.1, 0.7, 0.1, 0.9)
        loop = ClosedLoop(team(cord))
        weight = np.array([0.0, 0.0, 9.81 * loop.model.body_mass[loop.index.payload_body]])
        pull = weight - loop.forces_on_payload().sum(axis=0)
        np.testing.assert_allclose(
            pull, 100.0 * stretch * share * np.array([0.6, 0.0, 0.8]), rtol=0.0, atol=5e-4 * weight[2]
        )


@pytest.mark.parametrize(
    ("kind", "angle"),
    [("driven", "phi"), ("spring", None), ("gimbal", "theta")],
    ids=["driven", "spring", "gimbal"],
)
def test_a_torque_acts_in_its_joint_alone(kind, angle):
    """Power of the torque is torque times the joint's own rate, and it gets that joint's angle and rate."""
    loop, seen = ClosedLoop(team()), []
    actor = JointTorque(kind, 2, 3, lambda q, v, t, dt: seen.append((q, v)) or 0.5)
    actor.start(stage_of(loop))
    loop.data.qvel[:] = np.random.default_rng(0).standard_normal(loop.model.nv)
    loop.data.qpos[:] += 0.01
    actor.act(0)
    index, v = loop.index, loop.data.qvel
    rates = {
        "driven": v[index.motor_dof[1, 2]] + v[index.spring_dof[1, 2]],
        "spring": v[index.spring_dof[1, 2]],
        "gimbal": v[index.gimbal_dof[1, 2]],
    }
    assert seen[0][1] == pytest.approx(rates[kind], rel=1e-12)
    assert loop.data.qfrc_applied @ v == pytest.approx(0.5 * rates[kind], rel=1e-12)
    mujoco.mj_forward(loop.model, loop.data)
    if angle == "phi":
        assert seen[0][0] == pytest.approx(loop.phi()[1, 2] - HOME_PHI, abs=1e-9)
    elif angle == "theta":
        assert seen[0][0] == loop.data.joint("omnid2/gimbal_x").qpos[0]


def test_a_wrench_gets_the_payloads_velocity():
    """Of its centre of mass, against the difference of its places."""
    scene, seen = team(), []

    class Watched:
        def actors(self, trial_number):
            return [
                PayloadWrench(lambda t, p, v, w: seen.append((t, p.copy(), v.copy(), w.copy())) or (0.0, 0.0))
            ]

        def readers(self, trial_number):
            return []

    trajectory = random_vias(scene.wrist_home_b, np.random.default_rng(1), 1)
    run_trial(replace(scene, effects=(Watched(),)), trajectory)  # pyright: ignore[reportArgumentType]
    place, velocity = (np.array([row[k] for row in seen]) for k in (1, 2))
    assert np.abs(velocity).max() > 0.05
    # Of this instant, where the place is of the step before: late rates would be an inertia.
    now = (place[2:] - place[:-2]) / 2e-3
    np.testing.assert_allclose(velocity[:-2], now, atol=2e-4 * np.abs(velocity).max())


def test_a_push_has_its_moment():
    loop = ClosedLoop(team())
    mujoco.mj_forward(loop.model, loop.data)
    point, force = np.array([0.2, -0.1, 0.3]), np.array([1.0, 2.0, -3.0])
    actor = PointForce(lambda t: force, point)
    actor.start(stage_of(loop))
    loop.data.xfrc_applied[:] = 0.0
    actor.act(0)
    site = loop.index.payload_site[0]
    R_W1, p_W1 = loop.data.site_xmat[site].reshape(3, 3), loop.data.site_xpos[site]
    R_Wb1 = loop.data.body("omnid1/base").xmat.reshape(3, 3)
    com = loop.data.xipos[loop.index.payload_body]
    wrench = loop.data.xfrc_applied[loop.index.payload_body]
    np.testing.assert_allclose(wrench[:3], R_Wb1 @ force, atol=1e-12)
    np.testing.assert_allclose(wrench[3:], np.cross(p_W1 + R_W1 @ point - com, R_Wb1 @ force), atol=1e-12)


def test_a_payload_loses_mass():
    scene = team(MassDrift(-0.1))
    loop = ClosedLoop(scene)
    (actor,) = scene.effects[0].actors(1)
    actor.start(stage_of(loop))
    step(loop, actor, 0.8)
    mass = GroundTruth.of(scene).mass_kg - 0.1 * 0.799
    assert loop.forces_on_payload().sum(axis=0)[2] == pytest.approx(GRAVITY * mass, abs=0.05)


def test_drag_of_a_power_slows_as_its_power_says():
    """Of the second power it is that of the square; of the power 1.5, twice the speed is 2^1.5 of the force."""
    v, omega = np.array([0.1, -0.2, 0.05]), np.array([0.3, 0.1, -0.2])

    def wrench(form, times=1.0):
        (actor,) = form.actors(1)
        return np.concatenate(actor._wrench(0.0, np.zeros(3), times * v, times * omega))

    np.testing.assert_allclose(wrench(PowerDrag(3.0, 2.0, 0.2)), wrench(QuadraticDrag(3.0, 0.2)), rtol=1e-12)
    form = PowerDrag(3.0, 1.5, 0.2)
    np.testing.assert_allclose(wrench(form, 2.0), 2.0**1.5 * wrench(form), rtol=1e-12)


def test_a_base_creeps_from_its_time_on():
    scene = team(LateCreep(2, 1e-4, 0.3, 0.2))
    loop = ClosedLoop(scene)
    (actor,) = scene.effects[0].actors(1)
    actor.start(stage_of(loop))
    at = [int(loop.model.joint(f"omnid2/late_{axis}").qposadr[0]) for axis in "xy"]
    step(loop, actor, 0.2)
    assert np.abs(loop.data.qpos[at]).max() < 1e-8
    step(
        loop, actor, 0.7
    )  # ticks count from zero again: it waits 0.2 s and creeps for 0.5 s, but for a start of 10 ms
    np.testing.assert_allclose(loop.data.qpos[at], 0.49e-4 * np.array([np.cos(0.3), np.sin(0.3)]), rtol=0.02)


@pytest.mark.parametrize("robot", [1, 2])
def test_a_turning_grasp_turns_by_the_moment_of_its_force(robot):
    """About a point 6 cm off the gimbal: by compliance times force times that arm, from the first step on."""
    compliance, reach, arm = 3e-6, 0.05, 0.06
    scene = team(TurningGrasp(robot, compliance, reach, arm))
    loop = ClosedLoop(scene)
    prefix = "omnid2/" if robot == 2 else "omnid1/payload/"
    at = [int(loop.model.joint(f"{prefix}turn_{axis}").qposadr[0]) for axis in "xyz"]
    before = loop.data.qpos[at].copy()
    home = scene.wrist_home_b + 0.0
    home[robot - 1, 0] += 0.02  # pulls sideways, against the others
    loop.run(0.2, scene.wrist_home_b)
    np.testing.assert_allclose(loop.data.qpos[at], before, atol=1e-6)
    loop.run(1.0, home)
    i = loop.index
    R = loop.data.site_xmat[i.payload_site[robot - 1]].reshape(3, 3)
    force = R.T @ loop.forces_on_payload()[robot - 1]
    moment = -np.cross([0.0, 0.0, -arm], force)  # what the payload puts on the grasp
    assert np.abs(moment).max() > 0.1
    np.testing.assert_allclose(loop.data.qpos[at], compliance / reach**2 * moment, rtol=0.03, atol=2e-6)


def test_play_ends_in_a_soft_contact():
    """Under its share of the weight it goes deeper than the gap by the contact's compliance times the load."""
    scene = team(SoftPlay(2, 1e-4, 2e-7, 5.0))
    loop = ClosedLoop(scene)
    (actor,) = scene.effects[0].actors(1)
    actor.start(stage_of(loop))
    step(loop, actor, 1.0)
    joint = loop.model.joint("omnid2/gap_z")
    way, load = loop.data.qpos[joint.qposadr[0]], loop.data.qfrc_constraint[joint.dofadr[0]]
    limit = [
        loop.data.efc_force[k]
        for k in range(loop.data.nefc)
        if loop.data.efc_type[k] == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT
        and loop.data.efc_id[k] == joint.id
    ]
    assert len(limit) == 1
    assert limit[0] > 5.0
    assert abs(way) - 1e-4 == pytest.approx(2e-7 * limit[0], rel=0.05)
    assert load != 0.0


@pytest.mark.parametrize(("relaxation", "off"), [(0.005, 0.07), (0.01, 0.04), (0.03, 0.04), (0.15, 0.04)])
def test_a_viscoelastic_spring_follows_its_load(relaxation, off):
    """C F (1 - exp(-t / T)), but for a fortieth, and for what steps of 1 ms leave."""
    compliance, mass, force = 3e-6, 2.0, 50.0
    solref, solimp = viscoelastic_parameters(compliance, relaxation, 1.0 / mass)
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.001" integrator="implicitfast" gravity="0 0 0" tolerance="1e-14"/><worldbody>
        <body><joint name="j" type="slide"/><inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/></body></worldbody>
        <equality><joint joint1="j" solref="{solref[0]} {solref[1]}" solimp="{" ".join(map(repr, solimp))}"/></equality>
        </mujoco>"""
    )
    data = mujoco.MjData(model)
    data.qfrc_applied[0] = force
    way = []
    for _ in range(round(5.0 * relaxation / 1e-3)):
        mujoco.mj_step(model, data)
        way.append(data.qpos[0])
    time = 1e-3 * np.arange(1, len(way) + 1)
    exact = compliance * force * (1.0 - np.exp(-time / relaxation))
    np.testing.assert_allclose(way, exact, atol=off * compliance * force)


def _swinging(scene, names: list[str], axis: str = "x") -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Inertia and stiffness of joints that swing while the rest stands still, and their torques per unit of lateral
    acceleration across the axis they swing about: MuJoCo's, its gravity."""
    model = scene.compile()
    data = mujoco.MjData(model)
    dofs = [int(model.joint(f"omnid1/payload/{name}").dofadr[0]) for name in names]
    at = [int(model.joint(f"omnid1/payload/{name}").qposadr[0]) for name in names]
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, full)
    stiffness = np.empty((len(dofs), len(dofs)))
    for k, where in enumerate(at):
        sides = []
        for side in (1e-4, -1e-4):
            data.qpos[where] = side
            mujoco.mj_forward(model, data)
            sides.append(data.qfrc_bias[dofs].copy())
        data.qpos[where] = 0.0
        stiffness[:, k] = (sides[0] - sides[1]) / 2e-4
    model.opt.gravity[:] = np.array([0.0, 1.0, 0.0]) if axis == "x" else np.array([1.0, 0.0, 0.0])
    mujoco.mj_forward(model, data)
    return full[np.ix_(dofs, dofs)], stiffness, data.qfrc_bias[dofs].copy()


def _modes(scene, names: list[str]) -> np.ndarray:
    """Frequencies of such joints [rad/s]."""
    inertia, stiffness, _ = _swinging(scene, names)
    return np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(inertia, stiffness)).real))


def test_a_double_pendulum_has_its_two_modes():
    """m1 l1 l2 w^4 - (m1 + m2) g (l1 + l2) w^2 + (m1 + m2) g^2 = 0."""
    mass, l1, share, l2 = 0.02, 0.3, 0.25, 0.2
    scene = team(DoublePendulum(mass, l1, share, l2, 0.05, 0.0, 0.0, 0.1))
    upper = (1.0 - share) * mass
    squares = np.roots([upper * l1 * l2, -mass * GRAVITY * (l1 + l2), mass * GRAVITY**2])
    for axis in "xy":
        found = _modes(scene, [f"upper_{axis}", f"lower_{axis}"])
        np.testing.assert_allclose(found, np.sqrt(np.sort(squares)), rtol=1e-3)


@pytest.mark.parametrize(("share", "l2"), [(0.25, 0.2), (0.4, 0.36), (0.15, 0.12), (1e-9, 0.2)])
def test_what_is_known_of_a_double_pendulum_is_the_mass_of_its_slow_mode(share, l2):
    """That of a mode is what it takes to shake it; what both take is the whole mass."""
    mass, l1 = 0.02, 0.3
    form = DoublePendulum(mass, l1, share, l2, 0.05, 0.0, 0.0, 0.1)
    if share > 1e-6:
        for axis in "xy":
            inertia, stiffness, driven = _swinging(team(form), [f"upper_{axis}", f"lower_{axis}"], axis)
            rates, modes = np.linalg.eig(np.linalg.solve(inertia, stiffness))
            masses = (driven @ modes) ** 2 / np.einsum("ik,ij,jk->k", modes, inertia, modes)
            assert masses.sum() == pytest.approx(mass, rel=1e-3)
            assert form.known()["mass_kg"] == pytest.approx(masses[np.argmin(rates.real)], rel=2e-3)
    else:
        assert form.known()["mass_kg"] == pytest.approx(mass, rel=1e-6)


def test_an_unequal_pendulum_has_two_frequencies():
    scene = team(UnequalPendulum(0.02, 0.3, 0.4, 0.05, 0.7, 0.0, 0.0, 0.1))
    for axis, length in (("x", 0.3), ("y", 0.12)):
        assert _modes(scene, [f"tank_{axis}"])[0] == pytest.approx(np.sqrt(GRAVITY / length), rel=1e-3)


def _read(*effects: Form):
    """Readings of ideal sensors minus what they should read, and the truth."""
    scene = team(*effects)
    log = run_trial(scene, random_vias(scene.wrist_home_b, np.random.default_rng(1), 1))
    seen = predicted(log)
    return {name: getattr(seen, name) - getattr(log, name) for name in ("phi", "theta", "tau")}, log


def _warm(time):
    return 1.0 - np.exp(-time / 3.0)


READINGS = [
    (CrossTalk(1, 1, 3.0, 0.04), "tau", lambda log: 0.04 * log.tau[:, 0, 2]),
    (WarmingScale(1, 2, 0.02, 3.0), "tau", lambda log: 0.02 * _warm(log.time) * log.tau[:, 0, 1]),
    (WarmingZero(2, 1, 0.1, 3.0), "tau", lambda log: 0.1 * _warm(log.time)),
    (Saturation(2, 2, 3.5, 0.2), "tau", lambda log: -0.2 * np.maximum(log.tau[:, 1, 1] - 3.5, 0.0)),
    (QuadraticReading(2, 3, 1e-3), "tau", lambda log: 1e-3 * log.tau[:, 1, 2] ** 2),
    (
        AngleInTorque(3, 1, 0.1, 6.0, 0.3),
        "tau",
        lambda log: 0.1 * np.sin(6 * (log.phi[:, 2, 0] - HOME_PHI) + 0.3),
    ),
    (TorqueHum(3, 2, 0.1, 2.0), "tau", lambda log: 0.1 * np.sin(4 * np.pi * log.time)),
    (EccentricPhi(1, 2, 2e-3, 0.3), "phi", lambda log: 2e-3 * np.sin(log.phi[:, 0, 1] - HOME_PHI + 0.3)),
    (CyclicPhi(2, 1, 2e-3, 0.3), "phi", lambda log: 2e-3 * np.sin(16 * (log.phi[:, 1, 0] - HOME_PHI) + 0.3)),
    (EccentricTheta(1, 3, 2e-3, 0.3), "theta", lambda log: 2e-3 * np.sin(log.theta[:, 0, 2] + 0.3)),
    (SoftEncoderMount(3, 3, 1e-3), "phi", lambda log: 1e-3 * log.tau[:, 2, 2]),
    (SlippingZero(2, 2, 1e-3), "theta", lambda log: 1e-3 * log.time),
]


def test_readings_err_as_their_laws_say():
    """At their own joints, and nowhere else."""
    errors, log = _read(*(effect for effect, _, _ in READINGS))
    exact = {name: np.zeros_like(error) for name, error in errors.items()}
    for effect, channel, law in READINGS:
        exact[channel][:, effect.robot - 1, effect.joint - 1] = law(log)
        assert np.ptp(law(log)) > 0.0, effect.cause
    for name, error in errors.items():
        np.testing.assert_allclose(error, exact[name], atol=1e-10)


def test_a_single_sensor_lags_and_a_loose_gauge_stays_within_its_play():
    """Low frequencies come 4 ms late: a phase of -omega T."""
    errors, log = _read(SingleTorqueLag(2, 1, 0.004, 0.8), TorqueBacklash(3, 1, 0.05))
    a, b = errors["tau"][:, 1, 0], errors["tau"][:, 2, 0]
    window = np.hanning(len(log.time))
    true = np.fft.rfft(window * (log.tau[:, 1, 0] - log.tau[:, 1, 0].mean()))
    read = np.fft.rfft(window * (log.tau[:, 1, 0] - log.tau[:, 1, 0].mean() + a))
    omega = 2.0 * np.pi * np.fft.rfftfreq(len(window), 0.01)
    slow = (omega > 3.0) & (omega < 30.0)
    late = -np.sum(np.imag(read * true.conj())[slow] * omega[slow]) / np.sum(
        (omega * np.abs(true))[slow] ** 2
    )
    assert late == pytest.approx(0.004, rel=0.03)
    assert np.abs(b).max() == pytest.approx(0.05, rel=1e-9)
    a[:] = b[:] = 0.0
    assert max(np.abs(error).max() for error in errors.values()) < 1e-10


@pytest.fixture(scope="module")
def ground() -> Ground:
    scene = team()
    return Ground.of(scene, [random_vias(scene.wrist_home_b, np.random.default_rng(1), 10)])


def _half_a_second(*effects: Form):
    """What ideal sensors read of a short motion."""
    time = np.arange(60) / 100.0
    ref = build_team("a").wrist_home_b + 0.01 * (1.0 - np.cos(2 * np.pi * time / 0.6))[:, None, None]
    seen = predicted(run_trial(team(*effects), Trajectory("random", ref), trial_number=3))
    return np.stack([seen.phi, seen.theta, seen.tau])


@pytest.fixture(scope="module")
def clean() -> np.ndarray:
    return _half_a_second()


@pytest.mark.slow
@pytest.mark.parametrize("name", list(FORMS))
def test_every_form_runs_and_can_be_seen(ground, clean, name):
    """Drawn at four times its limit, it changes what is recorded, though half a second shows little of some."""
    (effect,) = draw(name, 4.0, "x1", ground, np.random.default_rng([7, *name.encode()]))
    if hasattr(effect, "start_s"):
        effect = replace(effect, start_s=0.05)  # pyright: ignore[reportArgumentType]
    if hasattr(effect, "trial"):
        effect = replace(effect, trial=3)  # pyright: ignore[reportArgumentType]
    assert np.abs(_half_a_second(effect) - clean).max() > 1e-9

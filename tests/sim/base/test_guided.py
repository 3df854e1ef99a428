"""A person guides the payload: shares of its weight against statics, the hand's force against closed forms."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from mocobot_sim.control.control import ControlGains, TeamController
from mocobot_sim.guided import (
    FLOAT_GAINS,
    FloatArms,
    Grip,
    GuidingHand,
    HandLog,
    Move,
    Payload,
    PushingHand,
    weight_shares,
)
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import TeamScene, build_team
from mocobot_sim.scene.team_index import TeamIndex
from mocobot_sim.trial.actors import Stage
from mocobot_sim.trial.assemble import assemble_at_home
from mocobot_sim.trial.trajectories import RATE_HZ, Trajectory
from mocobot_sim.trial.trial import run_trial
from mocobot_sim.trial.truth import GroundTruth

G = 9.81
HANDLE = np.array([0.537, 0.156, 0.079])  # over the centre of mass of payload (a)
FIRM = Grip(20000.0, 1500.0, 2000.0, 100.0)


@pytest.fixture(scope="module")
def scene() -> TeamScene:
    return build_team("a")


@pytest.fixture(scope="module")
def truth(scene) -> Payload:
    return Payload.of_truth(GroundTruth.of(scene))


def _payload(robots: int, rng: np.random.Generator) -> Payload:
    R = Rotation.random(robots, rng).as_matrix()
    return Payload(7.0, rng.normal(size=3), rng.normal(size=(robots, 3)), R)


@pytest.mark.parametrize("robots", [3, 4, 6])
def test_shares_carry_the_weight_and_do_not_turn_it(robots):
    """Forces and moments summed up plainly, at any tilt."""
    rng = np.random.default_rng(robots)
    for _ in range(20):
        payload, up = _payload(robots, rng), Rotation.random(rng=rng).apply([0.0, 0.0, 1.0])
        forces = weight_shares(payload, up, G)[:, None] * up
        np.testing.assert_allclose(forces.sum(axis=0), 7.0 * G * up, atol=1e-9)
        moment = np.cross(payload.p_1i - payload.p_1c, forces).sum(axis=0)
        np.testing.assert_allclose(moment, 0.0, atol=1e-8 * np.abs(forces).max())


def test_shares_of_payload_a_are_those_of_statics(truth):
    """Level, against 3 x 3 equations in the plane; Table I of the paper."""
    rows = np.vstack([np.ones(3), truth.p_1i[:, 0], truth.p_1i[:, 1]])
    expected = np.linalg.solve(rows, 11.672 * G * np.array([1.0, 0.537, 0.156]))
    np.testing.assert_allclose(weight_shares(truth, [0.0, 0.0, 1.0], G), expected, rtol=1e-9)


def _run(scene, hand, arms, gains=FLOAT_GAINS, seconds=3.0) -> HandLog:
    hold = Trajectory("static", np.tile(scene.wrist_home_b, (round(seconds * RATE_HZ) + 1, 1, 1)))
    run_trial(scene, hold, gains, actors=[hand, *([arms] if arms else [])])
    return hand.log()


STAY = (Move((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0),)


@pytest.mark.parametrize(("mass_kg", "sideways_m"), [(0.0, 0.0), (11.672, 0.0), (9.0, 0.03), (13.0, -0.02)])
def test_at_rest_the_hand_carries_what_nobody_else_does(scene, truth, mass_kg, sideways_m):
    """Force (m - m_believed) g up; moment about the handle of both weights at their centres of mass."""
    believed = replace(truth, mass_kg=mass_kg, p_1c=truth.p_1c + np.array([0.0, sideways_m, 0.0]))
    log = _run(scene, GuidingHand(HANDLE, STAY, 0.0, FIRM), FloatArms(believed, fade_s=1.0))
    weight, carried = -G * np.array([0, 0, 11.672]), G * np.array([0, 0, mass_kg])
    np.testing.assert_allclose(log.force[-1], -(weight + carried), rtol=0, atol=0.05)
    # The payload hardly moves in firm hands, so the arms are those of home.
    moment = np.cross(truth.p_1c - HANDLE, weight) + np.cross(believed.p_1c - HANDLE, carried)
    np.testing.assert_allclose(log.moment[-1], -moment, rtol=0, atol=0.1)
    np.testing.assert_allclose(log.position[-1], log.intended[-1], atol=115.0 / FIRM.stiffness_N_per_m)


def test_a_tilted_payload_stays_balanced_with_the_estimate_only(scene, truth):
    """At 6 deg, forces measured at the start turn it by m g z sin(6 deg) about the plane of the grasps."""
    tilt = (Move((0.0, 0.0, 0.0), (float(np.deg2rad(6.0)), 0.0, 0.0), 1.5, 1.2),)
    frozen = _run(scene, GuidingHand(HANDLE, tilt, 1.2, FIRM), FloatArms(None), seconds=3.9)
    known = _run(scene, GuidingHand(HANDLE, tilt, 1.2, FIRM), FloatArms(truth, fade_s=0.8), seconds=3.9)
    # The constant forces act where they did: the weight is 72 mm above their plane.
    expected = 11.672 * G * 0.072 * np.sin(np.deg2rad(6.0))
    assert np.linalg.norm(frozen.moment[-1]) == pytest.approx(expected, rel=0.02)
    assert np.linalg.norm(known.moment[-1]) < 0.02
    assert np.linalg.norm(known.force[-1]) < 0.02


def test_stiff_arms_push_back_by_their_stiffness(scene):
    """Three arms of 400 N/m, moved by 30 mm."""
    move = (Move((0.03, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0, 1.0),)
    log = _run(scene, GuidingHand(HANDLE, move, 1.2, FIRM), None, ControlGains(), seconds=3.2)
    shift = log.position[-1] - log.position[100]
    np.testing.assert_allclose(log.force[-1], 3.0 * 400.0 * shift, rtol=0.01, atol=0.1)
    assert shift[0] > 0.027


def _pushed(scene, truth, gains) -> tuple[np.ndarray, np.ndarray]:
    """Impulse of a push of 8 N for 0.3 s [N s], and the velocity of the centre of mass [m/s], shapes (3,), (Q, 3)."""
    hand = PushingHand(truth.p_1c, [8.0, 0.0, 0.0], 0.2, 0.3)
    hold = Trajectory("static", np.tile(scene.wrist_home_b, (101, 1, 1)))
    log = run_trial(scene, hold, gains, actors=[hand, FloatArms(truth, fade_s=0.1)])
    com = log.p_W1 + np.einsum("qij,j->qi", log.R_W1, truth.p_1c)
    return np.sum(hand.log().force, axis=0) * 0.01, np.gradient(com, 0.01, axis=0)


def test_a_push_gives_the_momentum_of_its_impulse(scene, truth):
    """What moves is the payload, the wrists, and some of rods, links and rotors."""
    impulse, velocity = _pushed(scene, truth, replace(FLOAT_GAINS, damping_Ns_per_m=0.0))
    np.testing.assert_allclose(impulse, [0.5 * 8.0 * 0.3, 0.0, 0.0], atol=1e-9)
    design = omnid_design()
    wrists = 3.0 * design.wrist_mass_kg
    rods_and_links = 9.0 * (
        design.rod_mass_kg + (design.proximal_inertia_kgm2 + design.rotor_inertia_kgm2) / 0.17**2
    )
    moving = impulse[0] / velocity[51, 0]
    assert truth.mass_kg + wrists < moving < truth.mass_kg + wrists + rods_and_links
    assert np.abs(velocity[51, 1:]).max() < 0.02 * velocity[51, 0]


def test_left_alone_a_floating_payload_comes_to_rest(scene, truth):
    """The torque loop lags, which drives the arms a little; the damping of the floating arms is more than that."""
    _, with_damping = _pushed(scene, truth, FLOAT_GAINS)
    _, without = _pushed(scene, truth, replace(FLOAT_GAINS, damping_Ns_per_m=0.0))
    assert (np.diff(with_damping[52:-1, 0]) < 0).all()
    assert (np.diff(without[52:-1, 0]) > 0).all()


def test_there_and_back_takes_no_work_but_the_damping(scene, truth):
    """With the weight carried exactly, lifting costs nothing: work is what the arms' dampers take."""
    moves = (
        Move((0.03, 0.0, 0.04), (0.0, 0.0, 0.0), 1.0, 0.2),
        Move((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0, 0.5),
    )
    damped = replace(FLOAT_GAINS, damping_Ns_per_m=10.0)
    log = _run(
        scene, GuidingHand(HANDLE, moves, 1.0, FIRM), FloatArms(truth, fade_s=0.7), damped, seconds=3.7
    )
    moving = slice(100, None)
    work = np.sum(log.power[moving]) * 0.01
    velocity = np.gradient(log.position, 0.01, axis=0)
    lost = 3.0 * 10.0 * np.sum(velocity[moving] ** 2) * 0.01
    lifting = 11.672 * G * 0.04
    assert work == pytest.approx(lost, abs=0.01 * lifting)
    assert lost < 0.05 * lifting


def _stage(scene: TeamScene, rng: np.random.Generator) -> Stage:
    """The team in a shaken state: turned, moving, as MuJoCo has it after a forward pass."""
    model = scene.compile()
    data, index = mujoco.MjData(model), TeamIndex.of(model)
    assemble_at_home(scene, model, data, index)
    data.qpos[:] += rng.uniform(-0.1, 0.1, model.nq)
    data.qvel[:] = rng.normal(size=model.nv)
    mujoco.mj_forward(model, data)
    controller = TeamController(index, omnid_design(), FLOAT_GAINS, data)
    return Stage(model, data, index, controller, 1000.0, 10, 100)


def test_a_hands_damper_sees_the_velocity_of_its_point_and_acts_there(scene):
    """Against MuJoCo's point Jacobian, and its own way of applying a wrench at a point."""
    stage, point_1 = _stage(scene, np.random.default_rng(6)), np.array([0.3, -0.4, 0.2])
    model, data, body = stage.model, stage.data, stage.index.payload_body
    hand = GuidingHand(point_1, STAY, 1.0, Grip(0.0, 7.0, 0.0, 3.0))
    hand.start(stage)
    data.xfrc_applied[body] = 0.0
    hand.act(0)

    at = data.xpos[body] + data.xmat[body].reshape(3, 3) @ point_1
    moving, turning = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, moving, turning, at, body)
    force, moment = -7.0 * moving @ data.qvel, -3.0 * turning @ data.qvel
    np.testing.assert_allclose(hand.log().force[0], force, atol=1e-10)
    np.testing.assert_allclose(hand.log().moment[0], moment, atol=1e-10)
    expected = np.zeros(model.nv)
    mujoco.mj_applyFT(model, data, force, moment, at, body, expected)
    without = data.qfrc_smooth.copy()
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qfrc_smooth - without, expected, atol=1e-9)
    assert hand.log().power[0] == pytest.approx(force @ (moving @ data.qvel) + moment @ (turning @ data.qvel))


def test_a_hands_spring_turns_the_payload_back(scene):
    """The moment is against the rotation vector from the wanted orientation, in the world."""
    stage = _stage(scene, np.random.default_rng(7))
    data, body = stage.data, stage.index.payload_body
    turn = Rotation.from_rotvec([0.3, -0.2, 0.1])
    hand = GuidingHand(
        HANDLE, (Move((0.0, 0.0, 0.0), tuple(turn.as_rotvec()), 0.001),), 0.0, Grip(0.0, 0.0, 50.0, 0.0)
    )
    hand.start(stage)
    hand.act(50)
    np.testing.assert_allclose(hand.log().moment[0], 50.0 * turn.as_rotvec(), atol=1e-9)
    np.testing.assert_allclose(hand.log().tilt[0], -turn.as_rotvec(), atol=1e-10)
    assert data.xfrc_applied[body, 3:] @ turn.as_rotvec() > 0


def test_an_estimate_that_lacks_something_is_refused(scene, truth):
    nothing = PayloadEstimate(None, 3, "staged", None, None, None, None, None, (), (), ())
    with pytest.raises(InputError, match="the estimate has no grasps, mass, centre of mass; carrying"):
        Payload.of_estimate(nothing)


BAD = {
    "two numbers": (lambda: GuidingHand([0.0, 0.0], STAY, 0.0), "must be three finite numbers"),
    "nan": (lambda: GuidingHand([0.0, 0.0, np.nan], STAY, 0.0), "must be three finite numbers"),
    "no moves": (lambda: GuidingHand(HANDLE, (), 0.0), "moves that last longer than 0 s"),
    "no time": (
        lambda: GuidingHand(HANDLE, (Move((0, 0, 0), (0, 0, 0), 0.0),), 0.0),
        "moves that last longer than 0 s",
    ),
    "endless force": (lambda: PushingHand(HANDLE, [np.inf, 0, 0], 0.0, 1.0), "three finite forces"),
    "no duration": (lambda: PushingHand(HANDLE, [1, 0, 0], 0.0, 0.0), "duration greater than 0 s"),
    "start": (lambda: FloatArms(None, start_s=0.0), "both must be greater than 0"),
    "fade": (lambda: FloatArms(None, fade_s=-1.0), "both must be greater than 0"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_makes_no_sense_is_refused(case):
    make, sentence = BAD[case]
    with pytest.raises(InputError, match=sentence):
        make()


def test_a_payload_for_another_team_is_refused(scene, truth):
    two = replace(truth, p_1i=truth.p_1i[:2], R_1i=truth.R_1i[:2])
    with pytest.raises(InputError, match="the payload has 2 grasps; the team has 3 robots"):
        _run(scene, GuidingHand(HANDLE, STAY, 0.0), FloatArms(two))

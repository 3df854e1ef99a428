"""Formulas at a place of a team, and at a joint of a serial robot."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from effect_cases import one_robot, team_with
from estimator.arm.delta import forward_kinematics, jacobian
from estimator.errors import InputError
from mocobot_sim.effects import apply_effects, effect_from_dict, effect_to_dict
from mocobot_sim.effects.law import Law
from mocobot_sim.extended.extended import load_extended, write_extended
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import build_team
from mocobot_sim.serial.effects import ActingLaw, JointLaw, State
from mocobot_sim.trial.resimulate import predicted
from mocobot_sim.trial.trajectories import Trajectory, random_vias
from mocobot_sim.trial.trial import run_trial


def run(*effects, vias=2, payload="a"):
    scene = team_with(payload, *effects)
    return run_trial(scene, random_vias(scene.wrist_home_b, np.random.default_rng(1), vias))


def still(*effects, samples=100):
    scene = team_with("a", *effects)
    return run_trial(scene, Trajectory("static", np.tile(scene.wrist_home_b, (samples, 1, 1))))


def values_of(x, function, number=0.0, second=0.0, phase=0.0, dt=1e-3):
    step = Law("tau_1_1", function, "time", 1.0, number, second, phase).step(dt)
    return np.array([step(value) for value in x])


@pytest.mark.parametrize(
    ("function", "number", "at", "is_"),
    [
        ("constant", 0.0, -3.0, 1.0),
        ("linear", 0.0, -3.0, -3.0),
        ("square", 0.0, -3.0, 9.0),
        ("cube", 0.0, -3.0, -27.0),
        ("absolute", 0.0, -3.0, 3.0),
        ("signed_square", 0.0, -3.0, -9.0),
        ("sign", 0.5, -3.0, -1.0),
        ("sign", 0.5, 0.1, 0.2),
        ("above", 1.0, 3.0, 2.0),
        ("above", 1.0, -3.0, 0.0),
        ("below", -1.0, -3.0, -2.0),
        ("beyond", 1.0, -3.0, -2.0),
        ("beyond", 1.0, 0.5, 0.0),
        ("sine", 4.0, math.pi / 8.0, 1.0),
        ("hum", 0.25, 1.0, 1.0),
        ("warming", 2.0, 2.0, 1.0 - math.exp(-1.0)),
    ],
)
def test_functions_without_memory(function, number, at, is_):
    assert values_of([at], function, number)[0] == pytest.approx(is_, abs=1e-12)


def test_hats_of_equal_steps_add_up_to_one_and_run_through_their_knots():
    x = np.linspace(-2.0, 5.0, 200)
    names = ["first_hat", "hat", "hat", "last_hat"]
    parts = [values_of(x, name, float(k), 1.0) for k, name in enumerate(names)]
    np.testing.assert_allclose(np.sum(parts, axis=0), 1.0, atol=1e-12)
    heights = np.array([1.0, -2.0, 0.5, 3.0])
    np.testing.assert_allclose(heights @ parts, np.interp(x, np.arange(4.0), heights), atol=1e-12)


def test_play_stays_behind_by_its_half_width():
    x = np.concatenate([np.linspace(0.0, 1.0, 50), np.linspace(1.0, -1.0, 100)])
    play = values_of(x, "play", 0.2)
    assert play[0] == 0.0
    assert play[49] == pytest.approx(-1.0)  # on the way up it is behind: below
    assert play[-1] == pytest.approx(1.0)
    assert np.abs(play).max() <= 1.0 + 1e-12


def test_a_torque_that_contains_its_neighbours():
    """Reading minus truth is the share of the other reading, in log and nowhere else."""
    log = run(Law("tau_2_1", "linear", "tau_2_3", 0.04))
    reading = predicted(log)
    expected = np.zeros_like(log.tau)
    expected[:, 1, 0] = 0.04 * log.tau[:, 1, 2]
    np.testing.assert_allclose(reading.tau - log.tau, expected, atol=2e-4 * np.abs(log.tau).max())
    np.testing.assert_allclose(reading.phi, log.phi, atol=1e-9)


def test_an_eccentric_gimbal_encoder():
    log = run(Law("theta_3_2", "sine", "theta_3_2", 0.003, 1.0, 0.0, 0.7))
    expected = np.zeros_like(log.theta)
    expected[:, 2, 1] = 0.003 * np.sin(log.theta[:, 2, 1] + 0.7)
    np.testing.assert_allclose(predicted(log).theta - log.theta, expected, atol=1e-9)


def test_a_driven_encoder_is_a_function_of_the_angle_as_recorded():
    log = run(Law("phi_1_3", "square", "phi_1_3", 0.01))
    expected = 0.01 * log.phi[:, 0, 2] ** 2
    assert np.ptp(expected) > 1e-4
    np.testing.assert_allclose((predicted(log).phi - log.phi)[:, 0, 2], expected, atol=1e-9)


def test_a_torque_beside_the_spring_takes_load_off_it():
    """What springs and torque together lift with is the weight, as before: by virtual work, F = J^-T tau."""
    torque = 0.5
    before, after = (
        still(samples=300),
        still(Law("driven_torque_2_1", "constant", "time", torque), samples=300),
    )
    extra = np.zeros((3, 3))
    extra[1, 0] = torque

    def lift(log, more):
        legs = jacobian(log.phi[-1], omnid_design())
        return sum(np.linalg.solve(legs[i].T, log.tau[-1, i] + more[i])[2] for i in range(3))

    assert lift(after, extra) == pytest.approx(lift(before, 0.0 * extra), abs=0.05)
    assert abs(lift(after, 0.0 * extra) - lift(before, 0.0 * extra)) > 0.5


def test_a_force_on_the_payload_is_taken_by_the_robots():
    """A lasting force does what the push of the same force at the centre of mass does."""
    scene = build_team("b")
    body = scene.compile().body("omnid1/payload/payload")
    com = dict(zip(("point_x_m", "point_y_m", "point_z_m"), body.ipos.tolist(), strict=True))
    push = effect_from_dict(
        {
            "cause": "push",
            "parameters": {"trial": 1, "start_s": 0.0, "duration_s": 1e3, "force_y_N": 4.0, **com},
        }
    )
    a, b = (
        run(effect, payload="b", vias=1) for effect in (push, Law("payload_force_y", "constant", "time", 4.0))
    )
    np.testing.assert_allclose(a.tau, b.tau, atol=2e-3)
    assert np.abs(a.tau - run(payload="b", vias=1).tau).max() > 0.05


def test_mass_that_is_added_is_carried(tmp_path):
    """One robot holds a hanging payload: the force that its springs hold grows by that of the mass."""
    light, heavy = (
        run_trial(scene, Trajectory("static", np.tile(scene.wrist_home_b, (500, 1, 1))))
        for scene in (one_robot(tmp_path), one_robot(tmp_path, Law("payload_mass", "constant", "time", 0.4)))
    )
    lifts = [
        np.linalg.solve(jacobian(log.phi[-1, 0], omnid_design()).T, log.tau[-1, 0])[2]
        for log in (light, heavy)
    ]
    assert lifts[1] - lifts[0] == pytest.approx(0.4 * 9.81, rel=0.01)


def test_a_base_goes_where_its_law_says():
    """Grasp 2 in the world, by the payload's pose and by robot 2's joints from a base that stands still."""
    log = still(Law("base_position_2_z", "linear", "time", -1e-3), samples=200)
    p_12 = build_team("a").X_1i.translation[1]
    by_payload = log.p_W1[:, 2] + (log.R_W1 @ p_12)[:, 2]
    by_joints = forward_kinematics(log.phi[:, 1], omnid_design())[:, 2]
    apart = by_payload - by_joints
    assert (apart[-1] - apart[0]) == pytest.approx(-1e-3 * log.time[-1], rel=0.02)


def test_an_angular_momentum_in_the_payload_turns_it_sideways():
    """With a payload that turns, the robots feel -omega x h; parked, they feel nothing."""
    law = Law("payload_spin_z", "constant", "time", 0.5)
    np.testing.assert_allclose(still(law).tau, still().tau, atol=1e-6)
    assert np.abs(run(law).tau - run().tau).max() > 1e-3


def test_plain_data_and_back(tmp_path):
    law = Law("tau_2_1", "sine", "phi_2_1", 0.02, 12.0, 0.0, -0.4)
    assert effect_from_dict(effect_to_dict(law)) == law
    scene = apply_effects(build_team("a"), [law])
    write_extended(scene, [law], tmp_path / "model", {})
    assert load_extended(tmp_path / "model").effects == (law,)
    assert "tau_2_1" in (tmp_path / "model" / "README.md").read_text()


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"target": "torque 1"}, "target is 'torque 1'"),
        ({"target": "tau_1_4"}, "target is 'tau_1_4'"),
        ({"function": "exec"}, "function is 'exec'"),
        ({"of": "__import__"}, "of is '__import__'"),
        ({"of": "0.5*phi_1_1 + 2*phi"}, "of is '0.5*phi_1_1 + 2*phi'"),
        ({"of": "phi_1_1 + "}, "of is 'phi_1_1 + '"),
        ({"of": "1.2.3*phi_1_1"}, "of is '1.2.3*phi_1_1'"),
        ({"of": "1e999*phi_1_1"}, "of is '1e999*phi_1_1'"),
        ({"of": ""}, "of is ''"),
        ({"times": "phi"}, "times is 'phi'"),
        ({"function": "warming"}, "time_s and must be above 0"),
        ({"function": "hat"}, "second is 0.0"),
        ({"amplitude": math.nan}, "amplitude is nan"),
        ({"target": 3}, "target is 3; it must be text"),
    ],
)
def test_wrong_laws_are_refused(changed, said):
    good = {"target": "tau_1_1", "function": "linear", "of": "time", "amplitude": 1.0}
    with pytest.raises(InputError, match=re.escape(said)):
        Law(**(good | changed))


@pytest.mark.parametrize("target", ["tau_4_1", "base_position_4_x"])
def test_a_robot_that_is_not_there_is_refused(target):
    with pytest.raises(InputError, match="no robot 4"):
        team_with("a", Law(target, "constant", "time", 1.0))
    with pytest.raises(InputError, match="no robot 4"):
        team_with("a", Law("tau_1_1", "linear", "time + 0.5*phi_4_2", 1.0))


STATE = State(
    3.0, 1e-3, np.array([0.1, 0.2]), np.array([0.0, -0.5]), np.zeros(2), np.zeros(2), np.array([4.0, 0.0])
)


def test_a_law_remembers_within_a_run() -> None:
    """A play of 0.05 rad half width: pushed against one side, it stays behind by its half width."""
    acting = ActingLaw(JointLaw("torque_1", "play", "q_1", 2.0, 0.05))
    out = [acting.torque(replace(STATE, q=np.array([x, 0.0]))) for x in (0.0, 0.03, 0.2, 0.19)]
    assert out == pytest.approx([0.0, -1.2, -2.0, -1.6])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"target": "elbow"}, "target is 'elbow'"),
        ({"function": "power"}, "function is 'power'"),
        ({"of": "phi_2_1"}, "of is 'phi_2_1'"),
        ({"times": "q"}, "times is 'q'"),
        ({"function": "lag", "number": 0.0}, "number is 0.0"),
    ],
)
def test_laws_that_are_none(values: dict[str, object], message: str) -> None:
    good = JointLaw("torque_1", "linear", "q_1", 1.0).to_dict()
    assert JointLaw.of_dict(good, "effects.json").of == "q_1"
    with pytest.raises(InputError, match=message):
        JointLaw.of_dict(good | values, "effects.json")

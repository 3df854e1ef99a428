"""Wrenches on the payload from outside, put into an exact recording by hand."""

import itertools

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from discrepancy.candidate import Transient
from discrepancy.team.candidates import in_shapes
from discrepancy.team.causes import CAUSES, cable
from estimator.arm.delta import forward_kinematics
from estimator.arrays import inertia_parameters
from outside_wrench import check_wrench, point, relieved, reported
from recorded_team import COM, GRASPS, HOME, STEP_S
from team_case import DESIGN, assert_close, rate_of, residual_of


@pytest.mark.parametrize("robot", [0, 1, 2])
def test_tether(case, motion, robot):
    stiffness, anchor = 30.0, np.array([0.1, -0.2, 0.9])  # in {b} of the robot
    R_1i, p_1i = GRASPS[robot]
    wrist = forward_kinematics(case.signals.phi[:, robot], DESIGN)
    force = stiffness * (anchor - wrist) @ R_1i.T  # world
    lever = motion[0] @ p_1i
    values = np.append(stiffness * (anchor - HOME), stiffness)
    check_wrench(case, motion, "tether", robot, 0, {}, values, force, np.cross(lever, force))
    physical = reported(case, "tether", values)
    assert physical["stiffness_N_per_m"] == stiffness
    np.testing.assert_allclose([physical[f"anchor_{a}_m"] for a in "xyz"], anchor)


@pytest.mark.parametrize("arm", [0.0, 0.15])
def test_payload_tether(case, motion, arm):
    """Tied to the centre of mass or beside it: its lever turns with the payload, and its stiffness acts there."""
    stiffness, anchor = (30.0, np.array([0.1, -0.2, 0.9])) if not arm else (1.0, np.array([3.0, -6.0, 9.0]))
    R_b1 = GRASPS[0][0]  # {b} of robot 1 is turned like {1} at rest
    np.testing.assert_array_equal(R_b1, np.eye(3))
    tied = COM + arm * np.array([0.6, 0.8, 0.0])
    wrist = forward_kinematics(case.signals.phi[:, 0], DESIGN)
    force = stiffness * (anchor - wrist - motion[0] @ tied)  # world
    home = stiffness * (anchor - HOME - tied)
    values = np.append(home, stiffness)
    shape = dict(zip(("lever_x_m", "lever_y_m", "lever_z_m"), tied - COM, strict=True))
    moment = np.cross(motion[0] @ tied, force)
    check_wrench(case, motion, "payload_tether", 0, 0, shape, values, force, moment, 0.01)
    physical = reported(case, "payload_tether", values, shape)
    assert physical["stiffness_N_per_m"] == stiffness
    np.testing.assert_allclose([physical[f"point_{a}_m"] for a in "xyz"], tied, atol=1e-9)
    np.testing.assert_allclose([physical[f"anchor_{a}_m"] for a in "xyz"], anchor, atol=1e-9)


def cable_shape(home, anchor, length_m):
    """From where it is tied at home to where it ends, seen from the axis that it is nearest to."""
    away = anchor - home
    axis = int(np.argmax(np.abs(away)))
    turns = np.roll(away, -axis)[1:] / np.abs(away[axis])
    numbers = {"side": 2.0 * axis + (away[axis] < 0.0), "turn_1": turns[0], "turn_2": turns[1]}
    distance = np.linalg.norm(away)
    return numbers | {"stretch_m": distance - length_m, "near_per_m": 1.0 / distance}


def cable_force(stiffness, length_m, tied, anchor, stiffening=0.0):
    """Hooke's law along the line between two points, and the square of the stretch, none below its length; (Q, 3)."""
    away = anchor - tied
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    longer = np.clip(distance - length_m, 0.0, None)
    return (stiffness * longer + stiffening * longer**2) * away / distance


@pytest.mark.parametrize("toward", [*itertools.product((-1.0, 1.0), range(3))])
@pytest.mark.parametrize("slack_m", [-0.3, 0.005])
@pytest.mark.parametrize("stiffening", [None, 900.0])
def test_cable_at_a_grasp(case, motion, toward, slack_m, stiffening):
    """From every side, always tight and slack at times; near enough that it turns as the grasp moves; and a strap."""
    sign, axis = toward
    away = np.roll([sign * 0.4, 0.15, -0.2], axis)
    anchor, length_m = HOME + away, np.linalg.norm(away) + slack_m
    wrist = forward_kinematics(case.signals.phi[:, 1], DESIGN)
    R_1i, p_1i = GRASPS[1]
    force_b = cable_force(60.0, length_m, wrist, anchor, stiffening or 0.0)
    tight = force_b.any(axis=1)
    assert tight.all() if slack_m < 0.0 else tight.any() and not tight.all()
    force, shape = force_b @ R_1i.T, cable_shape(HOME, anchor, length_m)
    shape |= {"stiffens_per_m": stiffening / 60.0} if stiffening else {}
    values, moment = [0.0, 0.0, 0.0, 60.0], np.cross(motion[0] @ p_1i, force)
    # Where it becomes tight the force has a kink, and filters of torques and of forces differ.
    check_wrench(case, motion, "tether", 1, 0, shape, values, force, moment, 0.01 if slack_m < 0.0 else 0.04)
    physical = reported(case, "tether", values, shape)
    assert physical["stiffness_N_per_m"] == 60.0
    assert physical["length_m"] == pytest.approx(length_m)
    assert physical["stiffening_N_per_m2"] == pytest.approx(stiffening or 0.0)
    np.testing.assert_allclose([physical[f"anchor_{a}_m"] for a in "xyz"], anchor, atol=1e-12)


@pytest.mark.parametrize("axis", range(3))
def test_cable_of_the_payload(case, motion, axis):
    """Tied beside its centre of mass, to the point of its line that is the nearest to that."""
    away, stiffness = np.roll([-0.7, 0.2, 0.1], axis), 40.0
    tied = COM + np.roll([0.0, 0.1, -0.2], axis)
    anchor, length_m = HOME + tied + away, np.linalg.norm(away) - 0.02
    wrist = forward_kinematics(case.signals.phi[:, 0], DESIGN)
    force = cable_force(stiffness, length_m, wrist + motion[0] @ tied, anchor)  # world
    shape = cable_shape(HOME + tied, anchor, length_m)
    at_zero = np.roll(tied - COM - (tied - COM)[axis] / away[axis] * away, -axis)
    shape |= dict(zip(("offset_1_m", "offset_2_m"), at_zero[1:], strict=True))
    values, moment = [0.0, 0.0, 0.0, stiffness], np.cross(motion[0] @ tied, force)
    check_wrench(case, motion, "payload_tether", 0, 0, shape, values, force, moment, 0.04)
    physical = reported(case, "payload_tether", values, shape)
    np.testing.assert_allclose([physical[f"point_{a}_m"] for a in "xyz"], tied, atol=1e-12)
    np.testing.assert_allclose([physical[f"anchor_{a}_m"] for a in "xyz"], anchor, atol=1e-12)
    assert physical["length_m"] == pytest.approx(length_m)


def test_a_cable_that_is_tied_nowhere_near_or_behind_is_tied_within_a_room(case):
    """What the data do not tell may go anywhere; the answer does not."""
    shape = cable_shape(HOME, HOME + np.array([0.0, 0.0, 1.0]), 0.9)
    for near in (-3.0, 0.0, 1e-9, 100.0):
        physical = reported(case, "tether", [0.0, 0.0, 0.0, 5.0], shape | {"near_per_m": near})
        assert HOME[2] + 0.1 < physical["anchor_z_m"] <= HOME[2] + 20.0
        assert physical["length_m"] >= 0.0


@pytest.mark.parametrize("name", ["tether", "payload_tether"])
def test_a_cable_may_grow_into_a_strap_and_a_strap_or_a_spring_into_nothing(name):
    """As it grows it is the same cable; and it pays for what it may be."""
    cause, plain = CAUSES[name], CAUSES[name].shapes[0]
    begun = cause.further(plain)[0]
    (strap,) = cause.grown(begun)
    moved = np.array([[0.01, -0.02, 0.03], [-0.04, 0.01, 0.0]])
    np.testing.assert_array_equal(cable.pull(strap, moved), cable.pull(begun, moved))
    assert not cause.grown(strap)
    assert not cause.grown(plain)
    assert cause.alike(strap) > cause.alike(begun)


def test_ways_of_a_cable_begin_everywhere():
    """No direction is further from one of them than 35 deg, and a tether's point is on the line of each."""
    ways = [cable.direction(way) for way in cable.first_ways()]
    rng = np.random.default_rng(3)
    anywhere = rng.standard_normal((5000, 3))
    nearest = np.max(anywhere @ np.transpose(ways), axis=1) / np.linalg.norm(anywhere, axis=1)
    assert np.degrees(np.arccos(nearest.min())) < 35.0
    at = np.array([0.3, -0.2, 0.1])
    plain = dict(zip(("lever_x_m", "lever_y_m", "lever_z_m"), at, strict=True))
    begun = CAUSES["payload_tether"].further(plain)
    assert len(begun) == len(ways) * len(cable.CABLE_STRETCHES_M)
    for shape in begun:
        np.testing.assert_allclose(np.cross(at - cable.lever(shape), cable.direction(shape)), 0.0, atol=1e-12)
        assert CAUSES["payload_tether"].alike(shape) > CAUSES["payload_tether"].alike(plain)


@pytest.mark.parametrize(
    ("along", "turning", "squares"),
    [
        (5.0, 0.0, None), (0.0, 3.0, None), (5.0, 3.0, None), (5.0, 3.0, (0.0, 0.0)), (0.0, 0.0, (40.0, 0.0)),
        (1.0, 0.0, (0.0, 20.0)),
    ],
)  # fmt: skip
def test_drag(case, motion, along, turning, squares):
    """With the speeds, and with their squares where its shape has these."""
    ahead, behind = (
        Rotation.from_euler("xyz", case.path(case.signals.time + h)[:, :3]) for h in (STEP_S, -STEP_S)
    )
    omega = (ahead * behind.inv()).as_rotvec() / (2.0 * STEP_S)  # world
    linear, turning_squared = squares or (0.0, 0.0)
    speed, rate = (np.linalg.norm(x, axis=1)[:, None] for x in (motion[2], omega))
    force = -(along + linear * speed) * motion[2]
    moment = np.cross(motion[0] @ COM, force) - (turning + turning_squared * rate) * omega
    shape = {} if squares is None else {"powers": 2.0}
    values = [along, turning, linear, turning_squared]
    check_wrench(case, motion, "drag", 0, 0, shape, values, force, moment)


def test_push(case, motion):
    """The window's edges fall into the filters: what counts is the force in between."""
    time = case.signals.time
    window = ((time >= 6.0) & (time < 9.0))[:, None]
    applied, at = np.array([2.0, -1.0, 3.0]), np.array([0.8, 0.4, -0.1])
    force = applied * window
    moment = np.cross(motion[0] @ at, force)
    samples = motion[0].swapaxes(1, 2)
    shape = {"start_s": 5.995, "duration_s": 3.0}  # a sample stands for half of its time before it
    columns = CAUSES["push"].columns(case.linear, 0, 0, shape)
    changed = residual_of(case, relieved(case, motion, force, moment)) - case.linear.residual
    # The moment columns are constant in {1}, the point is fixed there: the force turns a little in between.
    in_1 = np.einsum("qij,qj->qi", samples, np.tile(applied, (len(time), 1)))
    moments = np.cross(at, in_1)
    values = np.append(applied, moments[(time >= 6.0) & (time < 9.0)].mean(axis=0))
    assert_close(columns @ values, changed, 0.12)
    np.testing.assert_allclose((columns @ values)[:, 12:15], changed[:, 12:15], atol=0.15)
    # As far as the payload is level, the reported point lies on the line of action.
    physical = reported(case, "push", np.append(applied, np.cross(at, applied)), shape, 2)
    named = np.array([physical[f"point_{a}_m"] for a in "xyz"])
    np.testing.assert_allclose(np.cross(named - at, applied), 0.0, atol=1e-9)
    assert (named - COM) @ applied == pytest.approx(0.0, abs=1e-9)
    assert (physical["trial"], physical["start_s"], physical["duration_s"]) == (2, 5.995, 3.0)
    np.testing.assert_allclose([physical[f"force_{a}_N"] for a in "xyz"], applied)


@pytest.mark.parametrize("ramp_s", [0.6, 1.5])
def test_push_with_ramps(case, motion, ramp_s):
    """A trapezium by its corners; with half its duration a triangle."""
    time, corners = case.signals.time, [6.0, 6.0 + ramp_s, 9.0 - ramp_s, 9.0]
    window = np.interp(time, corners, [0.0, 1.0, 1.0, 0.0])[:, None]
    applied, at = np.array([2.0, -1.0, 3.0]), COM
    force = applied * window
    shape = Transient(0, 6.0, 3.0, ramp_s).shape
    columns = CAUSES["push"].columns(case.linear, 0, 0, shape)
    moment = np.cross(motion[0] @ at, force)
    changed = residual_of(case, relieved(case, motion, force, moment)) - case.linear.residual
    assert_close((columns[..., :3] @ applied)[:, :15], changed[:, :15], 0.02)
    assert reported(case, "push", np.append(applied, np.cross(at, applied)), shape, 2)["ramp_s"] == ramp_s
    assert reported(case, "push", np.ones(6), {"start_s": 6.0, "duration_s": 3.0}, 2)["ramp_s"] == 0.0


@pytest.mark.parametrize("shape", [{"trial": 2.0, "last_trial": 0.0}, {"over_s": 60.0}])
def test_payload_mass(case, motion, shape):
    """A body that rides along: Newton at its centre, and Euler by its momentum, differentiated in the world."""
    time, R = case.signals.time, motion[0]
    mass, at = 0.8, COM + np.array([0.15, -0.1, 0.08])
    own = np.array([[0.02, 0.003, 0.0], [0.003, 0.03, -0.002], [0.0, -0.002, 0.015]])  # of all of it
    there = (time / 60.0 if "over_s" in shape else np.ones_like(time))[:, None]
    accel = make_interp_spline(time, point(motion, at), k=5).derivative(2)(time)
    R_dot = make_interp_spline(time, R, k=5).derivative(1)(time)
    turn = R_dot @ R.swapaxes(1, 2)
    omega = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1)
    spin = np.einsum("qij,jk,qlk,ql->qi", R, own, R, omega)
    force = -mass * there * (accel + np.array([0.0, 0.0, DESIGN.gravity_mps2]))
    moment = np.cross(R @ at, force) - there * make_interp_spline(time, spin, k=5).derivative(1)(time)
    d = at - COM
    of_points = d @ d * np.eye(3) - np.outer(d, d)  # what first moments about COM leave of the inertia
    values = np.concatenate([[mass], mass * d, inertia_parameters(own + mass * of_points)])
    check_wrench(case, motion, "payload_mass", 0, 0, shape, values, force, moment, 0.01)
    physical = reported(case, "payload_mass", values, shape)
    np.testing.assert_allclose([physical[f"point_{a}_m"] for a in "xyz"], at)
    named = [physical[f"inertia_{ij}_m2"] for ij in ("xx", "xy", "xz", "yy", "yz", "zz")]
    np.testing.assert_allclose(named, inertia_parameters(own) / mass, atol=1e-12)
    size = (physical["mass_kg"], physical["rate_kgps"], physical["trial"])
    assert size == ((0.0, mass / 60.0, 1) if "over_s" in shape else (mass, 0.0, 2))


def test_a_mass_is_there_in_its_trials_only():
    every = CAUSES["payload_mass"].candidate({}, {"trial": 2.0, "last_trial": 0.0})
    drift = CAUSES["payload_mass"].candidate({}, CAUSES["payload_mass"].shapes[0])
    assert [drift.acts_in(t) for t in range(3)] == [True] * 3
    assert [every.acts_in(t) for t in range(4)] == [False, True, True, True]
    assert every.of_trials
    assert not drift.of_trials

    def spans(trials):
        shapes = [drift, *in_shapes(drift, CAUSES["payload_mass"].shapes, trials)]
        return [tuple(s.acts_in(t) for t in range(trials)) for s in shapes]

    assert spans(1) == [(True,)]
    for trials in (2, 3, 4, 5):  # each span of trials that leaves out the first, once
        first_and_last = [(a, b) for a in range(1, trials) for b in range(a, trials)]
        expected = {tuple(a <= t <= b for t in range(trials)) for a, b in first_and_last}
        assert sorted(spans(trials)[1:]) == sorted(expected)


@pytest.mark.parametrize("joint", [0, 1, 2])
@pytest.mark.parametrize("robot", [0, 2])
def test_gimbal_friction(case, motion, robot, joint):
    """The moment on the payload has -torque about the rubbing axis and nothing about the other two."""
    theta = case.signals.theta[:, robot]
    rate = rate_of(theta[:, joint])
    torque = 0.03 * np.clip(rate / 1e-3, -1, 1) + 0.2 * rate
    turn_z = Rotation.from_euler("Z", theta[:, :1])
    turn_zy = Rotation.from_euler("ZY", theta[:, :2])
    ones = np.ones((len(theta), 1))
    axes = np.stack(
        [ones * [0.0, 0.0, 1.0], turn_z.apply([0.0, 1.0, 0.0]), turn_zy.apply([1.0, 0.0, 0.0])], axis=1
    )  # in {b}
    moment_b = np.linalg.solve(axes, -torque[:, None, None] * np.eye(3)[joint][:, None])[..., 0]
    moment = moment_b @ GRASPS[robot][0].T
    shape = {"slow_rad_per_s": 1e-3}
    check_wrench(
        case, motion, "gimbal_friction", robot, joint, shape, [0.03, 0.2], 0.0 * moment, moment, 0.05
    )

"""Causes outside the sensors, put into an exact recording by hand: wrenches on the payload, displaced frames."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from discrepancy.candidate import Transient
from discrepancy.team.candidates import in_shapes, shape_steps
from discrepancy.team.causes import CAUSES
from discrepancy.team.causes.base import Context
from discrepancy.team.linear.trial_linear import linearise
from estimator.arm.delta import forward_kinematics, inverse_kinematics, jacobian, leg_geometry
from estimator.arm.dynamics import arm_torque
from estimator.inertia import inertia_parameters
from estimator.rigid_team.residual import balance
from recorded_team import COM, GRASPS, HOME, STEP_S, as_matrix, derivatives
from team_case import DESIGN, exact, residual_of
from test_team_causes import assert_close, rate_of


@pytest.fixture(scope="module")
def case():
    return exact()


@pytest.fixture(scope="module")
def motion(case):
    """Attitude R of the payload in the world, position and velocity of its centre of mass, twist in {1}."""
    x = case.path(case.signals.time[:, None] + STEP_S * np.arange(-4, 5))
    R, v = as_matrix("xyz", x[:, 4, :3]), derivatives(x)[1][:, 3:]
    return R, x[:, 4, 3:] + COM, v


def point(motion, r):
    """World position of the payload's point r (in {1})."""
    R, c, _ = motion
    return c + R @ (r - COM)


def relieved(case, motion, force, moment):
    """Torques once an outside wrench (world axes, about {1}'s origin in the payload) takes part of the load."""
    R, _, _ = motion
    wrench = np.concatenate([np.einsum("qji,qj->qi", R, x) for x in (force, moment)], axis=1)
    grasp = np.block(
        [[np.eye(3)] * 3, [np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) for _, (x, y, z) in GRASPS]]
    )
    less = (-wrench @ np.linalg.pinv(grasp).T).reshape(-1, 3, 3)  # of the robots' forces, in {1}
    tau = case.signals.tau.copy()
    for i, (R_1i, _) in enumerate(GRASPS):
        in_b = np.einsum("qij,qj->qi", R, less[:, i]) @ R_1i  # {b_i} is turned like {i} at rest
        tau[:, i] += np.einsum("qij,qi->qj", jacobian(case.signals.phi[:, i], DESIGN), in_b)
    return replace(case.signals, tau=tau)


def check_wrench(case, motion, name, robot, joint, shape, values, force, moment, tolerance=0.01):
    changed = residual_of(case, relieved(case, motion, force, moment)) - case.linear.residual
    column = CAUSES[name].columns(case.linear, robot, joint, shape)
    np.testing.assert_array_equal(column[:, :12], 0.0)
    assert np.abs(changed[:, 12:]).max() > 1e-3
    assert_close(column @ values, changed, tolerance)


def reported(case, name, values, shape=None, trial=None):
    context = Context(COM, DESIGN.home_height_m, shape or {}, trial)
    return CAUSES[name].physical(np.asarray(values), context)


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


def turning(motion, time):
    """Angular velocity of the payload in {b1}, its pose differentiated."""
    R_dot = make_interp_spline(time, motion[0], k=5).derivative(1)(time)
    turn = R_dot @ motion[0].swapaxes(1, 2)
    return np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1)


def swinging(time, accel, lengths_m, damping, fixed):
    """Lagrange's equations of a mass on a bowl z(x, y), by Runge-Kutta: a sphere to fourth order, if lengths are alike.

    Args:
        time: shape (Q,).
        accel: of the bowl's lowest point along two level ways and upwards, by time, shape (3,).
        lengths_m: radii of curvature along the ways.
        damping: ratio of small swings.
        fixed: speeds along the ways that the damper does not resist, by time, shape (2,).

    Returns:
        speeds and accelerations along the ways and upwards, shape (Q, 3) each.
    """
    lengths, mean = np.array(lengths_m), np.mean(lengths_m)
    w = np.sqrt(DESIGN.gravity_mps2 / lengths)

    def moved(t, q, v):
        a, share = accel(t), 1.0 + np.sum(q**2 / lengths) / (2.0 * mean)
        slope, own = q / lengths * share, q / lengths
        bend = v @ (np.diag(share / lengths) + np.outer(own, own) / mean) @ v
        pull = -a[:2] - slope * (DESIGN.gravity_mps2 + a[2] + bend) - 2.0 * damping * w * (v - fixed(t))
        way = np.linalg.solve(np.eye(2) + np.outer(slope, slope), pull)
        return np.append(v, slope @ v), np.append(way, slope @ way + bend)

    def rate(t, y):
        return np.append(y[2:], moved(t, y[:2], y[2:])[1][:2])

    y = solve_ivp(rate, (0.0, time[-1]), np.zeros(4), t_eval=time, rtol=1e-9, atol=1e-12).y.T
    each = [moved(t, q[:2], q[2:]) for t, q in zip(time, y, strict=True)]
    return np.array([v for v, _ in each]), np.array([a for _, a in each])


def test_slosh(case, motion):
    """A pendulum under a moving point; the columns take it near the centre."""
    mass, at, shape = 0.4, COM + np.array([0.02, -0.03, 0.01]), {"length_m": 0.2, "damping_ratio": 0.05}
    time, up = case.signals.time, np.array([0.0, 0.0, 1.0])
    accel = make_interp_spline(time, point(motion, at), k=5).derivative(2)
    w = np.sqrt(DESIGN.gravity_mps2 / shape["length_m"])
    # To the payload.
    fixed = make_interp_spline(time, 0.2 * np.cross(up, turning(motion, time))[:, :2], k=3)
    speed, swung = swinging(time, accel, (0.2, 0.2), 0.05, fixed)
    force = -mass * swung
    behind = np.column_stack([speed[:, :2] - fixed(time), np.zeros(len(time))])
    damped = np.cross([0.0, 0.0, -0.2], 2 * 0.05 * w * mass * behind)  # it pulls at the mass
    values = np.append(mass, mass * (at - COM))
    moment = np.cross(motion[0] @ at, force) + damped
    check_wrench(case, motion, "slosh", 0, 0, shape, values, force, moment, 0.03)
    physical = reported(case, "slosh", values, shape)
    np.testing.assert_allclose([physical[f"point_{a}_m"] for a in "xyz"], at)
    assert physical["mass_kg"] == mass


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


def test_a_mass_is_there_and_within_reach():
    se = np.full(10, 1e-3)

    def possible(mass, moment):
        return CAUSES["payload_mass"].possible(np.array([mass, moment, *np.zeros(8)]), se, {})

    assert possible(-0.02, 0.01)
    assert not possible(1.5e-3, 0.0)
    assert not possible(0.02, 0.05)  # 2.5 m from the centre


@pytest.mark.parametrize(("second_m", "share"), [(0.08, 0.3), (0.5, 0.4)])
def test_slosh_of_a_second_pendulum(case, motion, second_m, share):
    """Beside the first: what two of one mode do, each with its share of the mass."""
    mass, moments = 0.4, 0.4 * np.array([0.02, -0.03, 0.01])
    plain = {"length_m": 0.2, "damping_ratio": 0.05}
    values = np.append(mass, moments)

    def of(shape):
        return CAUSES["slosh"].columns(case.linear, 0, 0, shape) @ values

    both = (1.0 - share) * of(plain) + share * of(plain | {"length_m": second_m})
    np.testing.assert_allclose(
        of(plain | {"second_length_m": second_m, "second_share": share}), both, atol=1e-9
    )


@pytest.mark.parametrize(("across_m", "heading"), [(0.08, 0.4), (0.45, -1.0)])
def test_slosh_of_two_lengths(case, motion, across_m, heading):
    """Along one level direction the mass hangs from one point, across from another below or above.

    Its weight acts where both are; a mass that rides along rigidly at the first point is the payload's own.
    """
    mass, length_m, damping = 0.4, 0.2, 0.05
    at, time, R = COM + np.array([0.02, -0.03, 0.01]), case.signals.time, motion[0]
    along = R @ [np.cos(heading), np.sin(heading), 0.0]
    along[:, 2] = 0.0
    along /= np.linalg.norm(along, axis=1)[:, None]
    across = np.cross([0.0, 0.0, 1.0], along)
    upper, gravity = make_interp_spline(time, point(motion, at), k=5).derivative(2)(time), DESIGN.gravity_mps2
    omega, ways, lengths = turning(motion, time), (along, across), (length_m, across_m)
    drops = (0.0, length_m - across_m)
    accels, fixed = [], []
    for way, own_m, below in zip(ways, lengths, drops, strict=True):
        own = make_interp_spline(time, point(motion, at - [0.0, 0.0, below]), k=5).derivative(2)(time)
        accels.append(np.sum(way * own, axis=1))
        fixed.append(own_m * np.sum(np.cross(way, [0.0, 0.0, 1.0]) * omega, axis=1))
    driven = make_interp_spline(time, np.column_stack([*accels, upper[:, 2]]), k=3)
    held = make_interp_spline(time, np.column_stack(fixed), k=3)
    speed, swung = swinging(time, driven, lengths, damping, held)
    force = -mass * swung[:, 2:] * [0.0, 0.0, 1.0]
    moment = np.cross(R @ at, force)
    for k, (way, own_m, below) in enumerate(zip(ways, lengths, drops, strict=True)):
        damper = 2 * damping * np.sqrt(gravity / own_m) * (speed[:, k] - fixed[k])
        moment += mass * own_m * damper[:, None] * np.cross(way, [0.0, 0.0, 1.0])
        pull = -mass * (swung[:, k] + accels[k])[:, None] * way  # swinging and carried along
        force = force + pull
        moment += np.cross(R @ (at - [0.0, 0.0, below]), pull) + np.cross(
            np.sum(R @ [0.0, 0.0, -below] * way, axis=1)[:, None] * way, [0.0, 0.0, -mass * gravity]
        )
    rigid = -mass * upper * [1.0, 1.0, 0.0]
    values = np.append(mass, mass * (at - COM))
    shape = {
        "length_m": length_m,
        "damping_ratio": damping,
        "across_length_m": across_m,
        "heading_rad": heading,
    }
    check_wrench(
        case, motion, "slosh", 0, 0, shape, values, force - rigid, moment - np.cross(R @ at, rigid), 0.04
    )
    assert reported(case, "slosh", values, shape)["across_length_m"] == across_m


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


# Displaced frames: the payload moves as it does and feels the same forces; the robot's joints adapt.


def adapted(case, robot, displaced, turned=None, up=(0.0, 0.0, 1.0)):
    """Signals of a robot whose wrist is displaced in its {b} (Q, 3), whose gimbal sees another attitude."""
    s = case.signals
    phi, theta, tau = (x[:, robot] for x in (s.phi, s.theta, s.tau))
    force = np.linalg.solve(
        np.swapaxes(jacobian(phi, DESIGN), 1, 2), (tau - own_torque(phi, (0.0, 0.0, 1.0)))[..., None]
    )[..., 0]
    h, R = forward_kinematics(phi, DESIGN), Rotation.from_euler("ZYX", theta)
    if turned is not None:
        h, R, force = turned.apply(h), turned * R, turned.apply(force)
    new = inverse_kinematics(h + displaced, DESIGN)
    loaded = np.einsum("qij,qi->qj", jacobian(new, DESIGN), force) + own_torque(new, up)
    out = {"phi": new, "theta": R.as_euler("ZYX"), "tau": loaded}
    changed = {}
    for name, values in out.items():
        changed[name] = getattr(s, name).copy()
        changed[name][:, robot] = values
    return replace(s, **changed)


def own_torque(phi, up):
    """Weight of the arm on its joints, as the slope of its potential energy."""

    def energy(phi):
        legs = leg_geometry(phi, DESIGN)
        knees = legs.h[:, None] - legs.rod  # platform joints shifted onto the wrist
        share = DESIGN.proximal_com_m / DESIGN.proximal_length_m
        moved = (DESIGN.wrist_mass_kg + 1.5 * DESIGN.rod_mass_kg) * legs.h
        moved = moved + (DESIGN.proximal_mass_kg * share + 0.5 * DESIGN.rod_mass_kg) * knees.sum(axis=1)
        return DESIGN.gravity_mps2 * moved @ np.asarray(up)

    step = 1e-5
    return np.stack(
        [(energy(phi + step * e) - energy(phi - step * e)) / (2 * step) for e in np.eye(3)], axis=1
    )


def test_weight_of_the_arm_is_that_of_the_estimator(case):
    phi = case.signals.phi[::50, 0]
    still = np.zeros_like(phi)
    np.testing.assert_allclose(own_torque(phi, (0, 0, 1)), arm_torque(phi, still, still, DESIGN), atol=1e-7)


def check_pose(case, signals, column, values, tolerance=0.01, balance_tolerance=0.03, moment=None):
    """``moment``: what the balance lacks about {1}, where a force acts elsewhere than is thought, shape (Q, 3)."""
    changed = residual_of(case, signals) - case.linear.residual
    got = column @ np.asarray(values)
    assert np.abs(changed[:, :12]).max() > 1e-6
    assert_close(got[:, :12], changed[:, :12], tolerance)
    # The payload's motion is taken from all wrists, so it is a little wrong. The joints carry their load at another
    # angle, but that the poses tell.
    data = linearise(signals, case.shared, case.bases, DESIGN, case.reduction, full=False).data
    data = replace(data, wrench=case.linear.data.wrench)
    moved = case.reduction(balance(data, case.shared)[0]) - case.linear.residual[:, 12:]
    if moment is not None:
        moved[:, 3:] -= case.reduction(moment)
    np.testing.assert_allclose(got[:, 12:], moved, atol=balance_tolerance * np.abs(moved).max() + 1e-7)


def test_a_base_that_crept_before_a_later_part_of_a_recording_creeps_on(case):
    """The part keeps the recording's clock; how far the base is by then is in its own place."""
    cause, late = CAUSES["base_creep"], replace(case.signals, time=case.signals.time + 180.0)
    later = replace(case.linear, signals=late)
    whole, begun = (cause.columns(later, 1, 0, shape) for shape in ({}, {"start_s": 170.0}))
    moved = begun - whole
    gone = case.linear.of_pose(
        1, None, np.outer(np.full(len(late.time), 10.0), case.bases.R[1] @ np.eye(3)[0])
    )
    np.testing.assert_allclose(moved[..., 0], gone, atol=1e-6 * np.abs(begun).max())


@pytest.mark.parametrize("start_s", [0.0, 4.3])
@pytest.mark.parametrize("robot", [0, 1, 2])
def test_base_creep(case, robot, start_s):
    """The base gets ahead by v t, or from its start on; its wrist then lies back in {b}."""
    v = np.array([4e-6, -3e-6])
    time = case.signals.time
    gone = np.append(v, 0.0) * np.clip(time - start_s, 0.0, None)[:, None]
    shape = {"start_s": start_s} if start_s else {}
    column = CAUSES["base_creep"].columns(case.linear, robot, 0, shape)
    assert reported(case, "base_creep", v, shape) == {"x_mps": 4e-6, "y_mps": -3e-6, "start_s": start_s}
    check_pose(case, adapted(case, robot, -gone), column, v)


def force_of(case, robot):
    """On the payload, in {i} and in {b}."""
    f = case.carried.wrench[:, robot, 3:]
    return f, Rotation.from_euler("ZYX", case.signals.theta[:, robot]).apply(f)


def following(case, force, relaxation_s, inertia_s2=0.0):
    """Where a spring of 1 N/m beside a damper is under a force (Q, 3), at rest before: integrated step by step."""
    time = case.signals.time

    def rate(t, x):
        left = [np.interp(t, time, f) for f in force.T] - x[:3]
        if not inertia_s2:
            return left / relaxation_s
        return np.concatenate([x[3:], (left - relaxation_s * x[3:]) / inertia_s2])

    start = np.concatenate([force[0], np.zeros(3 if inertia_s2 else 0)])
    solved = solve_ivp(rate, (time[0], time[-1]), start, t_eval=time, rtol=1e-6, atol=1e-4, max_step=0.02)
    return solved.y.T[:, :3]


@pytest.mark.parametrize(("robot", "relaxation_s"), [(0, 0.03), (1, 0.03), (2, 0.2)])
def test_grasp_flex(case, robot, relaxation_s):
    """The payload hangs back against the force on it, so the flange leads by compliance times force.

    The spring turns with the grasp: where that turns under a constant weight, the spring follows late.
    """
    c = 2e-6
    R = Rotation.from_euler("ZYX", case.signals.theta[:, robot])
    signals = adapted(case, robot, c * R.apply(following(case, force_of(case, robot)[0], relaxation_s)))
    column = CAUSES["grasp_flex"].columns(case.linear, robot, 0, {"relaxation_s": relaxation_s})
    check_pose(case, signals, column, [c, 0.0], 0.02)


@pytest.mark.parametrize(("robot", "offset_m"), [(0, 0.06), (1, 0.06), (2, -0.04)])
def test_a_grasp_that_turns(case, robot, offset_m):
    """By turning times the moment of its force about a point beside the gimbal, which reads the flange's attitude."""
    turning, relaxation_s = 5e-4, 0.02
    R = Rotation.from_euler("ZYX", case.signals.theta[:, robot])
    force = turning * R.apply(following(case, force_of(case, robot)[0], relaxation_s))
    arm = R.apply([0.0, 0.0, -offset_m])  # from the point to where the force acts
    turned = Rotation.from_rotvec(-np.cross(arm, force))  # of the payload against the flange
    signals = adapted(case, robot, arm - turned.apply(arm))
    theta = signals.theta.copy()
    theta[:, robot] = (turned.inv() * R).as_euler("ZYX")
    changed = residual_of(case, replace(signals, theta=theta)) - case.linear.residual
    shape = {"relaxation_s": relaxation_s, "offset_m": offset_m}
    column = CAUSES["grasp_flex"].columns(case.linear, robot, 0, shape) @ [0.0, turning * abs(offset_m)]
    assert np.abs(changed[:, :12]).max() > 1e-4
    assert_close(column[:, :12], changed[:, :12], 0.02)
    assert_close(column[:, 12:], changed[:, 12:], 0.1)


def test_a_grasp_without_a_point_to_turn_about_does_not_turn(case):
    cause = CAUSES["grasp_flex"]
    healthy = cause.candidate({"compliance_m_per_N": 1e-7, "turning_rad_per_N": 1e-6}, cause.shapes[0], 2)
    columns = cause.columns(case.linear, 1, 0, healthy.shape)
    assert columns[..., 0].any()
    assert not columns[..., 1].any()
    assert cause.physical(np.array([2e-6, 4e-5]), SimpleNamespace(shape=healthy.shape)) == {
        "compliance_m_per_N": 2e-6, "turning_rad_per_N": 0.0, "relaxation_s": 0.005, "offset_m": 0.0,
    }  # fmt: skip
    assert cause.possible(np.array([2e-6, 0.0]), np.array([1e-7, 0.0]), healthy.shape)
    turning = next(
        c for c in in_shapes(healthy, CAUSES[healthy.cause].shapes, 1) if c.shape.get("offset_m", 0.0) < 0.0
    )
    assert cause.physical(np.array([2e-6, 4e-5]), SimpleNamespace(shape=turning.shape)) == {
        "compliance_m_per_N": 2e-6, "turning_rad_per_N": 4e-5, "relaxation_s": 0.005, "offset_m": -0.05,
    }  # fmt: skip
    # Steps and finer shapes stay on their side of the gimbal.
    assert all(less.shape["offset_m"] < 0.0 for less, _, size in shape_steps(turning) if size > 0.0)
    finer = sorted(
        {c.shape["offset_m"] for c in in_shapes(turning, CAUSES[turning.cause].finer(turning.shape), 1)}
    )
    assert finer == pytest.approx([-0.1, -0.07, -0.05, -0.035, -0.025])


@pytest.mark.parametrize(("robot", "contact_per_N"), [(0, 0.0), (1, 0.0), (1, 0.02)])
def test_grasp_play(case, robot, contact_per_N):
    play = 2e-5
    f = force_of(case, robot)[0]
    ahead = play * (np.clip(f / 0.4, -1.0, 1.0) + contact_per_N * f)
    signals = adapted(case, robot, Rotation.from_euler("ZYX", case.signals.theta[:, robot]).apply(ahead))
    shape = {"force_N": 0.4, "contact_per_N": contact_per_N}
    column = CAUSES["grasp_play"].columns(case.linear, robot, 0, shape)
    R_1i = case.shared.grasps.R_1i[robot]
    # The force acts where the wrist is, which is ahead of where it holds the payload.
    check_pose(case, signals, column, [play], 0.02, moment=np.cross(ahead @ R_1i.T, f @ R_1i.T))


@pytest.mark.parametrize(
    ("robot", "relaxation_s", "inertia_s2"),
    [(0, 0.2, 0.0), (1, 0.01, 0.0), (2, 0.03, 0.0), (0, 0.06, 1e-3), (1, 0.03, 2e-3)],
)
def test_base_compliance(case, robot, relaxation_s, inertia_s2):
    """The force on the base is what payload and arm's bodies do not keep for their own acceleration."""
    c = 1e-5
    phi = case.signals.phi[:, robot]
    legs = leg_geometry(phi, DESIGN)
    knees = legs.h[:, None] - legs.rod
    share = DESIGN.proximal_com_m / DESIGN.proximal_length_m
    moved = (DESIGN.wrist_mass_kg + 1.5 * DESIGN.rod_mass_kg) * legs.h
    moved = moved + (DESIGN.proximal_mass_kg * share + 0.5 * DESIGN.rod_mass_kg) * knees.sum(axis=1)
    on_base = -(force_of(case, robot)[1] + rate_of(rate_of(moved))) * [1.0, 1.0, 0.0]
    signals = adapted(case, robot, -c * following(case, on_base, relaxation_s, inertia_s2))
    shape = {"relaxation_s": relaxation_s} | ({"inertia_s2": inertia_s2} if inertia_s2 else {})
    column = CAUSES["base_compliance"].columns(case.linear, robot, 0, shape)
    # Twice differentiated, what the two know differently of the arm's own acceleration counts for more.
    check_pose(case, signals, column, [c], 0.03, 0.12)


@pytest.mark.parametrize("robot", [0, 1, 2])
@pytest.mark.parametrize("axis", [0, 1])
def test_base_tilt(case, robot, axis):
    """{b} is turned about its place on the floor: wrist, gimbal and the vertical turn back in it."""
    angle = 3e-4
    back = Rotation.from_rotvec(-angle * np.eye(3)[axis])
    signals = adapted(case, robot, np.zeros(3), back, back.apply([0.0, 0.0, 1.0]))
    changed = residual_of(case, signals) - case.linear.residual
    column = CAUSES["base_tilt"].columns(case.linear, robot, 0, {})[..., axis]
    assert np.abs(changed[:, :12]).max() > 1e-4
    assert_close(column * angle, changed, 0.03)

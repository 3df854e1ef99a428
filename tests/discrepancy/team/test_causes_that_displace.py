"""Displaced grasps and bases, put into an exact recording by hand: the joints adapt, the payload moves as it does."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import chirp
from scipy.spatial.transform import Rotation

from discrepancy.team.candidates import in_shapes, shape_steps
from discrepancy.team.causes import CAUSES
from discrepancy.team.causes.yielding import lagging
from discrepancy.team.linear.trial_linear import linearise
from estimator.arm.delta import forward_kinematics, inverse_kinematics, jacobian, leg_geometry
from estimator.arm.dynamics import arm_torque
from estimator.rigid_team import balance
from outside_wrench import reported
from team_case import DESIGN, assert_close, rate_of, residual_of

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


def following(time, force, relaxation_s, inertia_s2=0.0):
    """Where a spring of 1 N/m beside a damper is under a force (Q, 3), at rest before: integrated step by step."""

    def rate(t, x):
        left = [np.interp(t, time, f) for f in force.T] - x[:3]
        if not inertia_s2:
            return left / relaxation_s
        return np.concatenate([x[3:], (left - relaxation_s * x[3:]) / inertia_s2])

    start = np.concatenate([force[0], np.zeros(3 if inertia_s2 else 0)])
    solved = solve_ivp(rate, (time[0], time[-1]), start, t_eval=time, rtol=1e-6, atol=1e-4, max_step=0.02)
    return solved.y.T[:, :3]


@pytest.mark.parametrize(("relaxation_s", "inertia_s2"), [(0.03, 0.0), (0.06, 1e-3), (0.01, 4e-3)])
def test_a_lag_follows_forces_as_fast_as_its_mass_swings(relaxation_s, inertia_s2):
    """From 0.3 to 9 Hz: at 2.5 and 5 Hz the masses here swing by themselves."""
    time = np.arange(0.0, 8.0, 0.01)
    force = 3.0 + chirp(time[:, None] + [0.0, 0.3, 0.9], 0.3, 8.0, 9.0)
    shape = {"relaxation_s": relaxation_s} | ({"inertia_s2": inertia_s2} if inertia_s2 else {})
    expected = following(time, force, relaxation_s, inertia_s2)
    np.testing.assert_allclose(lagging(force, 100.0, shape), expected, atol=5e-3)


@pytest.mark.parametrize(("robot", "relaxation_s"), [(0, 0.03), (1, 0.03), (2, 0.2)])
def test_grasp_flex(case, robot, relaxation_s):
    """The payload hangs back against the force on it, so the flange leads by compliance times force.

    The spring turns with the grasp: where that turns under a constant weight, the spring follows late.
    """
    c = 2e-6
    R = Rotation.from_euler("ZYX", case.signals.theta[:, robot])
    signals = adapted(
        case, robot, c * R.apply(following(case.signals.time, force_of(case, robot)[0], relaxation_s))
    )
    column = CAUSES["grasp_flex"].columns(case.linear, robot, 0, {"relaxation_s": relaxation_s})
    check_pose(case, signals, column, [c, 0.0], 0.02)


@pytest.mark.parametrize(("robot", "offset_m"), [(0, 0.06), (1, 0.06), (2, -0.04)])
def test_a_grasp_that_turns(case, robot, offset_m):
    """By turning times the moment of its force about a point beside the gimbal, which reads the flange's attitude."""
    turning, relaxation_s = 5e-4, 0.02
    R = Rotation.from_euler("ZYX", case.signals.theta[:, robot])
    force = turning * R.apply(following(case.signals.time, force_of(case, robot)[0], relaxation_s))
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
    signals = adapted(case, robot, -c * following(case.signals.time, on_base, relaxation_s, inertia_s2))
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

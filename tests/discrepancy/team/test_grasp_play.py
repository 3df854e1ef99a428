"""A loose grasp between its ends, where the force is too small to hold it at one."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from discrepancy.team.candidates import shape_steps
from discrepancy.team.causes import CAUSES
from discrepancy.team.causes.yielding import displaced
from estimator.arm.delta import forward_kinematics, inverse_kinematics
from estimator.arrays import inertia_parameters
from patchwork import dense
from team_case import DESIGN, exact, residual_of

PLAY_M, FORCE_N = 5e-5, 0.4


@pytest.mark.parametrize("robot", [0, 2])
def test_travel_between_the_ends_is_left_open(robot):
    """Crossings that lag by a tenth of a second are none of the column's; the unknowns take them."""
    case = exact()
    cause, shape = CAUSES["grasp_play"], {"force_N": FORCE_N}
    force = case.carried.wrench[:, robot, 3:]
    at_end = np.clip(force / FORCE_N, -1.0, 1.0)
    late = np.roll(at_end, 10, axis=0)
    # Late as long as the force is small, at the end thereafter.
    lead = PLAY_M * np.where(np.abs(force) < FORCE_N, late, at_end)
    R = Rotation.from_euler("ZYX", case.signals.theta[:, robot])
    phi = case.signals.phi.copy()
    h = forward_kinematics(phi[:, robot], DESIGN)
    phi[:, robot] = inverse_kinematics(h + R.apply(lead), DESIGN)
    changed = residual_of(case, replace(case.signals, phi=phi)) - case.linear.residual
    poses = changed[:, :12]
    column = cause.columns(case.linear, robot, 0, shape)[:, :12, 0]
    unknowns = dense(cause.unknowns(case.linear, robot, 0, shape))[:, :12]
    closed = poses - PLAY_M * column
    flat = unknowns.reshape(closed.size, -1)
    # Knots are closer than rows: as in the diagnosis they scatter by the play, beside noise of 0.1 um.
    scatter = np.eye(flat.shape[1]) * 1e-7 / PLAY_M
    values = np.linalg.lstsq(
        np.vstack([flat, scatter]), np.append(closed.ravel(), np.zeros(len(scatter))), rcond=None
    )[0]
    left = closed.ravel() - flat @ values
    assert np.abs(closed).max() > 5e-6
    assert np.linalg.norm(left) < 0.25 * np.linalg.norm(closed)
    assert np.abs(values).max() < 2.5 * PLAY_M


def test_nothing_is_open_where_the_force_is_large():
    case = exact()
    wrench = case.linear.data.wrench.copy()
    wrench[:, 1, 3:] = 5.0
    pressed = replace(case.linear, data=replace(case.linear.data, wrench=wrench))
    assert CAUSES["grasp_play"].unknowns(pressed, 1, 0, {"force_N": FORCE_N}).width == 0


@pytest.mark.parametrize("robot", [0, 1, 2])
def test_a_payload_that_stays_at_one_end_is_held_elsewhere(robot):
    """Poses and moments are those of a grasp that is off by as much; of robot 1, of all others and the payload."""
    case, offset = exact(), np.array([3e-6, -5e-6, 4e-6])  # of the payload, in {i}
    linear, shared = case.linear, case.shared
    R_1i, p_1i, pi = shared.grasps.R_1i, shared.grasps.p_1i.copy(), shared.pi.copy()
    wrist = -R_1i[robot] @ offset
    p_1i[robot] += wrist
    if robot == 0:
        p_1i -= wrist
        m, c = pi[0], pi[1:4] / pi[0]
        there = c - wrist
        pi[1:4] = m * there
        pi[4:] += inertia_parameters(m * (_about(there) - _about(c)))
    held = replace(shared, grasps=replace(shared.grasps, p_1i=p_1i), pi=pi)
    # Their motion is that of the wrists, which are not where they are thought to be, either.
    expected = residual_of(case) - residual_of(case, shared=held)
    force = linear.data.wrench[:, robot, 3:]
    rows = displaced(linear, robot, np.tile(offset, (len(force), 1)), force)
    for channels in (slice(0, 12), slice(12, 15), slice(15, 18)):
        scale = np.abs(expected[:, channels]).max()
        np.testing.assert_allclose(rows[:, channels], expected[:, channels], atol=0.02 * scale)


def test_what_is_behind_a_play():
    cause = CAUSES["grasp_play"]
    plain, soft = cause.shapes
    at = SimpleNamespace(shape={**soft, "contact_per_N": 0.002})
    assert cause.physical(np.array([2e-4]), at) == pytest.approx({"play_m": 2e-4, "contact_m_per_N": 4e-7})
    assert cause.physical(np.array([2e-4]), SimpleNamespace(shape=plain))["contact_m_per_N"] == 0.0
    # Slopes are there at nought, too.
    candidate = cause.candidate({"play_m": 3e-6}, soft, 1)
    ((less, more, size),) = shape_steps(candidate)
    assert more.shape["contact_per_N"] - less.shape["contact_per_N"] == pytest.approx(size)
    assert size > 0.0
    assert shape_steps(cause.candidate({"play_m": 3e-6}, plain, 1)) == []


@pytest.mark.parametrize("robot", [0, 1, 2])
def test_ends_that_give_way_are_a_healthy_grasp_that_does(robot):
    """Both are the force over a stiffness, so that neither is named for what the other does within its tolerance."""
    case, play, flex = exact(), CAUSES["grasp_play"], CAUSES["grasp_flex"]
    plain, behind = (
        play.columns(case.linear, robot, 0, {"force_N": FORCE_N, "contact_per_N": contact})[..., 0].ravel()
        for contact in (0.0, 1.0)
    )
    gives = flex.columns(case.linear, robot, 0, flex.shapes[0])[..., 0].ravel()
    ends = behind - plain
    compliance = gives @ ends / (gives @ gives)
    assert compliance == pytest.approx(1.0, abs=0.005)
    assert np.linalg.norm(ends - compliance * gives) < 0.02 * np.linalg.norm(ends)


def _about(c):
    return c @ c * np.eye(3) - np.outer(c, c)

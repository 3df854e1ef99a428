"""A loose grasp between its ends, where the force is too small to hold it at one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from discrepancy.team.causes import CAUSES
from estimator.arm.delta import forward_kinematics, inverse_kinematics
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

"""A loose grasp between its ends, where the force is too small to hold it at one."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from discrepancy.team.candidates import shape_steps
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

"""An exact recording whose payload something outside pulls at: what the joints feel of it, and what columns say."""

from dataclasses import replace

import numpy as np

from discrepancy.team.causes import CAUSES
from discrepancy.team.causes.base import Context
from estimator.arm.delta import jacobian
from recorded_team import COM, GRASPS, STEP_S, as_matrix, derivatives
from team_case import DESIGN, assert_close, residual_of


def motion_of(case):
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

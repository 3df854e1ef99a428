"""Derivative of a trial's residual by every robot's signals."""

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from estimator.arm.arms import Arms, arm_of
from estimator.arrays import Array
from estimator.estimate.fusion import fuse, fusion_matrix
from estimator.rigid_team.changes import needed_wrench, vee
from estimator.rigid_team.residual import Bases, Shared, robot_data
from estimator.rigid_team.slots import COUNT, STEPS
from estimator.signals.grasp_data import GraspData


def by_signals(s: Array, data: GraspData, shared: Shared, bases: Bases, arms: Arms) -> Array:
    """Derivative of the residual by every robot's signals, shape (N, Q, C, 21).

    Central differences through one robot's own formulas, then by hand through what is linear in the robots;
    evaluated at 25 Hz.
    """
    samples, every = len(s), max(1, round(data.rate_hz / rules.TEAM_JACOBIAN_HZ))
    knots = np.arange(0, samples, every)
    s = s[knots]
    data = _thinned(data, knots)
    Q, N = s.shape[:2]
    grasps = shared.grasps
    motion = fuse(data, grasps)
    fused = data.twist.reshape(Q, -1) @ fusion_matrix(grasps).T
    J = np.zeros((N, Q, 6 * N, COUNT))
    for i in range(N):
        G = fusion_matrix(grasps)[:, 6 * i : 6 * i + 6]
        R_1i, p_1i, arm = grasps.R_1i[i], grasps.p_1i[i], arm_of(arms, i)
        for k in range(COUNT):
            ends = []
            for sign in (1.0, -1.0):
                moved = s[:, i].copy()
                moved[:, k] += sign * STEPS[k]
                ends.append(robot_data(moved, arm))
            dR, dh, dV, dV_dot, dF = (
                (a - b) / (2.0 * STEPS[k]) for a, b in zip(ends[0], ends[1], strict=True)
            )
            turn = vee(dR @ np.swapaxes(data.R_bi[:, i], -1, -2))  # in {b_i}
            for j in range(1, N):
                at = 6 * (j - 1)
                if i == 0:
                    J[i, :, at : at + 3, k] = -turn
                    J[i, :, at + 3 : at + 6, k] = -dh - dR @ grasps.p_1i[j]
                elif i == j:
                    J[i, :, at : at + 3, k] = turn @ bases.R[j].T
                    J[i, :, at + 3 : at + 6, k] = dh @ bases.R[j].T
            d_up = dR[:, 2] @ R_1i.T / N
            d_up -= np.sum(d_up * motion.up, axis=1, keepdims=True) * motion.up
            needed = needed_wrench(fused, dV @ G.T, dV_dot @ G.T, data.gravity_mps2 * d_up, shared.pi)
            d_force, d_moment = dF[:, 3:] @ R_1i.T, dF[:, :3] @ R_1i.T
            d_moment = d_moment + np.cross(p_1i, d_force)
            J[i, :, -6:-3, k], J[i, :, -3:, k] = d_force - needed[0], d_moment - needed[1]
    # It varies as slowly as the motion: a straight line between its values is good to 1e-3.
    at = np.minimum(np.arange(samples) / every, Q - 1.0)
    low = np.minimum(at.astype(int), max(Q - 2, 0))
    weight = (at - low)[None, :, None, None]
    return J[:, low] * (1.0 - weight) + J[:, np.minimum(low + 1, Q - 1)] * weight


def _thinned(data: GraspData, rows: NDArray[np.intp]) -> GraspData:
    arrays = {f: getattr(data, f)[rows] for f in ("time", "R_bi", "p_bi", "twist", "twist_dot", "wrench")}
    return GraspData(**arrays, rate_hz=data.rate_hz, gravity_mps2=data.gravity_mps2)

"""Kinematic loops of a team, closed by Newton steps on MuJoCo's own constraint Jacobian."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array
from mocobot_sim.scene.team_index import TeamIndex

Index = NDArray[np.intp]


def loop_jacobian(model: mujoco.MjModel, data: mujoco.MjData, welds: bool = True) -> tuple[Array, Array]:
    """Jacobian (rows, nv) and gap (rows,) of the rods' and, if wanted, the grasps' constraints, and of no others."""
    kinds = [mujoco.mjtEq.mjEQ_CONNECT] + ([mujoco.mjtEq.mjEQ_WELD] if welds else [])
    equality = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    rows = equality & np.isin(model.eq_type[np.where(equality, data.efc_id, 0)], kinds)
    if not mujoco.mj_isSparse(model):
        dense = np.array(data.efc_J).reshape(data.nefc, model.nv)
    else:
        dense = np.zeros((data.nefc, model.nv))
        mujoco.mju_sparse2dense(dense, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
    return dense[rows], data.efc_pos[rows]


def static_load(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """What has to hold the team still at ``data.qpos`` on every dof [N or N m], shape (nv,)."""
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    return data.qfrc_bias - data.qfrc_passive


def open_by(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Largest gap of any loop [m or rad]."""
    mujoco.mj_fwdPosition(model, data)
    return float(np.abs(loop_jacobian(model, data)[1]).max())


def close(model: mujoco.MjModel, data: mujoco.MjData, dofs: Index, welds: bool = True) -> float:
    """Close the loops with the smallest steps of some joints, and return the largest gap that remains.

    Args:
        model, data: the team; ``data.qpos`` is changed.
        dofs: which joints may move; each has one coordinate.
        welds: also close the grasps, not only the rods.
    """
    at = model.jnt_qposadr[model.dof_jntid[dofs]]
    gap = np.inf
    for _ in range(20):
        mujoco.mj_fwdPosition(model, data)
        jacobian, gaps = loop_jacobian(model, data, welds)
        gap = float(np.abs(gaps).max())
        if gap < 1e-13:
            break
        data.qpos[at] -= np.linalg.lstsq(jacobian[:, dofs], gaps)[0]
    return gap


def hang(model: mujoco.MjModel, data: mujoco.MjData, dofs: Index) -> bool:
    """Let pendulum joints hang down; whether any had to move."""
    at = model.jnt_qposadr[model.dof_jntid[dofs]]
    moved = False
    for _ in range(50 if len(dofs) else 0):
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        inertia = np.array([model.body_mass[model.dof_bodyid[dof]] for dof in dofs])
        arms = np.array([np.linalg.norm(model.body_ipos[model.dof_bodyid[dof]]) for dof in dofs])
        step = data.qfrc_bias[dofs] / (inertia * arms * np.linalg.norm(model.opt.gravity))
        if np.abs(step).max() < 1e-12:
            break
        data.qpos[at] -= step
        moved = True
    return moved


def turn_free_directions(
    model: mujoco.MjModel, data: mujoco.MjData, index: TeamIndex, locked: Index, arms: Index
) -> bool:
    """Turn what hangs freely (one or two grasps) to its nearest equilibrium; whether one was found.

    Directions in which the loops stay closed while the legs stand still: the moment of gravity along them is brought
    to zero by Newton steps.
    """
    moving = np.setdiff1d(np.concatenate([arms, index.knee_dof.ravel()]), locked)
    at = model.jnt_qposadr[model.dof_jntid[moving]]
    for _ in range(20):
        load = static_load(model, data)[moving]
        _, size, axes = np.linalg.svd(loop_jacobian(model, data)[0][:, moving])
        free = axes[int(np.sum(size > 1e-6 * size.max())) :]
        if not len(free):
            return False
        moment = free @ load
        if np.abs(moment).max() < 1e-10:
            return True
        start = data.qpos.copy()
        slope = np.empty((len(free), len(free)))
        for k, direction in enumerate(free):
            data.qpos[at] = start[at] + 1e-5 * direction
            slope[:, k] = (free @ static_load(model, data)[moving] - moment) / 1e-5
        step = np.linalg.lstsq(slope, -moment, rcond=1e-9)[0]
        size = np.abs(step @ free).max()
        data.qpos[:] = start
        data.qpos[at] += step @ free * min(1.0, 0.1 / max(size, 1e-12))
        close(model, data, moving)
    return False

"""Start a trial at rest: close every loop at home, then load the springs so that nothing moves."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from mocobot_sim.models import omnid_design
from mocobot_sim.scene import TeamScene
from mocobot_sim.team_index import TeamIndex

Array = NDArray[np.float64]


def assemble_at_home(scene: TeamScene, model: mujoco.MjModel, data: mujoco.MjData, index: TeamIndex) -> Array:
    """Set ``data`` to static equilibrium in the home pose and return the spring torques there.

    Platforms and gimbals go to their home values, the legs follow by Newton steps on MuJoCo's own constraint
    Jacobian, and the springs take the static load. With N robots the load's distribution has free internal
    forces; the one with the least sum of squared spring torques is taken.

    Returns:
        Spring torques [N m] at rest, positive raising the link, shape (N, 3); also written to ``data.ctrl``.

    Raises:
        InputError: no configuration of the legs closes the loops (a grasp is out of reach), or no spring
            torques hold the payload at rest at home (one or two grasps leave it free to swing).
    """
    mujoco.mj_resetData(model, data)
    design_home = np.array([0.0, 0.0, omnid_design().home_height_m])
    data.qpos[index.slide_qpos] = scene.wrist_home_b - design_home
    data.qpos[index.gimbal_qpos] = scene.theta_home
    _close_legs(model, data, index)
    torque = _static_spring_torque(model, data, index)

    deflection = -torque / model.jnt_stiffness[model.dof_jntid[index.spring_dof]]
    data.qpos[index.spring_qpos] += deflection
    data.qpos[index.motor_qpos] -= deflection
    data.ctrl[index.actuator] = torque
    mujoco.mj_forward(model, data)
    return torque


def _close_legs(model: mujoco.MjModel, data: mujoco.MjData, index: TeamIndex) -> None:
    # Every loop variable here is a one-coordinate joint, so qpos and qvel addresses move together.
    legs = np.concatenate([index.motor_dof.ravel(), index.knee_dof.ravel()])
    legs_qpos = model.jnt_qposadr[model.dof_jntid[legs]]
    for _ in range(20):
        mujoco.mj_fwdPosition(model, data)
        if np.abs(data.efc_pos).max() < 1e-13:
            return
        data.qpos[legs_qpos] -= np.linalg.lstsq(_constraint_jacobian(model, data)[:, legs], data.efc_pos)[0]
    if np.abs(data.efc_pos).max() > 1e-9:
        raise InputError(
            f"the team cannot be assembled: a loop stays open by {np.abs(data.efc_pos).max():.2g} m; "
            "the grasps' heights and tilts must be within the arms' reach"
        )


def _static_spring_torque(model: mujoco.MjModel, data: mujoco.MjData, index: TeamIndex) -> Array:
    mujoco.mj_fwdVelocity(model, data)
    spring = index.spring_dof.ravel()
    rows = np.setdiff1d(np.arange(model.nv), index.motor_dof.ravel())
    constraint = _constraint_jacobian(model, data).T[rows]  # (rows, nefc)
    selection = (rows[:, None] == spring).astype(float)  # (rows, 3 N)
    # Constraint forces are free, spring torques cost: weigh the former out of the least-norm solution.
    free = 1e4
    forces = np.hstack([free * constraint, selection])
    solution = np.linalg.lstsq(forces, data.qfrc_bias[rows])[0]
    unheld = np.abs(forces @ solution - data.qfrc_bias[rows]).max()
    if unheld > 1e-6:
        raise InputError(
            f"the payload cannot rest in the home pose: {unheld:.2g} N m stay unbalanced; with one or two "
            "grasps its centre of mass must hang under them"
        )
    return solution[constraint.shape[1] :].reshape(index.spring_dof.shape)


def _constraint_jacobian(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Dense constraint Jacobian, shape (nefc, nv)."""
    if not mujoco.mj_isSparse(model):
        return np.array(data.efc_J).reshape(data.nefc, model.nv)
    dense = np.zeros((data.nefc, model.nv))
    mujoco.mju_sparse2dense(dense, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
    return dense

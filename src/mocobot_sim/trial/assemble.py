"""Initial state of a trial: close all kinematic loops near home, then load the springs for static equilibrium."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.control.control import home_phi
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.scene.soft import row_compliance
from mocobot_sim.scene.team_index import TeamIndex

Index = NDArray[np.intp]


def loop_jacobian(model: mujoco.MjModel, data: mujoco.MjData, welds: bool = True) -> tuple[Array, Array]:
    """Jacobian (rows, nv) and residual (rows,) of the loop constraints: rods and, with ``welds``, grasps."""
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
    """Generalised forces that hold the team still at ``data.qpos`` [N or N m], shape (nv,)."""
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    return data.qfrc_bias - data.qfrc_passive


def open_by(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Largest residual of any loop constraint [m or rad]."""
    mujoco.mj_fwdPosition(model, data)
    return float(np.abs(loop_jacobian(model, data)[1]).max())


def close(model: mujoco.MjModel, data: mujoco.MjData, dofs: Index, welds: bool = True) -> float:
    """Close the loops by Newton steps of least norm in some coordinates, and return the remaining residual [m or rad].

    Changes ``data.qpos``. Each joint of ``dofs`` has one coordinate. Without ``welds`` only the rods are closed.
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
    """Move pendulum joints to where they hang at rest; return whether any moved."""
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
    """Turn a payload that one or two grasps leave free to swing to its nearest equilibrium; return whether one exists.

    The free directions are those in which all loops stay closed with the driven joints locked. Newton steps bring the
    moment of gravity along them to zero.
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


# Largest displacement of a wrist and rotation of a gimbal that closing the loops may cause. Chosen.
LARGEST_SHIFT_M = 0.06
LARGEST_TURN_RAD = 0.2
# Largest unbalanced generalised force of a static equilibrium [N or N m]. Chosen.
UNHELD_NM = 1e-6
SWINGS = (
    "the payload cannot rest in the home pose: {:.2g} N m stay unbalanced; with one or two grasps its centre of mass "
    "must hang under them"
)


def assemble_at_home(scene: TeamScene, model: mujoco.MjModel, data: mujoco.MjData, index: TeamIndex) -> Array:
    """Set ``data`` to static equilibrium in the home pose, or near ``scene.initial``, and return the spring torques.

    Platforms and gimbals move to their home values, and the legs follow by Newton steps on MuJoCo's constraint
    Jacobian. The springs then take the static load. Several robots can share the load in many ways; the solution with
    the least sum of squared spring torques is used. If the home pose cannot close the loops (tilted bases, estimated
    mounts), all joints share the correction. Compliant bases and grasps settle under their loads; pendulums hang down.

    Returns:
        Spring torques at rest [N m], positive if they raise the link, shape (N, 3); also written to ``data.ctrl``.

    Raises:
        InputError: no configuration near home closes the loops (a grasp is out of reach); or no spring torques hold
            the payload at rest (one or two grasps leave it free to swing).
    """
    mujoco.mj_resetData(model, data)
    legs = np.concatenate([index.motor_dof.ravel(), index.knee_dof.ravel()])
    arms = np.concatenate([legs, index.slide_dof.ravel(), index.gimbal_dof.ravel()])
    if scene.initial is None:
        design_home = np.array([0.0, 0.0, omnid_design().home_height_m])
        data.qpos[index.slide_qpos] = scene.wrist_home_b - design_home
        data.qpos[index.gimbal_qpos] = scene.theta_home
        close(model, data, legs)
    else:
        phi, theta = scene.initial
        data.qpos[index.motor_qpos] = phi - home_phi(omnid_design())
        data.qpos[index.gimbal_qpos] = theta
        # Close the rods only: knees and platforms follow the driven angles.
        close(model, data, np.concatenate([index.knee_dof.ravel(), index.slide_dof.ravel()]), welds=False)
        if index.payload_dof.size:
            close(model, data, index.payload_dof)
    start = data.qpos.copy()
    _close_arms(model, data, index, arms, start)
    # Iterate, because compliant parts shift the loads.
    for _ in range(3):
        if not _settle(model, data, index, arms, start):
            break
        _close_arms(model, data, index, arms, start)
    torque = _static_forces(model, data, index)[0]
    deflection = _deflection(model, index, torque)
    data.qpos[index.spring_qpos] += deflection
    data.qpos[index.motor_qpos] -= deflection
    data.ctrl[index.actuator] = torque
    mujoco.mj_forward(model, data)
    return torque


def _close_arms(
    model: mujoco.MjModel, data: mujoco.MjData, index: TeamIndex, arms: NDArray[np.intp], start: Array
) -> None:
    gap = open_by(model, data)
    if gap > 1e-9:
        before = data.qpos.copy()
        gap = close(model, data, arms)
        shift = np.abs(data.qpos[index.slide_qpos] - start[index.slide_qpos]).max()
        near = shift <= LARGEST_SHIFT_M and _turned(data, index, start) <= LARGEST_TURN_RAD
        if not (gap <= 1e-9 and near):
            data.qpos[:] = before
            raise InputError(
                f"the team cannot be assembled: a loop stays open by {open_by(model, data):.2g} m; "
                "the grasps' heights and tilts must be within the arms' reach"
            )


def _settle(
    model: mujoco.MjModel, data: mujoco.MjData, index: TeamIndex, arms: NDArray[np.intp], start: Array
) -> bool:
    """Move everything compliant or free to its equilibrium under the current load; return whether anything moved."""
    moved = hang(model, data, index.hanging_dof)
    _, unheld, load = _static_forces(model, data, index, check=False)
    if unheld > UNHELD_NM:
        locked = np.concatenate([index.motor_dof.ravel(), index.spring_dof.ravel()])
        found = turn_free_directions(model, data, index, locked, arms)
        if not found or not _turned(data, index, start) <= LARGEST_TURN_RAD:
            raise InputError(SWINGS.format(unheld))
        return True
    for dof in index.yielding_dof:
        joint = model.dof_jntid[dof]
        compliance = row_compliance(model, int(joint))
        if compliance:
            data.qpos[model.jnt_qposadr[joint]] = compliance * load[dof]
            moved = True
        elif model.jnt_limited[joint] and abs(load[dof]) > 1e-3:
            data.qpos[model.jnt_qposadr[joint]] = model.jnt_range[joint, int(load[dof] > 0)]
            moved = True
    for dof in index.payload_dof:
        joint = model.dof_jntid[dof]
        if model.jnt_stiffness[joint]:
            data.qpos[model.jnt_qposadr[joint]] += load[dof] / model.jnt_stiffness[joint]
            moved = True
    return moved


def _turned(data: mujoco.MjData, index: TeamIndex, start: Array) -> float:
    """Largest change of a gimbal angle since ``start`` [rad]."""
    return float(np.abs(data.qpos[index.gimbal_qpos] - start[index.gimbal_qpos]).max())


def _static_forces(
    model: mujoco.MjModel, data: mujoco.MjData, index: TeamIndex, check: bool = True
) -> tuple[Array, float, Array]:
    """Static spring torques (N, 3) [N m], the largest unbalanced force [N or N m], and the load on every dof (nv,)."""
    needed: Array = static_load(model, data)
    spring = index.spring_dof.ravel()
    sprung = index.payload_dof[model.jnt_stiffness[model.dof_jntid[index.payload_dof]] > 0]
    # The floor carries released bases; their wheels settle in the first milliseconds of a trial.
    apart = np.concatenate(
        [index.motor_dof.ravel(), index.yielding_dof, index.hanging_dof, index.base_dof, sprung]
    )
    rows = np.setdiff1d(np.arange(model.nv), apart)
    jacobian = loop_jacobian(model, data)[0].T  # (nv, loops)
    constraint = jacobian[rows]
    selection = (rows[:, None] == spring).astype(float)  # (rows, 3 N)
    # Minimise spring torques only: the large factor makes constraint forces cheap in the least-norm solution.
    free = 1e4
    forces = np.hstack([free * constraint, selection])
    solution = np.linalg.lstsq(forces, needed[rows])[0]
    unheld = float(np.abs(forces @ solution - needed[rows]).max())
    if check and unheld > UNHELD_NM:
        raise InputError(SWINGS.format(unheld))
    load = jacobian @ (free * solution[: jacobian.shape[1]]) - needed
    torques = np.asarray(solution[jacobian.shape[1] :], dtype=np.float64).reshape(index.spring_dof.shape)
    return torques, unheld, load


def _deflection(model: mujoco.MjModel, index: TeamIndex, torque: Array) -> Array:
    """Deflections of the springs that balance a torque [rad], shape (N, 3)."""
    springs = model.dof_jntid[index.spring_dof]
    stiffness, poly = model.jnt_stiffness[springs], model.jnt_stiffnesspoly[springs]
    deflection = -torque / stiffness
    cubic = poly[..., 1]
    if cubic.any():
        for _ in range(50):
            excess = stiffness * deflection + cubic * deflection**3 + torque
            deflection = deflection - excess / (stiffness + 3.0 * cubic * deflection**2)
    return deflection

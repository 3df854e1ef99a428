"""Forecast positions from commands alone: MuJoCo simulates the robot and its position loops from a known state."""

from __future__ import annotations

import copy

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np

from discrepancy.joints.closed_loop import ClosedLoop
from discrepancy.joints.mechanics import Tree
from discrepancy.joints.model import SerialModel
from estimator.arrays import Array
from mocobot_sim.serial.mjcf import SOLIMP, SOLREF

STEP_S = 1e-3
"""Longest integration step [s]. Chosen: errors of the integration are then as small as those of encoders."""
WINDOW_S = 1.0
"""Length of a forecast [s]."""
LOST = 3.0
"""Error at which a forecast is lost [rad or m]; it counts with that error from there on. Chosen: half a turn."""


def machine(model: SerialModel, given: Tree, found: Tree) -> mujoco.MjModel:
    """The compiled model with the numbers of another tree, ready to be driven by torques; negative damping is left out.

    Args:
        model: the robot as described.
        given: its kinematic tree.
        found: the same with other numbers.
    """
    m = copy.copy(model.model)
    m.body_mass[:], m.body_ipos[:], m.body_pos[:] = found.mass, found.com, found.position
    changed = np.flatnonzero((found.inertia != given.inertia).any(axis=(1, 2)))
    for b in changed:
        size, axes = np.linalg.eigh(found.inertia[b])
        axes[:, 0] *= np.sign(np.linalg.det(axes))
        m.body_inertia[b] = np.maximum(size, 0.0)
        mujoco.mju_mat2Quat(m.body_iquat[b], axes.ravel())
    own = m.jnt_dofadr[model.coupling.own]
    m.dof_armature[own] += found.armature - given.armature
    m.dof_frictionloss[own] += found.coulomb - given.coulomb
    m.dof_damping[own] += np.maximum(found.viscous, 0.0) - given.viscous
    off = mujoco.mjtDisableBit
    for bit in (off.mjDSBL_CONTACT, off.mjDSBL_LIMIT, off.mjDSBL_ACTUATION, off.mjDSBL_AUTORESET):
        m.opt.disableflags |= int(bit)
    m.opt.gravity, m.dof_solref[:], m.dof_solimp[:] = found.gravity, SOLREF, SOLIMP
    mujoco.mj_setConst(m, mujoco.MjData(m))
    return m


def errors(
    m: mujoco.MjModel, model: SerialModel, loop: ClosedLoop, servos: Array, zero: Array, late: Array, steps: slice,
) -> Array:  # fmt: skip
    """Forecast minus measured positions in consecutive windows, shape (M, J); NaN where none was measured.

    Args:
        m: result of ``machine``.
        model: the robot as described.
        loop: the log with its estimated motion, from which every window starts.
        servos: position gain, velocity gain, torque added, and largest torque of each loop, shape (J, 4).
        zero, late: joint zeros and delays of the commands [s], shape (J,).
        steps: steps of the grid to forecast.
    """
    h, data, own = loop.step_s, mujoco.MjData(m), model.coupling.own
    (kp, kd, more, limit), on = servos.T, loop.gains(len(loop.q) - 1)[3] > 0.0
    command, added = loop.told(late)
    target = command + zero + (added / loop.gains(1)[0] + more / kp)
    at, dof = m.jnt_qposadr[own], m.jnt_dofadr[own]
    stiffness, spring, damping = m.jnt_stiffness[own], m.qpos_spring[at], m.dof_damping[dof]
    every = max(1, int(np.ceil(h / STEP_S - 1e-9)))
    m.opt.timestep = h / every
    # RK4 is stable if its step is shorter than the fastest decay.
    slow = bool(np.all(m.dof_invweight0[dof] * (damping + kd) * m.opt.timestep < 1.0))
    kind = mujoco.mjtIntegrator
    m.opt.integrator = int(kind.mjINT_RK4 if slow else kind.mjINT_IMPLICITFAST)
    out = np.full(loop.measured.shape, np.nan)
    long = max(loop.every, round(WINDOW_S / h / loop.every) * loop.every)
    begin = -(-steps.start // loop.every) * loop.every
    for first in range(begin, steps.stop - loop.every + 1, long):
        mujoco.mj_resetData(m, data)
        q, dq = model.coupling.all(loop.q[first] + zero, loop.dq[first])
        data.qpos[:], data.qvel[:] = q, dq
        lost = False
        for n in range(first, min(first + long, steps.stop)):
            for _ in range(every):
                if lost:
                    break
                asked = kp * (target[n] - data.qpos[at]) - kd * data.qvel[dof]
                free = on[n] & (np.abs(asked) < limit)
                # Springs and dampers act within a step, too, and not only between steps.
                m.jnt_stiffness[own], m.dof_damping[dof] = stiffness + free * kp, damping + free * kd
                m.qpos_spring[at] = np.where(
                    free, (stiffness * spring + kp * target[n]) / (stiffness + kp), spring
                )
                data.qfrc_applied[dof] = np.where(free, 0.0, on[n] * np.clip(asked, -limit, limit))
                mujoco.mj_step(m, data)
                lost = not np.abs(data.qpos[at] - loop.q[n]).max() < LOST
            if (n + 1) % loop.every == 0:
                row = (n + 1) // loop.every
                out[row] = LOST if lost else data.qpos[at] - zero - loop.measured[row]
    m.jnt_stiffness[own], m.qpos_spring[at], m.dof_damping[dof] = stiffness, spring, damping
    return np.where(np.isnan(loop.measured), np.nan, out)

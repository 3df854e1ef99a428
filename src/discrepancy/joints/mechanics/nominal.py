"""Torques that a model asks for, by MuJoCo's own inverse dynamics; friction of the joints is left to the causes."""

import copy

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np

from estimator.arrays import Array


def inverse_torque(model: mujoco.MjModel, q: Array, dq: Array, ddq: Array) -> Array:
    """Torques of a motion, shape (Q, J): inertia with armature, gravity and springs, but nothing that rubs.

    Contacts, limits and dry friction are constraints of MuJoCo, and off; so is the joints' damping.

    Args:
        model: compiled, joints of one degree of freedom only.
        q, dq, ddq: joint positions and their derivatives, shape (Q, J).
    """
    bare = copy.copy(model)
    bare.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    bare.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    bare.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_INVDISCRETE)  # ddq is the motion's, not a step's
    bare.dof_damping[:] = 0.0
    data = mujoco.MjData(bare)
    out = np.empty_like(q)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], dq[k], ddq[k]
        mujoco.mj_inverse(bare, data)
        out[k] = data.qfrc_inverse
    return out

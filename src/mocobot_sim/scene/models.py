"""Numbers of the hand-written models."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from mocobot_sim.scene.design import base_height_m as base_height_m
from mocobot_sim.scene.design import omnid_design as omnid_design
from mocobot_sim.scene.model_files import models_dir as models_dir
from mocobot_sim.scene.model_files import payload_names as payload_names
from mocobot_sim.scene.model_files import payload_path as payload_path


def posed(model: mujoco.MjModel, qpos: NDArray[np.float64] | None = None) -> mujoco.MjData:
    """Data with the poses of everything at ``qpos``, shape (nq,); None for ``qpos0``."""
    data = mujoco.MjData(model)
    if qpos is not None:
        data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    return data

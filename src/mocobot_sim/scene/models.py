"""Numbers of the hand-written models."""

from functools import cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from estimator.arm.design import OmnidDesign, load_design
from mocobot_sim.scene.model_files import models_dir
from mocobot_sim.scene.model_files import payload_names as payload_names
from mocobot_sim.scene.model_files import payload_path as payload_path


@cache
def omnid_design() -> OmnidDesign:
    """Design numbers of the shipped Omnid model."""
    return load_design(models_dir() / "omnid" / "design.toml")


@cache
def base_height_m() -> float:
    """Height of {b} over the floor mount of an Omnid, whose axes it shares [m]."""
    model = mujoco.MjModel.from_xml_path(str(models_dir() / "omnid" / "omnid.xml"))
    return float(posed(model).body("base").xpos[2])


def posed(model: mujoco.MjModel, qpos: NDArray[np.float64] | None = None) -> mujoco.MjData:
    """Data with the poses of everything at ``qpos``, shape (nq,); None for ``qpos0``."""
    data = mujoco.MjData(model)
    if qpos is not None:
        data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    return data

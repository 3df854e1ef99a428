"""Numbers of the Omnid's design, known without MuJoCo."""

from functools import cache

from estimator.arm.design import OmnidDesign, load_design
from mocobot_sim.scene.model_files import models_dir

GIMBAL_AXES = ("z", "y", "x")
"""Of gimbal joints 1, 2, 3."""


@cache
def omnid_design() -> OmnidDesign:
    """Design numbers of the shipped Omnid model."""
    return load_design(models_dir() / "omnid" / "design.toml")


@cache
def base_height_m() -> float:
    """Height of {b} over the floor mount of an Omnid, whose axes it shares [m]."""
    import mujoco  # the only number that its model has to be asked for

    model = mujoco.MjModel.from_xml_path(str(models_dir() / "omnid" / "omnid.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return float(data.body("base").xpos[2])

"""The robots: design parameters, arm kinematics, deviations from the design, control gains."""

from estimator.arm.delta import forward_kinematics, inverse_kinematics
from estimator.arm.design import OmnidDesign
from mocobot_sim.control.control import ControlGains
from mocobot_sim.scene.as_built import AsBuilt, CalibrationSpread
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import build_free_team
from mocobot_sim.trial.simulate import draw_units

__all__ = [
    "AsBuilt", "CalibrationSpread", "ControlGains", "OmnidDesign", "build_free_team", "draw_units",
    "forward_kinematics", "inverse_kinematics", "omnid_design",
]  # fmt: skip

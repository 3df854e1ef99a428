"""The catalogue: one file per cause, and its name here."""

from importlib import import_module

from discrepancy.team.causes.base import Cause

NAMES = (
    "phi_zero",
    "theta_zero",
    "link_length",
    "base_tilt",
    "base_creep",
    "base_compliance",
    "sea_scale",
    "sea_bias",
    "sea_hardening",
    "sea_hysteresis",
    "joint_friction",
    "gimbal_friction",
    "torque_skew",
    "torque_lag",
    "sensor_lag",
    "clock_delay",
    "grasp_flex",
    "grasp_play",
    "tether",
    "payload_tether",
    "push",
    "drag",
    "slosh",
)
"""In the order of the documentation; the class in ``sea_bias.py`` is ``SeaBias``."""

CAUSES: dict[str, Cause] = {
    name: getattr(import_module(f"{__name__}.{name}"), name.title().replace("_", ""))() for name in NAMES
}
"""Every cause by its name."""

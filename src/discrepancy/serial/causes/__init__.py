"""The catalogue: one file per cause, and its name here."""

from importlib import import_module

from discrepancy.serial.causes.base import Cause

NAMES = (
    "friction",
    "asymmetric_coulomb",
    "asymmetric_viscous",
    "stribeck",
    "sublinear_friction",
    "load_friction",
    "back_emf",
    "coupled_drive",
    "armature",
    "torque_offset",
    "torque_scale",
    "torque_delay",
    "joint_zero",
    "ripple",
    "spring",
    "counterbalance",
    "elasticity",
    "backlash",
    "payload",
    "link_mass",
    "link_com",
    "link_inertia",
    "link_length",
    "gravity_direction",
    "gravity_compensation",
    "push",
)
"""In the order of the documentation; the class in ``link_com.py`` is ``LinkCom``."""

CAUSES: dict[str, Cause] = {
    name: getattr(import_module(f"{__name__}.{name}"), name.title().replace("_", ""))() for name in NAMES
}
"""Every cause by its name."""

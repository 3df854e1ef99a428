"""The catalogue: one file per cause, and its name here."""

from importlib import import_module

from discrepancy.emps.causes.base import Cause

NAMES = (
    "mass",
    "coulomb_friction",
    "viscous_friction",
    "asymmetric_coulomb",
    "asymmetric_viscous",
    "stribeck",
    "force_offset",
    "position_force",
    "backlash",
    "delay",
    "position_gain",
    "velocity_gain",
    "velocity_lag",
    "injected_voltage",
    "injected_force",
    "push",
)
"""In the order of the documentation; the class in ``velocity_lag.py`` is ``VelocityLag``."""

CAUSES: dict[str, Cause] = {
    name: getattr(import_module(f"{__name__}.{name}"), name.title().replace("_", ""))() for name in NAMES
}
"""Every cause by its name."""

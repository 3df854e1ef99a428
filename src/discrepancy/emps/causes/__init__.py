"""The catalogue: one file per cause; the class in ``velocity_lag.py`` is ``VelocityLag``."""

from importlib import import_module

from discrepancy.cause_names.emps import NAMES
from discrepancy.emps.causes.base import Cause

CAUSES: dict[str, Cause] = {
    name: getattr(import_module(f"{__name__}.{name}"), name.title().replace("_", ""))() for name in NAMES
}
"""Every cause by its name."""

"""The catalogue: one file per cause; the class in ``link_com.py`` is ``LinkCom``."""

from importlib import import_module

from discrepancy.cause_names.serial import NAMES
from discrepancy.serial.causes.base import Cause

CAUSES: dict[str, Cause] = {
    name: getattr(import_module(f"{__name__}.{name}"), name.title().replace("_", ""))() for name in NAMES
}
"""Every cause by its name."""

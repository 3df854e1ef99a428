"""The catalogue: one file per cause; the class in ``sea_bias.py`` is ``SeaBias``."""

from importlib import import_module

from discrepancy.cause_names.team import NAMES
from discrepancy.team.causes.base import Cause

CAUSES: dict[str, Cause] = {
    name: getattr(import_module(f"{__name__}.{name}"), name.title().replace("_", ""))() for name in NAMES
}
"""Every cause by its name."""

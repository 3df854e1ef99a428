"""Robots as built, read from files: every deviation by name, checked."""

from dataclasses import fields
from pathlib import Path

import numpy as np

from estimator.strict import Fields, read_json
from mocobot_sim.scene.as_built import AsBuilt

NAMES = tuple(entry.name for entry in fields(AsBuilt))
WRIST_MASS = "wrist_mass_ratio"
PAYLOAD = ("grasps", "mass_kg", "p_1c_m", "R_1c_rotvec_deg", "principal_inertia_kgm2", "effects", "control")
"""What the truth beside a recording says besides; payload, effects and control are chosen anew."""
RANGES = {"_m": (-0.05, 0.05), "_ratio": (-0.9, 10.0)}
"""Of lengths and of ratios, as the effects of that kind have them; zeros may be any number."""


def read_units(path: Path) -> tuple[AsBuilt, ...]:
    """Robots of a JSON file ``{"as_built": [{"phi_zero_rad": [0.01, 0, 0], ...}, ...]}``, one object each.

    Names are those of ``AsBuilt``; what is left out is as designed. The truth beside a recording is such a file: its
    robots have the zeros, lengths and springs that effects gave them; all other effects have to be asked for again.

    Raises:
        InputError: it cannot be read, or a key or a value is not allowed.
    """
    read = Fields(read_json(path, "a team's units"), ("as_built",), str(path), PAYLOAD)
    entries = enumerate(read.list("as_built"), start=1)
    return tuple(_checked(Fields(entry, (), f"{path}: as_built[{i}]", NAMES)) for i, entry in entries)


def unit_in(read: Fields) -> AsBuilt:
    """One robot of an object's values; what the object does not have is as designed.

    Raises:
        InputError: a value is not allowed.
    """
    given = {name: read.array(name, (3,)) for name in NAMES if name in read.values and name != WRIST_MASS}
    return AsBuilt(**given, wrist_mass_ratio=read.number(WRIST_MASS) if WRIST_MASS in read.values else 0.0)


def _checked(read: Fields) -> AsBuilt:
    unit = unit_in(read)
    for name in read.values:
        low, high = next((r for end, r in RANGES.items() if name.endswith(end)), (-np.inf, np.inf))
        values = np.asarray(getattr(unit, name))
        if not ((values >= low) & (values <= high)).all():
            read.refuse(name, f"from {low:g} to {high:g}")
    return unit

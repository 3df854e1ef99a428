"""Design parameters of one Omnid, for the estimator and the simulator."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.strict import Fields, is_number, read_toml

Triple = tuple[float, float, float]
_UP: Array = np.array([0.0, 0.0, 1.0])
_TRIPLES = ("yoke_inertia_kgm2", "ring_inertia_kgm2", "flange_inertia_kgm2")


@dataclass(frozen=True)
class OmnidDesign:
    """Geometry, masses, stiffness and limits of one Omnid; SI units, named in each field's suffix.

    The fields are the keys of ``models/omnid/design.toml`` and of ``design`` in a recording's metadata.
    """

    base_radius_m: float
    platform_radius_m: float
    proximal_length_m: float
    rod_length_m: float
    phi_min_rad: float
    phi_max_rad: float
    home_height_m: float
    workspace_radius_m: float
    gimbal_limit_rad: float
    sea_stiffness_Nm_per_rad: float
    torque_limit_Nm: float
    rotor_inertia_kgm2: float
    proximal_mass_kg: float
    proximal_com_m: float
    proximal_inertia_kgm2: float
    rod_mass_kg: float
    platform_mass_kg: float
    yoke_mass_kg: float
    yoke_inertia_kgm2: Triple
    ring_mass_kg: float
    ring_inertia_kgm2: Triple
    flange_mass_kg: float
    flange_inertia_kgm2: Triple
    gravity_mps2: float

    @property
    def radius_m(self) -> float:
        """Base radius minus platform radius [m]; the kinematics depends only on this difference."""
        return self.base_radius_m - self.platform_radius_m

    @property
    def up(self) -> Array:
        """Unit vector against gravity in {b}, which is level, shape (3,)."""
        return _UP

    @property
    def wrist_mass_kg(self) -> float:
        """Mass that translates with the wrist: platform and the three gimbal bodies [kg]."""
        return self.platform_mass_kg + self.yoke_mass_kg + self.ring_mass_kg + self.flange_mass_kg

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], where: str = "design") -> OmnidDesign:
        """Build from a mapping with exactly the documented keys.

        Raises:
            InputError: a key is unknown or missing, or a value is not a finite number of the allowed sign.
        """
        names = [field.name for field in dataclasses.fields(cls)]
        Fields(values, names, where)
        out: dict[str, Any] = {}
        for name in names:
            value, path = values[name], f"{where}.{name}"
            if name not in _TRIPLES:
                out[name] = _number(path, value, positive=name != "phi_min_rad")
            elif isinstance(value, list | tuple) and len(value) == 3:
                out[name] = tuple(_number(path, entry, positive=True) for entry in value)
            else:
                raise InputError(f"{path} is {value!r:.60}; it must be three numbers")
        return cls(**out)

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain JSON types, with the keys of ``design.toml``."""
        return {k: list(v) if isinstance(v, tuple) else v for k, v in dataclasses.asdict(self).items()}


def load_design(path: Path) -> OmnidDesign:
    """Read a design file.

    Raises:
        InputError: the file cannot be read, is not TOML, or its keys are not the documented ones.
    """
    return OmnidDesign.from_dict(read_toml(path, "design file"), where=str(path))


def _number(where: str, value: Any, *, positive: bool) -> float:
    if not is_number(value):
        raise InputError(f"{where} is {value!r:.60}; it must be a finite number")
    if positive and value <= 0:
        raise InputError(f"{where} is {value!r}; it must be greater than 0")
    return float(value)

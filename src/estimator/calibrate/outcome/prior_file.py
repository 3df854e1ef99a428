"""How far robots may be off, from a TOML file."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

from estimator.calibrate.prior import Prior
from estimator.errors import InputError
from estimator.strict import check_known, is_number, read_toml

LARGEST = {
    "encoder_zero_rad": 0.35,
    "geometry_m": 0.05,
    "stiffness_ratio": 0.5,
    "tau_zero_Nm": 5.0,
    "tilt_rad": 0.2,
    "arm_mass_ratio": 0.5,
    "arm_weight_ratio": 0.5,
}
"""Largest standard deviation that can be meant, by field: above, somebody wrote degrees, millimetres or percent."""


def read_prior(path: Path | str) -> Prior:
    """Read a prior: any of the fields of ``Prior``, defaults for the others.

    Raises:
        InputError: the file cannot be read, a key is unknown, or a value is outside what it may be.
    """
    path = Path(path)
    values = read_toml(path, "prior of a calibration")
    names = [field.name for field in fields(Prior)]
    check_known(values, names, str(path))
    for name, value in values.items():
        if not is_number(value) or not 0.0 <= value <= LARGEST[name]:
            unit = {"rad": " rad", "m": " m", "Nm": " N m"}.get(name.rsplit("_", 1)[-1], "")
            raise InputError(
                f"{path}: {name} is {value!r:.60}; it must be a standard deviation from 0 to {LARGEST[name]:g}{unit}"
            )
    return Prior(**{name: float(value) for name, value in values.items()})

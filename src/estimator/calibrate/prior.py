"""Prior of a calibration: how far every parameter of the robots may deviate from its design."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from scipy.linalg import null_space

from estimator.arm.unit import AT, COUNT
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.strict import check_known, is_number, read_toml

MASSES = np.r_[AT["proximal_mass_ratio"], AT["rod_mass_ratio"], AT["wrist_mass_ratio"]]


@dataclass(frozen=True)
class Prior:
    """Prior standard deviations of the deviations in ``estimator.arm.unit.GROUPS``; 0 holds a group as designed.

    The defaults describe uncalibrated robots and reproduce the errors of the paper's team. If the data determine the
    deviations, the prior matters little: a factor of three either way gives the same result.

    Attributes:
        encoder_zero_rad: of phi, theta_z and theta_y zeros [rad]; theta_x zeros only turn the grasp frames.
        geometry_m: of base radius, platform radius, proximal and rod length, each [m].
        stiffness_ratio: of each spring's relative stiffness [-]; their mean is held unless a weight is known.
        tau_zero_Nm: of each torque zero [N m].
        tilt_rad: of a base about x and y [rad].
        arm_mass_ratio: of the mass of each proximal link, each rod and the wrist, relative [-].
        arm_weight_ratio: of the common factor of all arm masses, relative [-].
    """

    encoder_zero_rad: float = float(np.deg2rad(1.0))
    geometry_m: float = 1e-3
    stiffness_ratio: float = 0.02
    tau_zero_Nm: float = 0.02
    tilt_rad: float = 0.0
    arm_mass_ratio: float = 0.0
    arm_weight_ratio: float = 0.05

    def factor(self, robots: int, *, hold_scale: bool) -> Array:
        """Return B of shape (N ``COUNT``, k): B z are deviations of N robots, with z standard normal and independent.

        ``hold_scale`` constrains the mean of all springs' ratios to 0.
        """
        columns = np.diag(np.tile(self._sd(), robots))
        springs = (np.arange(robots)[:, None] * COUNT + np.r_[AT["stiffness_ratio"]]).ravel()
        masses = (np.arange(robots)[:, None] * COUNT + MASSES).ravel()
        parts = [columns]
        if hold_scale:
            columns[:, springs] = 0.0
            apart = np.zeros((len(columns), len(springs) - 1))
            apart[springs] = self.stiffness_ratio * null_space(np.ones((1, len(springs))))
            parts.append(apart)
        together = np.zeros((len(columns), 1))
        together[masses] = self.arm_weight_ratio
        factor = np.hstack([*parts, together])
        return factor[:, factor.any(axis=0)]

    def _sd(self) -> Array:
        """Return the standard deviations in the order of ``ArmUnit.x``, shape (``COUNT``,)."""
        out = np.zeros(COUNT)
        out[AT["phi_zero"]] = out[AT["theta_zero"]] = self.encoder_zero_rad
        out[AT["theta_zero"].stop - 1] = 0.0
        out[AT["radius"]] = np.sqrt(2.0) * self.geometry_m
        out[AT["proximal_length"]] = out[AT["rod_length"]] = self.geometry_m
        out[AT["stiffness_ratio"]] = self.stiffness_ratio
        out[AT["tau_zero"]] = self.tau_zero_Nm
        out[AT["tilt"]] = self.tilt_rad
        out[MASSES] = self.arm_mass_ratio
        return out

    def scaled(self, factor: float) -> Prior:
        """Return the prior with all standard deviations multiplied by a factor."""
        return Prior(*(factor * getattr(self, field.name) for field in fields(self)))


LARGEST = {
    "encoder_zero_rad": 0.35,
    "geometry_m": 0.05,
    "stiffness_ratio": 0.5,
    "tau_zero_Nm": 5.0,
    "tilt_rad": 0.2,
    "arm_mass_ratio": 0.5,
    "arm_weight_ratio": 0.5,
}
"""Largest plausible standard deviation by field; larger values suggest degrees, millimetres or percent."""


def read_prior(path: Path | str) -> Prior:
    """Read a prior from TOML: any of the fields of ``Prior``, defaults for the others.

    Raises:
        InputError: the file cannot be read, a key is unknown, or a value is out of range.
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

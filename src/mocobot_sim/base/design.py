"""Design numbers of the mecanum base."""

import dataclasses
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.strict import Fields, is_number, read_toml
from mocobot_sim.scene.models import models_dir

# Order of the wheels everywhere; x forward, y left.
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
ALONG_X = np.array([1.0, 1.0, -1.0, -1.0])
ALONG_Y = np.array([1.0, -1.0, 1.0, -1.0])
# Which way the roller on the floor points: its axle is along (sin, hand cos) of the roller angle in the chassis' x, y.
# The four axles form a diamond on the floor, and an X seen from above.
HAND = np.array([-1.0, 1.0, 1.0, -1.0])


@dataclass(frozen=True)
class BaseDesign:
    """Geometry, contact and drives of one mecanum base; SI units, named in each field's suffix.

    The fields are the keys of ``models/omnid/base.toml``.
    """

    wheel_radius_m: float
    half_wheelbase_m: float
    half_track_m: float
    rollers: int
    roller_angle_rad: float
    roller_radius_m: float
    roller_half_length_m: float
    roller_mass_kg: float
    roller_damping_Nms_per_rad: float
    friction: float
    contact_time_s: float
    drive_torque_limit_Nm: float
    drive_gain_Nms_per_rad: float
    drive_integral_Nm_per_rad: float

    def __post_init__(self) -> None:
        """Check every number.

        Raises:
            InputError: a value is not a finite number of the allowed range.
        """
        for entry in dataclasses.fields(self):
            value = getattr(self, entry.name)
            if entry.name == "rollers":
                good, allowed = type(value) is int and 3 <= value <= 60, "a whole number from 3 to 60"
            elif entry.name == "roller_angle_rad":
                good, allowed = is_number(value) and 0.1 <= value <= 1.47, "a number from 0.1 to 1.47"
            else:
                good, allowed = is_number(value) and value > 0, "a finite number greater than 0"
            if not good:
                raise InputError(f"base design: {entry.name} is {value!r}; it must be {allowed}")
        if not self.roller_radius_m < 0.5 * self.wheel_radius_m:
            raise InputError(
                f"base design: roller_radius_m is {self.roller_radius_m:g}; "
                f"it must be less than half of wheel_radius_m, {self.wheel_radius_m:g}"
            )

    @property
    def wheel_positions(self) -> Array:
        """Middle of every wheel in the chassis' x, y [m], shape (4, 2)."""
        return np.stack([self.half_wheelbase_m * ALONG_X, self.half_track_m * ALONG_Y], axis=1)


def load_base_design(path: Path) -> BaseDesign:
    """Read a design file.

    Raises:
        InputError: the file cannot be read, is not TOML, or its keys are not the documented ones.
    """
    values = read_toml(path, "design file")
    Fields(values, [entry.name for entry in dataclasses.fields(BaseDesign)], str(path))
    try:
        return BaseDesign(**values)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


@cache
def base_design() -> BaseDesign:
    """Design numbers of the shipped base."""
    return load_base_design(models_dir() / "omnid" / "base.toml")

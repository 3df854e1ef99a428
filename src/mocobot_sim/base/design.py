"""Design parameters of the mecanum base and its kinematics: wheel speeds from a body twist and back.

A roller turns freely about its axle, so its contact moves freely across the axle and does not slip along the axle e.
The contact of wheel k, at (x, y) on the chassis, has the velocity v + w z x (x, y), minus R u along x, where u is the
wheel speed. The no-slip condition gives

    e . (v_x - w y - R u, v_y + w x) = 0,    e = (sin a, s cos a)
    u = (v_x - w y + s cot(a) (v_y + w x)) / R

where a is the angle between the axles of roller and wheel, and s = +-1 is the hand of the wheel. With a = 45 deg this
is equation (13.10) of K. M. Lynch and F. C. Park, "Modern Robotics", Cambridge University Press, 2017.

The textbook assumes that a roller always touches with its middle. With n rollers on straight axles, an axle is rotated
about the wheel's axle by up to t = +-pi / n while it carries the wheel. At the angle t only the share sin a cos t of
the axle lies along the wheel's motion. At constant wheel speed all t are equally likely, so cot a is divided by the
mean of cos t, sin(pi / n) / (pi / n). With 12 rollers the base moves 1.1 % less far sideways than the textbook
predicts. ``with_rollers`` includes this mean.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.strict import Fields, is_number, read_toml
from mocobot_sim.scene.models import models_dir

# Order of the wheels in all arrays; x points forward, y left.
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
ALONG_X = np.array([1.0, 1.0, -1.0, -1.0])
ALONG_Y = np.array([1.0, -1.0, 1.0, -1.0])
# Hand of each wheel: the axle of the roller on the floor points along (sin a, hand cos a) in the chassis' x, y, where a
# is the roller angle. The axles form a diamond on the floor, and an X seen from above.
HAND = np.array([-1.0, 1.0, 1.0, -1.0])


@dataclass(frozen=True)
class BaseDesign:
    """Geometry, contact and drives of one mecanum base; the suffix of each field gives its SI unit.

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
            InputError: a value is not a finite number within its range.
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
        """Centre of every wheel in the chassis' x, y [m], shape (4, 2)."""
        return np.stack([self.half_wheelbase_m * ALONG_X, self.half_track_m * ALONG_Y], axis=1)


def load_base_design(path: Path) -> BaseDesign:
    """Read the design of a base from a TOML file.

    Raises:
        InputError: the file cannot be read, is not TOML, or has wrong keys or values.
    """
    values = read_toml(path, "design file")
    Fields(values, [entry.name for entry in dataclasses.fields(BaseDesign)], str(path))
    try:
        return BaseDesign(**values)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


@cache
def base_design() -> BaseDesign:
    """Design of the shipped base."""
    return load_base_design(models_dir() / "omnid" / "base.toml")


@dataclass(frozen=True)
class MecanumKinematics:
    """Linear map between planar body twists (w_z, v_x, v_y) and wheel speeds, wheels in the order of ``WHEELS``.

    Attributes:
        matrix: Jacobian H from twist to wheel speeds, shape (4, 3); units of the columns [1, 1/m, 1/m].
        inverse: pseudo-inverse of ``matrix``, from wheel speeds to the least-squares twist, shape (3, 4).
    """

    matrix: Array
    inverse: Array

    @classmethod
    def textbook(cls, design: BaseDesign) -> MecanumKinematics:
        """Kinematics under the assumption that every roller touches with its middle."""
        return cls._with(design, 1.0)

    @classmethod
    def with_rollers(cls, design: BaseDesign) -> MecanumKinematics:
        """Kinematics averaged over a turn of wheels with a finite number of straight rollers."""
        return cls._with(design, axle_share(design))

    @classmethod
    def _with(cls, design: BaseDesign, share: float) -> MecanumKinematics:
        x, y = design.wheel_positions.T
        across = HAND / (np.tan(design.roller_angle_rad) * share)
        matrix = np.stack([across * x - y, np.ones(4), across], axis=1) / design.wheel_radius_m
        return cls(matrix, np.asarray(np.linalg.pinv(matrix), dtype=np.float64))

    def off_by(self, ratio: ArrayLike) -> MecanumKinematics:
        """Kinematics that take a twist (w_z, v_x, v_y) for one larger by these ratios, shape (3,)."""
        share = 1.0 + np.asarray(ratio, dtype=float)
        return MecanumKinematics(self.matrix / share, share[:, None] * self.inverse)

    def wheel_speeds(self, twist: ArrayLike) -> Array:
        """Speeds [rad/s], shape (..., 4), for twists (w_z [rad/s], v_x, v_y [m/s]), shape (..., 3)."""
        return np.asarray(twist, dtype=float) @ self.matrix.T

    def twist(self, wheel_speeds: ArrayLike) -> Array:
        """Least-squares twists, shape (..., 3), for wheel speeds [rad/s], shape (..., 4)."""
        return np.asarray(wheel_speeds, dtype=float) @ self.inverse.T


def axle_share(design: BaseDesign) -> float:
    """Mean cosine of the angle by which a roller's axle is rotated while the roller carries the wheel."""
    half_pitch = np.pi / design.rollers
    return float(np.sin(half_pitch) / half_pitch)

"""Deviations of real robots from their design: geometry, springs, masses, sensor zeros and sensor timing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.strict import Fields, read_json
from mocobot_sim.scene.models import omnid_design

if TYPE_CHECKING:
    from estimator.arm.unit import ArmUnit
    from mocobot_sim.scene.pymjcf import mjcf


CALIBRATED = {
    "base_radius_m": "radius", "proximal_length_m": "proximal_length", "rod_length_m": "rod_length",
    "stiffness_ratio": "stiffness_ratio", "phi_zero_rad": "phi_zero", "theta_zero_rad": "theta_zero",
    "tau_zero_Nm": "tau_zero", "proximal_mass_ratio": "proximal_mass_ratio", "rod_mass_ratio": "rod_mass_ratio",
}  # fmt: skip
"""Name in a calibration by attribute of ``AsBuilt``."""
WRIST_BODIES = ("platform", "yoke", "ring", "flange")
"""Bodies that translate with the wrist."""


@dataclass(frozen=True)
class AsBuilt:
    """Deviations of one Omnid from its design, one entry per leg 1..3 or gimbal axis z, y, x.

    Geometry, stiffness and masses change the simulated robot. Zeros change the readings in the log and in the
    controller. Estimator and controller use the nominal design.

    Attributes:
        base_radius_m: base radius minus design [m], shape (3,).
        proximal_length_m: proximal length minus design [m], shape (3,).
        rod_length_m: rod length minus design [m], shape (3,).
        platform_radius_m: platform radius minus design [m], shape (3,).
        stiffness_ratio: spring stiffness over design, minus 1, shape (3,).
        phi_zero_rad: reading minus true phi [rad], shape (3,).
        theta_zero_rad: reading minus true (theta_z, theta_y, theta_x) [rad], shape (3,).
        tau_zero_Nm: reading minus true spring torque [N m], shape (3,).
        proximal_mass_ratio: mass and inertia of the driven link over design, minus 1, shape (3,).
        rod_mass_ratio: mass and inertia of the rod over design, minus 1, shape (3,).
        wrist_mass_ratio: mass and inertia of platform and gimbal (``WRIST_BODIES``) over design, minus 1.
    """

    base_radius_m: Array = field(default_factory=lambda: np.zeros(3))
    proximal_length_m: Array = field(default_factory=lambda: np.zeros(3))
    rod_length_m: Array = field(default_factory=lambda: np.zeros(3))
    platform_radius_m: Array = field(default_factory=lambda: np.zeros(3))
    stiffness_ratio: Array = field(default_factory=lambda: np.zeros(3))
    phi_zero_rad: Array = field(default_factory=lambda: np.zeros(3))
    theta_zero_rad: Array = field(default_factory=lambda: np.zeros(3))
    tau_zero_Nm: Array = field(default_factory=lambda: np.zeros(3))
    proximal_mass_ratio: Array = field(default_factory=lambda: np.zeros(3))
    rod_mass_ratio: Array = field(default_factory=lambda: np.zeros(3))
    wrist_mass_ratio: float = 0.0

    def to_dict(self) -> dict[str, list[float] | float]:
        """Convert to JSON values, by attribute."""
        return {name: np.asarray(value).tolist() for name, value in asdict(self).items()}


def units_as_built(units: ArmUnit) -> tuple[AsBuilt, ...]:
    """Convert calibrated robots to deviations for the simulation.

    Base tilt is not included, because it belongs to the mount. Kinematics determine only the difference of base and
    platform radius, so the base radius gets all of its deviation.

    Args:
        units: calibrated parameters of N robots, ``x`` of shape (N, ``COUNT``).
    """
    return tuple(
        AsBuilt(
            **{name: one.of(calibrated) for name, calibrated in CALIBRATED.items()},
            wrist_mass_ratio=float(one.of("wrist_mass_ratio")[0]),
        )
        for one in (replace(units, x=x) for x in units.x)
    )


def units_of(as_built: Sequence[AsBuilt], robots: int) -> tuple[AsBuilt, ...]:
    """Return one ``AsBuilt`` per robot; an empty sequence means that all robots are as designed.

    Raises:
        InputError: the sequence is neither empty nor has one entry per robot.
    """
    if as_built and len(as_built) != robots:
        raise InputError(f"as_built has {len(as_built)} units; the payload has {robots} grasps")
    return tuple(as_built) or (AsBuilt(),) * robots


def theta_x_zeros(as_built: Sequence[AsBuilt], robots: int) -> Array:
    """Zero (reading minus true angle) of theta_x of every robot [rad], shape (N,); arguments as in ``units_of``."""
    return np.array([unit.theta_zero_rad[2] for unit in units_of(as_built, robots)])


@dataclass(frozen=True)
class CalibrationSpread:
    """Standard deviations of independent, normally distributed deviations from the design.

    Attributes:
        encoder_zero_rad: standard deviation of each phi and theta zero [rad].
        stiffness_ratio: standard deviation of each spring's relative stiffness [-].
        geometry_m: standard deviation of each base radius, platform radius, proximal and rod length [m].
        tau_zero_Nm: standard deviation of each torque zero [N m].
        arm_mass_ratio: standard deviation of the relative mass of each driven link, rod and wrist [-].
    """

    encoder_zero_rad: float = 0.0
    stiffness_ratio: float = 0.0
    geometry_m: float = 0.0
    tau_zero_Nm: float = 0.0
    arm_mass_ratio: float = 0.0

    def draw(self, robots: int, rng: np.random.Generator) -> tuple[AsBuilt, ...]:
        """Draw the deviations of a team; those of robot i do not depend on the number of robots after it."""
        zeros = (self.encoder_zero_rad, self.encoder_zero_rad, self.tau_zero_Nm)
        spreads = np.array(
            [*[self.geometry_m] * 4, self.stiffness_ratio, *zeros]
        )  # in the order of AsBuilt's fields
        units = tuple(AsBuilt(*(spreads[:, None] * rng.standard_normal((8, 3)))) for _ in range(robots))
        if not self.arm_mass_ratio:
            return units
        # Masses have a separate random stream, so that they do not change the other deviations.
        masses = rng.spawn(1)[0]
        drawn = ((unit, self.arm_mass_ratio * masses.standard_normal(7)) for unit in units)
        return tuple(
            replace(
                unit, proximal_mass_ratio=own[:3], rod_mass_ratio=own[3:6], wrist_mass_ratio=float(own[6])
            )
            for unit, own in drawn
        )


def deviate(omnid: mjcf.RootElement, unit: AsBuilt) -> None:
    """Apply deviations of geometry, springs and masses to the MJCF of one Omnid.

    Mass and inertia of a body scale by the same ratio.
    """
    deviate_geometry(omnid, unit)
    ratios = {f"proximal{k + 1}": unit.proximal_mass_ratio[k] for k in range(3)}
    ratios |= {f"rod{k + 1}": unit.rod_mass_ratio[k] for k in range(3)}
    ratios |= dict.fromkeys(WRIST_BODIES, unit.wrist_mass_ratio)
    for body, ratio in ratios.items():
        if ratio:  # leave design values bit-identical
            inertial = omnid.find("body", body).inertial
            inertial.mass = inertial.mass * (1.0 + ratio)
            inertial.diaginertia = inertial.diaginertia * (1.0 + ratio)
    for k in range(3):
        spring = omnid.find("joint", f"spring{k + 1}")
        spring.stiffness = omnid_design().sea_stiffness_Nm_per_rad * (1.0 + unit.stiffness_ratio[k])


def deviate_geometry(omnid: mjcf.RootElement, unit: AsBuilt) -> None:
    """Add the geometric deviations of ``unit`` to the MJCF of one Omnid."""
    for k in range(3):
        azimuth = 2.0 * np.pi * k / 3.0
        u = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        proximal = omnid.find("body", f"proximal{k + 1}")
        proximal.pos = proximal.pos + unit.base_radius_m[k] * u
        rod = omnid.find("body", f"rod{k + 1}")
        rod.pos = rod.pos + np.array([unit.proximal_length_m[k], 0.0, 0.0])
        tip = omnid.find("site", f"rod{k + 1}_tip")
        if unit.rod_length_m[k]:  # the mass stays evenly distributed along the changed rod
            grown = 1.0 + unit.rod_length_m[k] / tip.pos[0]
            rod.inertial.pos = rod.inertial.pos * grown
            rod.inertial.diaginertia = rod.inertial.diaginertia * np.array([1.0, grown**2, grown**2])
        tip.pos = tip.pos + np.array([unit.rod_length_m[k], 0.0, 0.0])
        platform = omnid.find("site", f"platform{k + 1}")
        platform.pos = platform.pos + unit.platform_radius_m[k] * u


NAMES = tuple(entry.name for entry in fields(AsBuilt))
WRIST_MASS = "wrist_mass_ratio"
PAYLOAD = (
    "grasps", "mass_kg", "p_1c_m", "R_1c_rotvec_deg", "principal_inertia_kgm2", "bodies", "joint", "effects", "control"
)  # fmt: skip
"""Keys of the truth beside a recording that ``read_units`` ignores."""
RANGES = {"_m": (-0.05, 0.05), "_ratio": (-0.9, 10.0)}
"""Allowed ranges of lengths and ratios by suffix, equal to those of the effects; zeros may be any number."""


def read_units(path: Path) -> tuple[AsBuilt, ...]:
    """Read robots from a JSON file ``{"as_built": [{"phi_zero_rad": [0.01, 0, 0], ...}, ...]}``, one object each.

    Keys are the attributes of ``AsBuilt``; missing ones are as designed. The truth beside a recording is such a file:
    its robots include the zeros, lengths and springs of effects. All other effects must be given again.

    Raises:
        InputError: the file cannot be read, or a key or value is not allowed.
    """
    read = Fields(read_json(path, "a team's units"), ("as_built",), str(path), PAYLOAD)
    entries = enumerate(read.list("as_built"), start=1)
    return tuple(_checked(Fields(entry, (), f"{path}: as_built[{i}]", NAMES)) for i, entry in entries)


def unit_in(read: Fields) -> AsBuilt:
    """Read one robot from an object's values; missing attributes are as designed.

    Raises:
        InputError: a value is not allowed.
    """
    given = {name: read.array(name, (3,)) for name in NAMES if name in read.values and name != WRIST_MASS}
    return AsBuilt(**given, wrist_mass_ratio=read.number(WRIST_MASS) if WRIST_MASS in read.values else 0.0)


def _checked(read: Fields) -> AsBuilt:
    """Read one robot and check that its numbers are within their ranges."""
    unit = unit_in(read)
    for name in read.values:
        low, high = next((r for end, r in RANGES.items() if name.endswith(end)), (-np.inf, np.inf))
        values = np.asarray(getattr(unit, name))
        if not ((values >= low) & (values <= high)).all():
            read.refuse(name, f"from {low:g} to {high:g}")
    return unit


@dataclass(frozen=True)
class SensorEffects:
    """Timing faults of the sensors, one entry per robot; empty tuples mean none."""

    # age of the logged torques relative to the angles in the same row [s]
    torque_delay_s: tuple[float, ...] = ()
    # time constant of a first-order lag in the torque sensors, for log and controller [s]
    torque_lag_s: tuple[float, ...] = ()
    # time stamp minus sampling time of everything that the robot logs [s]; the controller is unaffected
    clock_delay_s: tuple[float, ...] = ()

    def of(self, name: str, robots: int) -> tuple[float, ...]:
        """Values of one attribute, one per robot, 0 for no fault [s]."""
        return getattr(self, name) or (0.0,) * robots

    def added(self, name: str, robot: int, value_s: float, robots: int) -> SensorEffects:
        """Return a copy with ``value_s`` [s] added to one attribute of one robot, counted from 1."""
        values = list(self.of(name, robots))
        values[robot - 1] += value_s
        return replace(self, **{name: tuple(values)})

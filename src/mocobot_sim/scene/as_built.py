"""How one real unit differs from its design: geometry, springs, masses, zeros and timing of sensors."""

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
"""Attributes of ``AsBuilt``, and what a calibration calls them."""
WRIST_BODIES = ("platform", "yoke", "ring", "flange")
"""What translates with the wrist."""


@dataclass(frozen=True)
class AsBuilt:
    """Deviations of one Omnid from its design, one entry per leg 1..3 (or gimbal axis z, y, x).

    Geometry, stiffness and masses change the simulated robot; zeros change what its sensors and its controller read.
    The estimator and the controller keep using the design.

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
        wrist_mass_ratio: mass and inertia of platform and gimbal, which translate with the wrist, over design,
            minus 1.
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
        """Plain JSON values by the names above."""
        return {name: np.asarray(value).tolist() for name, value in asdict(self).items()}


def units_as_built(units: ArmUnit) -> tuple[AsBuilt, ...]:
    """Calibrated robots, ``x`` of shape (N, ``COUNT``), to be simulated; a tilted base is the mount's, not the arm's.

    What the base's radius is off minus the platform's is given to the base, as kinematics cannot part them.
    """
    return tuple(
        AsBuilt(
            **{name: one.of(calibrated) for name, calibrated in CALIBRATED.items()},
            wrist_mass_ratio=float(one.of("wrist_mass_ratio")[0]),
        )
        for one in (replace(units, x=x) for x in units.x)
    )


def units_of(as_built: Sequence[AsBuilt], robots: int) -> tuple[AsBuilt, ...]:
    """One unit per robot; none given means all as designed.

    Raises:
        InputError: units are given, but not one per robot.
    """
    if as_built and len(as_built) != robots:
        raise InputError(f"as_built has {len(as_built)} units; the payload has {robots} grasps")
    return tuple(as_built) or (AsBuilt(),) * robots


def theta_x_zeros(as_built: Sequence[AsBuilt], robots: int) -> Array:
    """What every robot's theta_x reads too much [rad], shape (N,); see ``units_of``."""
    return np.array([unit.theta_zero_rad[2] for unit in units_of(as_built, robots)])


@dataclass(frozen=True)
class CalibrationSpread:
    """Standard deviations of as-built deviations, normally distributed and independent.

    Attributes:
        encoder_zero_rad: of each phi and theta zero [rad].
        stiffness_ratio: of each spring's relative stiffness [-].
        geometry_m: of each base radius, platform radius, proximal and rod length [m].
        tau_zero_Nm: of each torque zero [N m].
        arm_mass_ratio: of the relative mass of each driven link, each rod and each wrist [-].
    """

    encoder_zero_rad: float = 0.0
    stiffness_ratio: float = 0.0
    geometry_m: float = 0.0
    tau_zero_Nm: float = 0.0
    arm_mass_ratio: float = 0.0

    def draw(self, robots: int, rng: np.random.Generator) -> tuple[AsBuilt, ...]:
        """Draw one team; robot i's unit does not depend on how many robots follow it."""
        zeros = (self.encoder_zero_rad, self.encoder_zero_rad, self.tau_zero_Nm)
        spreads = np.array([*[self.geometry_m] * 4, self.stiffness_ratio, *zeros])  # as the fields of AsBuilt
        units = tuple(AsBuilt(*(spreads[:, None] * rng.standard_normal((8, 3)))) for _ in range(robots))
        if not self.arm_mass_ratio:
            return units
        # A stream of their own: the rest of a unit is the same with and without them, and whatever the team's size.
        masses = rng.spawn(1)[0]
        drawn = ((unit, self.arm_mass_ratio * masses.standard_normal(7)) for unit in units)
        return tuple(
            replace(
                unit, proximal_mass_ratio=own[:3], rod_mass_ratio=own[3:6], wrist_mass_ratio=float(own[6])
            )
            for unit, own in drawn
        )


def deviate(omnid: mjcf.RootElement, unit: AsBuilt) -> None:
    """Move one unit's geometry, springs and masses off their design values.

    Mass and inertia of a body scale together, as those of denser or thicker parts would.
    """
    deviate_geometry(omnid, unit)
    ratios = {f"proximal{k + 1}": unit.proximal_mass_ratio[k] for k in range(3)}
    ratios |= {f"rod{k + 1}": unit.rod_mass_ratio[k] for k in range(3)}
    ratios |= dict.fromkeys(WRIST_BODIES, unit.wrist_mass_ratio)
    for body, ratio in ratios.items():
        if ratio:  # a design's own numbers keep their bits
            inertial = omnid.find("body", body).inertial
            inertial.mass = inertial.mass * (1.0 + ratio)
            inertial.diaginertia = inertial.diaginertia * (1.0 + ratio)
    for k in range(3):
        spring = omnid.find("joint", f"spring{k + 1}")
        spring.stiffness = omnid_design().sea_stiffness_Nm_per_rad * (1.0 + unit.stiffness_ratio[k])


def deviate_geometry(omnid: mjcf.RootElement, unit: AsBuilt) -> None:
    """Move one unit's geometry by what ``unit`` says, on top of what it is."""
    for k in range(3):
        azimuth = 2.0 * np.pi * k / 3.0
        u = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        proximal = omnid.find("body", f"proximal{k + 1}")
        proximal.pos = proximal.pos + unit.base_radius_m[k] * u
        rod = omnid.find("body", f"rod{k + 1}")
        rod.pos = rod.pos + np.array([unit.proximal_length_m[k], 0.0, 0.0])
        tip = omnid.find("site", f"rod{k + 1}_tip")
        if unit.rod_length_m[k]:  # a longer rod has its mass along all of it
            grown = 1.0 + unit.rod_length_m[k] / tip.pos[0]
            rod.inertial.pos = rod.inertial.pos * grown
            rod.inertial.diaginertia = rod.inertial.diaginertia * np.array([1.0, grown**2, grown**2])
        tip.pos = tip.pos + np.array([unit.rod_length_m[k], 0.0, 0.0])
        platform = omnid.find("site", f"platform{k + 1}")
        platform.pos = platform.pos + unit.platform_radius_m[k] * u


NAMES = tuple(entry.name for entry in fields(AsBuilt))
WRIST_MASS = "wrist_mass_ratio"
PAYLOAD = ("grasps", "mass_kg", "p_1c_m", "R_1c_rotvec_deg", "principal_inertia_kgm2", "effects", "control")
"""What the truth beside a recording says besides; payload, effects and control are chosen anew."""
RANGES = {"_m": (-0.05, 0.05), "_ratio": (-0.9, 10.0)}
"""Ranges of lengths and ratios, as the effects of that kind have them; zeros may be any number."""


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
    """One robot whose numbers are within their ranges."""
    unit = unit_in(read)
    for name in read.values:
        low, high = next((r for end, r in RANGES.items() if name.endswith(end)), (-np.inf, np.inf))
        values = np.asarray(getattr(unit, name))
        if not ((values >= low) & (values <= high)).all():
            read.refuse(name, f"from {low:g} to {high:g}")
    return unit


@dataclass(frozen=True)
class SensorEffects:
    """Timing faults, one entry per robot; empty tuples mean none."""

    # the logged torque is that much older than the angles beside it [s], N entries
    torque_delay_s: tuple[float, ...] = ()
    # time constant of a first-order lag in the torque sensor, before log and controller [s]
    torque_lag_s: tuple[float, ...] = ()
    # everything the robot logs was sampled that much too early [s]; the controller is unaffected
    clock_delay_s: tuple[float, ...] = ()

    def of(self, name: str, robots: int) -> tuple[float, ...]:
        """One attribute's values, N entries, zeros where there is no fault [s]."""
        return getattr(self, name) or (0.0,) * robots

    def added(self, name: str, robot: int, value_s: float, robots: int) -> SensorEffects:
        """A copy in which one robot's (1-based) value is larger by ``value_s`` [s]."""
        values = list(self.of(name, robots))
        values[robot - 1] += value_s
        return replace(self, **{name: tuple(values)})

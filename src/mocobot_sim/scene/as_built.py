"""How one real unit differs from its design: geometry, springs, sensor zeros and masses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.scene.design import omnid_design

if TYPE_CHECKING:
    from estimator.arm.unit import ArmUnit
    from mocobot_sim.scene.pymjcf import mjcf

WRIST_BODIES = ("platform", "yoke", "ring", "flange")
"""What translates with the wrist."""


def _zeros() -> Array:
    return np.zeros(3)


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

    base_radius_m: Array = field(default_factory=_zeros)
    proximal_length_m: Array = field(default_factory=_zeros)
    rod_length_m: Array = field(default_factory=_zeros)
    platform_radius_m: Array = field(default_factory=_zeros)
    stiffness_ratio: Array = field(default_factory=_zeros)
    phi_zero_rad: Array = field(default_factory=_zeros)
    theta_zero_rad: Array = field(default_factory=_zeros)
    tau_zero_Nm: Array = field(default_factory=_zeros)
    proximal_mass_ratio: Array = field(default_factory=_zeros)
    rod_mass_ratio: Array = field(default_factory=_zeros)
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
            base_radius_m=one.of("radius"),
            proximal_length_m=one.of("proximal_length"),
            rod_length_m=one.of("rod_length"),
            stiffness_ratio=one.of("stiffness_ratio"),
            phi_zero_rad=one.of("phi_zero"),
            theta_zero_rad=one.of("theta_zero"),
            tau_zero_Nm=one.of("tau_zero"),
            proximal_mass_ratio=one.of("proximal_mass_ratio"),
            rod_mass_ratio=one.of("rod_mass_ratio"),
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
        return tuple(_with_masses(unit, self.arm_mass_ratio * masses.standard_normal(7)) for unit in units)


def _with_masses(unit: AsBuilt, ratios: Array) -> AsBuilt:
    """A unit with deviations of its driven links, rods and wrist, shape (7,)."""
    return replace(
        unit,
        proximal_mass_ratio=ratios[:3],
        rod_mass_ratio=ratios[3:6],
        wrist_mass_ratio=float(ratios[6]),
    )


def deviate(omnid: mjcf.RootElement, unit: AsBuilt) -> None:
    """Move one unit's geometry, springs and masses off their design values."""
    deviate_geometry(omnid, unit)
    _deviate_masses(omnid, unit)
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


def _deviate_masses(omnid: mjcf.RootElement, unit: AsBuilt) -> None:
    """Scale mass and inertia of the arm's bodies together, as denser or thicker parts would."""
    ratios = {f"proximal{k + 1}": unit.proximal_mass_ratio[k] for k in range(3)}
    ratios |= {f"rod{k + 1}": unit.rod_mass_ratio[k] for k in range(3)}
    ratios |= dict.fromkeys(WRIST_BODIES, unit.wrist_mass_ratio)
    for body, ratio in ratios.items():
        if ratio:  # a design's own numbers keep their bits
            inertial = omnid.find("body", body).inertial
            inertial.mass = inertial.mass * (1.0 + ratio)
            inertial.diaginertia = inertial.diaginertia * (1.0 + ratio)

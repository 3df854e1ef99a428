"""Arms with deviations from the design, their JSON, and the frames that encoder zeros define."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.design import OmnidDesign, Triple
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.strict import Fields


class Group(NamedTuple):
    """Deviations of one kind: name, unit ("" for a ratio), and a name for each leg, gimbal axis or direction."""

    name: str
    unit: str
    entries: tuple[str, ...]

    @property
    def key(self) -> str:
        """Name with unit, such as ``tau_zero_Nm``."""
        return f"{self.name}_{self.unit.replace(' ', '')}" if self.unit else self.name


_LEGS = ("1", "2", "3")
GROUPS = (
    Group("phi_zero", "rad", _LEGS),
    Group("theta_zero", "rad", ("z", "y", "x")),
    Group("radius", "m", _LEGS),
    Group("proximal_length", "m", _LEGS),
    Group("rod_length", "m", _LEGS),
    Group("stiffness_ratio", "", _LEGS),
    Group("tau_zero", "N m", _LEGS),
    Group("tilt", "rad", ("x", "y")),
    Group("proximal_mass_ratio", "", _LEGS),
    Group("rod_mass_ratio", "", _LEGS),
    Group("wrist_mass_ratio", "", ("",)),
)
"""Groups in ``ArmUnit.x``, in order. Zeros are reading minus truth; lengths and ratios are as built minus design. A
radius is the base's minus the platform's, because the kinematics depends only on this difference."""
_ENDS = np.cumsum([0, *(len(group.entries) for group in GROUPS)])
AT: dict[str, slice] = {
    group.name: slice(int(first), int(last))
    for group, first, last in zip(GROUPS, _ENDS, _ENDS[1:], strict=False)
}
"""Slice of each group in ``ArmUnit.x``."""
COUNT = int(_ENDS[-1])


@dataclass(frozen=True, eq=False)
class ArmUnit:
    """One arm with its deviations, or several in leading axes of ``x``; properties have the names of ``OmnidDesign``.

    Lengths and masses of legs have shape (..., 3). Inertias scale with the mass; centres of mass stay as designed.

    Attributes:
        design: common design of the arms.
        x: deviations from it, in the order of ``GROUPS``, shape (..., ``COUNT``).
    """

    design: OmnidDesign
    x: Array

    def of(self, name: str) -> Array:
        """Return the deviations of one group, shape (..., entries)."""
        return self.x[..., AT[name]]

    def moved(self, dx: Array) -> ArmUnit:
        """Add deviations of shape (..., ``COUNT``)."""
        return replace(self, x=self.x + dx)

    def true_tau(self, reading: Array) -> Array:
        """Convert readings, which assume springs as designed, to true spring torques [N m]."""
        return (reading - self.of("tau_zero")) * (1.0 + self.of("stiffness_ratio"))

    @property
    def R_ba(self) -> Array:
        """Rotation of the arm's own frame in {b}, which is level, shape (..., 3, 3)."""
        tilt = self.of("tilt")
        vector = np.concatenate([tilt, np.zeros_like(tilt[..., :1])], axis=-1)
        return Rotation.from_rotvec(vector.reshape(-1, 3)).as_matrix().reshape(*tilt.shape[:-1], 3, 3)

    @property
    def up(self) -> Array:
        """Unit vector against gravity in the arm's own frame, shape (..., 3)."""
        return self.R_ba[..., 2, :]

    @property
    def radius_m(self) -> Array:
        """Base radius minus platform radius [m]."""
        return self.design.radius_m + self.of("radius")

    @property
    def proximal_length_m(self) -> Array:
        """Distance from driven axis to knee [m]."""
        return self.design.proximal_length_m + self.of("proximal_length")

    @property
    def rod_length_m(self) -> Array:
        """Distance from knee to platform joint [m]."""
        return self.design.rod_length_m + self.of("rod_length")

    @property
    def proximal_mass_kg(self) -> Array:
        """Mass of a driven link [kg]."""
        return self.design.proximal_mass_kg * (1.0 + self.of("proximal_mass_ratio"))

    @property
    def proximal_com_m(self) -> float:
        """Distance from driven axis to the link's centre of mass [m]."""
        return self.design.proximal_com_m

    @property
    def proximal_inertia_kgm2(self) -> Array:
        """Inertia of a driven link about its axis [kg m^2]."""
        return self.design.proximal_inertia_kgm2 * (1.0 + self.of("proximal_mass_ratio"))

    @property
    def rod_mass_kg(self) -> Array:
        """Total mass of the rods of a leg [kg]."""
        return self.design.rod_mass_kg * (1.0 + self.of("rod_mass_ratio"))

    @property
    def wrist_mass_kg(self) -> Array:
        """Mass of all bodies that translate with the wrist [kg], shape (..., 1)."""
        return self.design.wrist_mass_kg * (1.0 + self.of("wrist_mass_ratio"))

    @property
    def yoke_inertia_kgm2(self) -> Triple:
        """Principal moments of the gimbal's first body [kg m^2]."""
        return self.design.yoke_inertia_kgm2

    @property
    def ring_inertia_kgm2(self) -> Triple:
        """Principal moments of the gimbal's second body [kg m^2]."""
        return self.design.ring_inertia_kgm2

    @property
    def flange_inertia_kgm2(self) -> Triple:
        """Principal moments of the gimbal's last body [kg m^2]."""
        return self.design.flange_inertia_kgm2

    @property
    def gravity_mps2(self) -> float:
        """Magnitude of gravity [m/s^2]."""
        return self.design.gravity_mps2


Arms = OmnidDesign | ArmUnit
"""One arm or several: all as designed, or with deviations, in leading axes of ``ArmUnit.x``."""


def design_of(arms: Arms) -> OmnidDesign:
    """Return the common design of arms."""
    return arms.design if isinstance(arms, ArmUnit) else arms


def arm_of(arms: Arms, robot: int) -> Arms:
    """Return the arm of one robot (from 0) among several."""
    return ArmUnit(arms.design, arms.x[robot]) if isinstance(arms, ArmUnit) else arms


def true_joints(arms: Arms, phi: Array, theta: Array, tau: Array) -> tuple[Array, Array, Array]:
    """Convert readings to true driven angles [rad], gimbal angles [rad] and spring torques [N m], shape (..., 3) each.

    Arms as designed have exact readings: the function returns the arrays themselves.
    """
    if not isinstance(arms, ArmUnit):
        return phi, theta, tau
    return phi - arms.of("phi_zero"), theta - arms.of("theta_zero"), arms.true_tau(tau)


def levelled(arms: Arms, R: Array, h: Array) -> tuple[Array, Array]:
    """Rotate orientations (..., 3, 3) and wrist positions (..., 3) [m] from the arms' own frames to the level {b}."""
    if not isinstance(arms, ArmUnit) or not arms.of("tilt").any():
        return R, h
    return arms.R_ba @ R, (arms.R_ba @ h[..., None])[..., 0]


def units_to_list(units: ArmUnit) -> list[dict[str, list[float]]]:
    """Convert to one object per robot, with every group of ``GROUPS`` as a list; ``x`` has shape (N, ``COUNT``)."""
    return [{group.key: x[AT[group.name]].tolist() for group in GROUPS} for x in units.x]


def units_from_list(values: list[Any], design: OmnidDesign, where: str) -> ArmUnit:
    """Inverse of ``units_to_list``; ``where`` is the name of the list in messages.

    Raises:
        InputError: a key is unknown or missing, or a value is not finite or physically impossible.
    """
    x = np.empty((len(values), COUNT))
    for i, entry in enumerate(values):
        read = Fields(entry, [group.key for group in GROUPS], f"{where}[{i}]")
        x[i] = np.concatenate([read.array(group.key, (len(group.entries),)) for group in GROUPS])
    units = ArmUnit(design, x)
    check_units(units, where)
    return units


def check_units(units: ArmUnit, where: str) -> None:
    """Check that lengths, masses and spring stiffnesses are greater than 0.

    Raises:
        InputError: one of them is not.
    """
    for group in GROUPS:
        if group.name.endswith("_ratio"):
            least = -1.0
        elif group.name in ("radius", "proximal_length", "rod_length"):
            least = -getattr(units.design, f"{group.name}_m")
        else:
            continue
        values = units.of(group.name)
        bad = np.argwhere(~(values > least))
        if len(bad):
            robot, value = int(bad[0][0]), float(values[tuple(bad[0])])
            raise InputError(f"{where}[{robot}]: {group.key} is {value:g}; it must be greater than {least:g}")


# The zero of theta_x rotates {i} about its x axis and is unobservable with a payload, so results state their frames.
ENCODERS = "frames {i} as the encoders define them: each turned about its x axis by the zero of that theta_x"
MIXED = "Frames are the encoders' in one and the drawing's in the other: of the payload, the mass alone is compared."


def frames_said(zero_sd_rad: float) -> str:
    """Describe the encoders' frames, with the standard deviation of their zeros."""
    return f"{ENCODERS} (0 +- {np.rad2deg(zero_sd_rad):.2g} deg, which is not in the standard errors)"


def in_encoder_frames(units: ArmUnit | None) -> bool:
    """Return whether theta_x readings are used without zeros, for robots as designed (None) or calibrated."""
    return units is None or not units.of("theta_zero")[..., 2].any()


def seen_by_encoders(zeros: Array, R_1i: Array, p_1i: Array, *vectors: Array) -> list[Array]:
    """Convert vectors and grasps from the drawing's frames to the encoders' frames.

    Args:
        zeros: theta_x zeros of every robot, reading minus truth [rad], shape (N,).
        R_1i, p_1i: grasp frames, shapes (N, 3, 3) and (N, 3).
        vectors: other vectors in {1}, as columns.
    """
    turn = Rotation.from_rotvec(np.outer(zeros, [1.0, 0.0, 0.0])).as_matrix()
    return [turn[0].T @ R_1i @ turn, p_1i @ turn[0], *(turn[0].T @ vector for vector in vectors)]

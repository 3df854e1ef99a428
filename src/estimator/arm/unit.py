"""One arm as it is: how its lengths, springs, masses and sensor zeros differ from the design."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.design import OmnidDesign, Triple
from estimator.arrays import Array


class Group(NamedTuple):
    """Deviations of one kind.

    Attributes:
        name: theirs.
        unit: theirs, "" for a ratio.
        entries: one name each: legs, gimbal axes or directions.
    """

    name: str
    unit: str
    entries: tuple[str, ...]


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
"""What ``ArmUnit.x`` holds, in order. Zeros are reading minus truth; lengths and ratios as built minus design; a
radius is the base's minus the platform's, which is all that kinematics sees of the two."""
_ENDS = np.cumsum([0, *(len(group.entries) for group in GROUPS)])
AT: dict[str, slice] = {
    group.name: slice(int(first), int(last))
    for group, first, last in zip(GROUPS, _ENDS, _ENDS[1:], strict=False)
}
"""Where each group lies in ``ArmUnit.x``."""
COUNT = int(_ENDS[-1])


@dataclass(frozen=True, eq=False)
class ArmUnit:
    """One arm, or several side by side in leading axes of ``x``: an ``Arm`` for kinematics and dynamics.

    Attributes:
        design: what all arms of the kind have in common.
        x: deviations from it, in the order of ``GROUPS``, shape (..., ``COUNT``).
    """

    design: OmnidDesign
    x: Array

    @classmethod
    def as_designed(cls, design: OmnidDesign) -> ArmUnit:
        """No deviation."""
        return cls(design, np.zeros(COUNT))

    def of(self, name: str) -> Array:
        """Deviations of one group, shape (..., entries)."""
        return self.x[..., AT[name]]

    def moved(self, dx: Array) -> ArmUnit:
        """With deviations added, shape (..., ``COUNT``)."""
        return replace(self, x=self.x + dx)

    def true_tau(self, reading: Array) -> Array:
        """Spring torques [N m] from readings, which take the springs to be as designed."""
        return (reading - self.of("tau_zero")) * (1.0 + self.of("stiffness_ratio"))

    @property
    def R_ba(self) -> Array:
        """Rotation of the arm's own frame in {b}, which is level, shape (..., 3, 3)."""
        tilt = self.of("tilt")
        vector = np.concatenate([tilt, np.zeros_like(tilt[..., :1])], axis=-1)
        return Rotation.from_rotvec(vector.reshape(-1, 3)).as_matrix().reshape(*tilt.shape[:-1], 3, 3)

    @property
    def up(self) -> Array:
        """See ``Arm``."""
        return self.R_ba[..., 2, :]

    @property
    def radius_m(self) -> Array:
        """See ``Arm``."""
        return self.design.radius_m + self.of("radius")

    @property
    def proximal_length_m(self) -> Array:
        """See ``Arm``."""
        return self.design.proximal_length_m + self.of("proximal_length")

    @property
    def rod_length_m(self) -> Array:
        """See ``Arm``."""
        return self.design.rod_length_m + self.of("rod_length")

    @property
    def proximal_mass_kg(self) -> Array:
        """See ``Arm``."""
        return self.design.proximal_mass_kg * (1.0 + self.of("proximal_mass_ratio"))

    @property
    def proximal_com_m(self) -> float:
        """See ``Arm``; the centre of mass stays where it is designed."""
        return self.design.proximal_com_m

    @property
    def proximal_inertia_kgm2(self) -> Array:
        """See ``Arm``; grows with the mass."""
        return self.design.proximal_inertia_kgm2 * (1.0 + self.of("proximal_mass_ratio"))

    @property
    def rod_mass_kg(self) -> Array:
        """See ``Arm``."""
        return self.design.rod_mass_kg * (1.0 + self.of("rod_mass_ratio"))

    @property
    def wrist_mass_kg(self) -> Array:
        """See ``Arm``; shape (..., 1)."""
        return self.design.wrist_mass_kg * (1.0 + self.of("wrist_mass_ratio"))

    @property
    def yoke_inertia_kgm2(self) -> Triple:
        """See ``Arm``."""
        return self.design.yoke_inertia_kgm2

    @property
    def ring_inertia_kgm2(self) -> Triple:
        """See ``Arm``."""
        return self.design.ring_inertia_kgm2

    @property
    def flange_inertia_kgm2(self) -> Triple:
        """See ``Arm``."""
        return self.design.flange_inertia_kgm2

    @property
    def gravity_mps2(self) -> float:
        """See ``Arm``."""
        return self.design.gravity_mps2

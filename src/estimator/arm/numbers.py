"""What kinematics and dynamics need to know of an arm, be it as designed or as it is."""

from typing import Protocol

from estimator.arm.design import Triple
from estimator.arrays import Array


class Arm(Protocol):
    """Numbers of one arm, SI; lengths and masses of legs are one number for all, or arrays (..., 3), one a leg."""

    @property
    def radius_m(self) -> float | Array:
        """Base radius minus platform radius."""
        ...

    @property
    def proximal_length_m(self) -> float | Array:
        """Driven axis to knee."""
        ...

    @property
    def rod_length_m(self) -> float | Array:
        """Knee to platform joint."""
        ...

    @property
    def proximal_mass_kg(self) -> float | Array:
        """Of a driven link."""
        ...

    @property
    def proximal_com_m(self) -> float:
        """Driven axis to the link's centre of mass."""
        ...

    @property
    def proximal_inertia_kgm2(self) -> float | Array:
        """Of a driven link about its axis."""
        ...

    @property
    def rod_mass_kg(self) -> float | Array:
        """Of the rod, or rods, of a leg."""
        ...

    @property
    def wrist_mass_kg(self) -> float | Array:
        """Of all that translates with the wrist; an array has one entry, or ends in an axis of one."""
        ...

    @property
    def yoke_inertia_kgm2(self) -> Triple:
        """Of the gimbal's first body."""
        ...

    @property
    def ring_inertia_kgm2(self) -> Triple:
        """Of its second."""
        ...

    @property
    def flange_inertia_kgm2(self) -> Triple:
        """Of its last."""
        ...

    @property
    def gravity_mps2(self) -> float:
        """Magnitude of gravity."""
        ...

    @property
    def up(self) -> Array:
        """Unit vector against gravity in the arm's own frame, shape (3,) or (..., 1, 3)."""
        ...

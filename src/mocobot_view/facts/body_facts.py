"""What is said of a payload, by an estimate or by the truth, ready to be drawn."""

from dataclasses import dataclass

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.estimate.grasps import single_robot
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording
from mocobot_view.facts.placement import Grasps

THINNEST = 0.02
"""Least semi-axis of a drawn inertia ellipsoid over the largest, for inertias that no body has."""


@dataclass(frozen=True)
class BodyFacts:
    """A payload's grasps and inertial parameters; None marks what is not known.

    Attributes:
        grasps: grasp frames in {1}.
        mass_kg: mass.
        p_1c: centre of mass in {1} [m], shape (3,).
        R_1c: principal axes in {1}, shape (3, 3).
        principal_kgm2: principal moments, in the order of the axes, shape (3,).
        axes_known: False where two moments are so alike that the axes are anybody's choice.
    """

    grasps: Grasps | None
    mass_kg: float | None
    p_1c: Array | None
    R_1c: Array | None
    principal_kgm2: Array | None
    axes_known: bool = True

    def semi_axes_m(self) -> Array | None:
        """Semi-axes of the uniform solid ellipsoid with this mass and inertia [m], shape (3,), or None.

        I_x = m (b^2 + c^2) / 5, so a^2 = 5 (I_y + I_z - I_x) / (2 m). Moments that break the triangle inequality
        give a flat one.
        """
        if self.mass_kg is None or self.principal_kgm2 is None or not self.mass_kg > 0:
            return None
        squares = 2.5 * (np.sum(self.principal_kgm2) - 2.0 * self.principal_kgm2) / self.mass_kg
        axes = np.sqrt(np.maximum(squares, 0.0))
        return np.maximum(axes, THINNEST * axes.max()) if axes.max() > 0 else None


def held(facts: BodyFacts | None, robots: int) -> Grasps | None:
    """The grasps that are known: one robot alone holds the payload at {1}, whatever else is."""
    if facts is not None and facts.grasps is not None:
        return facts.grasps
    return Grasps(single_robot().R_1i, single_robot().p_1i) if robots == 1 else None


def check_robots(estimate: PayloadEstimate, recording: Recording) -> None:
    """Refuse an estimate of another team.

    Raises:
        InputError: it is of another number of robots than the recording.
    """
    robots = recording.metadata.robots
    if estimate.robots != robots:
        raise InputError(
            f"the estimate is of {estimate.robots} robots; {recording.name} is of {robots} robots"
        )


def facts_of(estimate: PayloadEstimate) -> BodyFacts:
    """The drawable part of an estimate."""
    grasps, inertia = estimate.grasps, estimate.inertia
    R_1c = None if inertia is None else inertia.principal.R_1c
    known = R_1c is not None
    if inertia is not None and R_1c is None:
        R_1c = np.linalg.eigh(inertia.inertia)[1]
        R_1c = R_1c * np.sign(np.linalg.det(R_1c))
    return BodyFacts(
        grasps=None if grasps is None else Grasps(grasps.R_1i, grasps.p_1i),
        mass_kg=None if estimate.mass is None else estimate.mass.mass,
        p_1c=estimate.p_1c,
        R_1c=R_1c,
        principal_kgm2=None if inertia is None else inertia.principal.moments,
        axes_known=known,
    )

"""Where a team's linearisation stands: robots as a calibration found them, in the numbers of the catalogue's causes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from discrepancy.candidate import Candidate
from estimator.arm.unit import AT, ArmUnit
from estimator.arrays import Array

_GROUPS: dict[str, tuple[str, ...]] = {
    "phi_zero": ("phi_zero",),
    "theta_zero": ("theta_zero",),
    "link_length": ("proximal_length", "rod_length", "radius"),
    "sea_scale": ("stiffness_ratio",),
    "sea_bias": ("tau_zero",),
    "base_tilt": ("tilt",),
}
"""Groups of ``ArmUnit.x`` that hold a cause's parameters, in their order."""


def places_of(candidate: Candidate) -> tuple[int, NDArray[np.intp]] | None:
    """Where a candidate's parameters are in ``ArmUnit.x`` of a team: the robot's row, columns; None where nowhere."""
    groups = _GROUPS.get(candidate.cause)
    if groups is None or candidate.transient is not None:
        return None
    robot = (candidate.robot or 1) - 1
    if candidate.joint is None:
        return robot, np.arange(AT[groups[0]].start, AT[groups[0]].stop)
    return robot, np.array([AT[group].start + candidate.joint - 1 for group in groups])


def origin_of(candidate: Candidate, origin: ArmUnit | None) -> Array | None:
    """Values of a candidate's parameters where all is linear, shape (k,), in their own units; None where all is 0.

    Args:
        candidate: of a team's catalogue.
        origin: how far the robots are there from where they were believed to be, ``x`` of shape (N, COUNT).
    """
    place = places_of(candidate)
    return None if origin is None or place is None else np.asarray(origin.x[place], dtype=np.float64)


def beyond(candidate: Candidate, values: Array, origin: ArmUnit | None) -> Array:
    """Values of a candidate beyond what the robots, as they were found, have already."""
    there = origin_of(candidate, origin)
    return values if there is None else values - there

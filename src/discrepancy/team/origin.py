"""Where a team's linearisation stands: robots as a calibration found them, in the numbers of the catalogue's causes."""

from __future__ import annotations

import numpy as np

from discrepancy.rig import Candidate
from estimator.arm.unit import ArmUnit
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


def origin_of(candidate: Candidate, units: ArmUnit | None) -> Array | None:
    """Values of a candidate's parameters at which robots stand, shape (k,), in their own units; None where all is 0.

    Args:
        candidate: of a team's catalogue.
        units: the robots, ``x`` of shape (N, COUNT); None for robots as designed.
    """
    groups = _GROUPS.get(candidate.cause)
    if units is None or groups is None or candidate.transient is not None:
        return None
    robot = (candidate.robot or 1) - 1
    if candidate.joint is None:
        return np.asarray(units.of(groups[0])[robot], dtype=np.float64)
    return np.array([units.of(group)[robot, candidate.joint - 1] for group in groups])

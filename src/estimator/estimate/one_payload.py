"""Are recordings of one payload? Without labels, what each of them alone says of the mass has to tell."""

from collections.abc import Iterable, Sequence

import numpy as np

from estimator.errors import InputError
from estimator.estimate.grasp_estimate import GraspEstimate
from estimator.estimate.joint import estimate_joint
from estimator.estimate.statics import MassEstimate, estimate_from_holds
from estimator.estimate.uncertainty import WINDOW_S
from estimator.signals.grasp_data import GraspData
from estimator.signals.holds import Hold

MASS_TOLERANCE = 0.05
"""Recordings whose masses differ by more than this share are not of one payload, if beyond ``MASS_SIGMAS`` as well.
Chosen: no calibration error explains more."""
MASS_SIGMAS = 6.0
"""The same in sums of both standard errors. Chosen."""


def mass_alone(
    data: GraspData, holds: Sequence[Hold], grasps: GraspEstimate | None, window_s: float = WINDOW_S
) -> MassEstimate | None:
    """The mass by one recording alone, as ``estimate_payload`` has it; None where it does not tell.

    Args:
        data: the recording.
        holds: its static holds.
        grasps: grasp frames from this recording alone, or None where it does not determine them.
        window_s: length of the windows for standard errors [s].
    """
    try:
        mass, com, _ = estimate_from_holds(holds, grasps, data.gravity_mps2)
        if com is None and grasps is not None:
            return estimate_joint([data], grasps, window_s)[0].mass
    except (InputError, FloatingPointError, np.linalg.LinAlgError):
        return None
    return mass


def check_one_payload(masses: Iterable[tuple[str, MassEstimate | None]]) -> None:
    """Compare what recordings say of the mass, each by its name.

    Raises:
        InputError: two of them differ by more than their errors and any calibration explain.
    """
    found = [(mass.mass, mass.se, name) for name, mass in masses if mass is not None]
    if not found:
        return
    (low, low_se, light), (high, high_se, heavy) = min(found), max(found)
    if high - low > max(MASS_TOLERANCE * high, MASS_SIGMAS * (low_se + high_se)):
        raise InputError(
            f"{light} says {low:.2f} kg and {heavy} says {high:.2f} kg; recordings must be of one payload"
        )

"""The 21 numbers that describe one robot at an instant: three of each kind, one a joint."""

from typing import NamedTuple

import numpy as np


class Kind(NamedTuple):
    """Three of them.

    Attributes:
        name: what they are.
        unit: theirs.
        step: by which they are moved for a central difference.
    """

    name: str
    unit: str
    step: float


KINDS = (
    Kind("phi", "rad", 1e-6),
    Kind("phi_dot", "rad/s", 1e-5),
    Kind("phi_ddot", "rad/s^2", 1e-4),
    Kind("theta", "rad", 1e-6),
    Kind("theta_dot", "rad/s", 1e-5),
    Kind("theta_ddot", "rad/s^2", 1e-4),
    Kind("tau", "N m", 1e-4),
)
COUNT = 3 * len(KINDS)
STEPS = np.repeat([kind.step for kind in KINDS], 3)
PHI, PHI_DOT, PHI_DDOT, THETA, THETA_DOT, THETA_DDOT, TAU = (slice(k, k + 3) for k in range(0, COUNT, 3))


def with_its_rates(angle: slice) -> slice:
    """``PHI`` or ``THETA`` with rates and accelerations."""
    return slice(angle.start, angle.start + 9)

"""Numbers that the balance of forces does not bear out are withheld, with the reason.

Robots that carry a payload in part know the part they carry: they make a mass of it that looks as good as any.
"""

from dataclasses import replace

import numpy as np

from estimator.estimate.result import PayloadEstimate
from estimator.estimate.statics import CONTRADICTION

AT_GIMBAL_M = 5e-3
"""A lone robot whose payload has its centre of mass so near the gimbal [m] turns it without a moment, which is what a
payload that others carry, too, looks like. Measured: one of three robots finds it within 1.2 mm."""
FORCE_WITHHELD = 0.1
"""Forces left over, as a share of the weight, beyond which mass and all that follows from it are withheld. Measured:
poorly calibrated robots leave up to 0.04, random trials with one robot of three missing 0.11 and more."""


def withheld(estimate: PayloadEstimate, team: int) -> PayloadEstimate:
    """The estimate without what its balance does not bear out, and with the reason among the flags.

    Args:
        estimate: as its equations have it.
        team: number of robots that carry the payload, as far as the recordings say.
    """
    if estimate.mass is None:
        return estimate
    if why := _why(estimate, team):
        flag = f"Mass, centre of mass and inertia are withheld: {why}"
        recordings = tuple(replace(recording, inertia=None) for recording in estimate.recordings)
        return replace(
            estimate, mass=None, p_1c=None, p_1c_covariance=None, inertia=None, recordings=recordings,
            flags=(flag, *estimate.flags),
        )  # fmt: skip
    doubts = {weak.reason for weak in estimate.undetermined if CONTRADICTION in weak.reason}
    if estimate.p_1c is None and doubts:
        flag = f"The mass is withheld: {min(doubts)}; is a robot missing?"
        return replace(estimate, mass=None, flags=(flag, *estimate.flags))
    return estimate


def _why(estimate: PayloadEstimate, team: int) -> str | None:
    robots = estimate.robots
    if team > robots:
        have = "one robot" if robots == 1 else f"{robots} robots"
        return (
            f"the metadata are of a team of {team} robots and the samples of {have}; the others carry, too."
        )
    lever = None if estimate.p_1c is None else float(np.linalg.norm(estimate.p_1c))
    if robots == 1 and estimate.contradicts and (lever is None or lever < AT_GIMBAL_M):
        return (
            "the forces of this robot are not those of one payload that it carries alone, and have no lever on it; do "
            "other robots carry it, too?"
        )
    left = [(r.force_residual, r.name) for r in estimate.recordings if r.force_residual is not None]
    if left and max(left)[0] > FORCE_WITHHELD:
        share, name = max(left)
        return (
            f"in {name} the robots' forces leave {100 * share:.0f} % of the weight over; is a robot missing, or a "
            "torque's sign or column wrong?"
        )
    return None

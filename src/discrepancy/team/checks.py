"""What recordings of a team must be before they are held against a model of it."""

from collections.abc import Sequence

import numpy as np

from discrepancy.team.linear.signals import TEAM_TRIM_S
from estimator.arm.unit import ArmUnit
from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from estimator.estimate.statics import CONTRADICTION
from estimator.recording.checks import check_carries
from estimator.recording.model import Recording

GOOD_S = 30.0
"""With which a diagnosis starts to be of use; only said. Chosen."""

LEAST_S = 5.0
"""Of all recordings together below which nothing is diagnosed. Chosen."""


def check_recordings(recordings: Sequence[Recording]) -> None:
    """Enough of them, and all of one team.

    Raises:
        InputError: there is none, one is of robots that hold nothing, they have one robot or differ in robots or
            design, or they are too short.
    """
    if not recordings:
        raise InputError("no recording given; name at least one file")
    for recording in recordings:
        check_carries(recording, "diagnosed")
    first = recordings[0]
    if first.metadata.robots < 2:
        raise InputError(
            f"{first.name} has one robot; without a second one nothing tells where the payload really is, so there is "
            "nothing to diagnose"
        )
    used = [max(0.0, recording.time[-1] - recording.time[0] - 2.0 * TEAM_TRIM_S) for recording in recordings]
    if sum(used) < LEAST_S:
        names = ", ".join(recording.name for recording in recordings)
        raise InputError(
            f"{names}: {sum(used):.1f} s are left when {TEAM_TRIM_S:g} s are dropped at both ends; a "
            f"diagnosis needs at least {LEAST_S:g} s, and {GOOD_S:g} s of motion to be worth much"
        )
    for other in recordings[1:]:
        if other.metadata.robots != first.metadata.robots:
            raise InputError(
                f"{other.name} has {other.metadata.robots} robots and {first.name} has {first.metadata.robots}; "
                "recordings of one payload must have the same robots"
            )
        if other.metadata.design != first.metadata.design:
            raise InputError(
                f"{other.name} and {first.name} are of robots of different design; diagnose one at a time"
            )
        if not same_units(other.metadata.units, first.metadata.units):
            raise InputError(
                f"{other.name} and {first.name} carry different calibrations; give one to both (--calibration)"
            )


def same_units(a: ArmUnit | None, b: ArmUnit | None) -> bool:
    """Whether robots are known to be the same: as designed, or as they are."""
    return a is b or (a is not None and b is not None and np.array_equal(a.x, b.x))


def check_estimate(estimate: PayloadEstimate) -> None:
    """Without a payload there is no model; say why, where wrenches that contradict each other are the reason.

    Raises:
        InputError: they do.
    """
    if estimate.p_1c is None and any(CONTRADICTION in flag for flag in estimate.flags):
        names = ", ".join(recording.name for recording in estimate.recordings)
        raise InputError(
            f"{names}: the robots' wrenches do not add up to one payload, so there is nothing to hold the data "
            "against; is a robot missing, or a torque's sign or column wrong?"
        )

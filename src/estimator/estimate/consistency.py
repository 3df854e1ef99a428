"""Check that the recordings of one payload are consistent, to detect wrong rather than noisy data.

Two errors are undetectable. Exchanging all columns of two robots in a *single* recording only renumbers the robots. A
wrong torque sign or scale in all samples looks like another payload, unless internal forces or the inertia reveal it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.unit import ArmUnit
from estimator.arrays import Array, inertia_parameters
from estimator.errors import InputError
from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.inertia import InertiaEstimate
from estimator.estimate.leftover import Steps
from estimator.estimate.result import PayloadEstimate
from estimator.estimate.statics import CONTRADICTION
from estimator.estimate.uncertainty import StepReport
from estimator.rigid_team import fuse, inertia_regressor
from estimator.signals import STILL_RATE_RADPS, STILL_SPEED_MPS, GraspData
from estimator.statistics import rms_length

NOT_RIGID_ERROR = 0.5
NOT_RIGID_FLAG = 0.1
"""Residual of a pair's twists relative to their motion, above which to report an error (not one rigid body) or a flag.
"""
NOT_ONE_BODY = "do not move like one rigid body"
"""Words of these errors and flags."""
ANGLE_TOLERANCE_RAD = np.deg2rad(5.0)
POSITION_TOLERANCE = 0.05
"""Disagreement of two recordings' grasps [m, and per m of distance] above which calibration errors do not explain it.
"""
FORCE_FLAG = 0.05
MOMENT_FLAG = 0.05
"""Limits of the wrench balance: force residual over weight; moment residual over weight and over the grasps' span."""


@dataclass(frozen=True)
class Trial:
    """Processed data of one recording, with information from its metadata.

    Attributes:
        name: name in messages.
        kind, payload: ``"random"``, ``"periodic"`` or ``"static"``; label of the payload, or None.
        steps: rounding steps of its channels, or None to skip the check for contradictions between robots.
        team: number of robots that carried the payload, according to the metadata.
        units: the robots with their deviations, or None for robots as designed.
    """

    name: str
    kind: str
    payload: str | None
    data: GraspData
    steps: Steps | None = None
    team: int = 1
    units: ArmUnit | None = None


def check_same_payload(trials: Sequence[Trial]) -> str | None:
    """Return the common payload label, or None if no recording has one.

    Raises:
        InputError: there is no recording, or numbers of robots, payload labels or gravity differ.
    """
    if not trials:
        raise InputError("no recording was given")
    first = trials[0]
    for trial in trials[1:]:
        if trial.data.robots != first.data.robots:
            raise InputError(
                f"{trial.name} has {trial.data.robots} robots and {first.name} has {first.data.robots}; "
                "recordings of one payload must have the same robots"
            )
        if trial.data.gravity_mps2 != first.data.gravity_mps2:
            raise InputError(f"{trial.name} and {first.name} differ in gravity_mps2")
    labelled = [trial for trial in trials if trial.payload is not None]
    for trial in labelled[1:]:
        if trial.payload != labelled[0].payload:
            raise InputError(
                f"{trial.name} is of payload {trial.payload!r} and {labelled[0].name} of "
                f"{labelled[0].payload!r}; estimate one payload at a time"
            )
    return labelled[0].payload if labelled else None


def check_rigid(name: str, grasps: GraspEstimate) -> list[str]:
    """Return flags for pairs of robots whose twists do not fit one rigid body.

    Raises:
        InputError: a pair's residual is comparable to its motion.
    """
    flags = []
    for i, j in combinations(range(grasps.robots), 2):
        distance = float(np.linalg.norm(grasps.p_1i[i] - grasps.p_1i[j]))
        angular = float(np.mean(grasps.angular_motion_rms[[i, j]]))
        linear = max(*grasps.linear_motion_rms[[i, j]], distance * angular)
        ratio = max(
            grasps.angular_residual_rms[i, j] / angular if angular else 0.0,
            grasps.linear_residual_rms[i, j] / linear if linear else 0.0,
        )
        what = (
            f"{name}: robots {i + 1} and {j + 1} {NOT_ONE_BODY} "
            f"({100 * ratio:.0f} % of their motion is unexplained)"
        )
        if ratio > NOT_RIGID_ERROR:
            raise InputError(f"{what}; check their columns and units")
        if ratio > NOT_RIGID_FLAG:
            flags.append(f"{what}.")
    return flags


def check_disagreement_is_noise(name: str, steps: Sequence[StepReport]) -> None:
    """Check that undetermined grasps are due to a lack of motion.

    Raises:
        InputError: the robots disagree by more than any encoder noise, so they are not on one rigid body.
    """
    for step in steps:
        limit = STILL_RATE_RADPS if step.step.startswith("rotation") else STILL_SPEED_MPS
        if step.noise > limit:
            robot = step.step.split("_1")[1]
            raise InputError(
                f"{name}: robots 1 and {robot} {NOT_ONE_BODY} (they disagree by "
                f"{step.noise:.2g} {step.unit.split(' per')[0]} rms); check their columns and units"
            )


def check_agreement(names: Sequence[str], grasps: Sequence[GraspEstimate]) -> None:
    """Check that the recordings, each on its own, give the same grasps.

    Raises:
        InputError: they differ. The message names the recording that stands out and, if exchanging two robots' columns
            would explain it, those robots.
    """
    bad = [
        (a, b)
        for a, b in combinations(range(len(names)), 2)
        if (_disagreement(grasps[a], grasps[b])) is not None
    ]
    if not bad:
        return
    counts = np.bincount(np.ravel(bad), minlength=len(names))
    odd = int(np.argmax(counts))
    others = [b if a == odd else a for a, b in bad if odd in (a, b)]
    what = _disagreement(grasps[odd], grasps[others[0]])
    alone = np.sum(counts == counts[odd]) == 1
    subject = f"{names[odd]} disagrees" if alone else f"{names[odd]} and {names[others[0]]} disagree"
    rest = "with the other recordings" if alone else "with each other"
    message = f"{subject} {rest} about the grasps ({what})"
    for i, j in combinations(range(grasps[odd].robots), 2):
        if all(_disagreement(_exchanged(grasps[odd], i, j), grasps[other]) is None for other in others):
            raise InputError(f"{message}, as if the columns of robots {i + 1} and {j + 1} were exchanged")
    raise InputError(f"{message}; are they of the same payload and grasps?")


def wrench_balance(
    data: GraspData, grasps: GraspEstimate, mass: float, p_1c: Array, inertia: InertiaEstimate | None
) -> tuple[float, float | None]:
    """Return force residual over weight, and moment residual about the CoM over weight [m]; rms over the trial.

    Without an inertia the second result is None.
    """
    motion = fuse(data, grasps)
    lever = np.cross(motion.alpha, p_1c) + np.cross(motion.omega, np.cross(motion.omega, p_1c))
    force = motion.force - mass * (motion.acceleration + lever + data.gravity_mps2 * motion.up)
    weight = mass * data.gravity_mps2
    if inertia is None:
        return rms_length(force) / weight, None
    X = inertia_regressor(motion.omega, motion.alpha)
    moment = motion.moment - np.cross(p_1c, motion.force) - X @ inertia_parameters(inertia.inertia)
    return rms_length(force) / weight, rms_length(moment) / weight


def balance_flags(name: str, force: float, moment_m: float | None, grasps: GraspEstimate) -> list[str]:
    """Return flags for a recording whose wrenches do not balance the payload's motion."""
    flags = []
    if force > FORCE_FLAG:
        flags.append(
            f"{name}: the robots' forces do not add up to one payload ({100 * force:.0f} % of its weight is "
            "left over); check the signs and columns of the torques."
        )
    span = float(np.max(np.linalg.norm(grasps.p_1i, axis=1))) if grasps.robots > 1 else 1.0
    if moment_m is not None and moment_m > MOMENT_FLAG * span:
        flags.append(
            f"{name}: the moments do not balance, as if the centre of mass were {moment_m:.2g} m elsewhere; "
            "check the torques' columns."
        )
    return flags


def _disagreement(a: GraspEstimate, b: GraspEstimate) -> str | None:
    for j in range(1, a.robots):
        part = slice(6 * (j - 1), 6 * j)
        variance = np.diag(a.covariance)[part] + np.diag(b.covariance)[part]
        angle = float(Rotation.from_matrix(a.R_1i[j].T @ b.R_1i[j]).magnitude())
        shift = float(np.linalg.norm(a.p_1i[j] - b.p_1i[j]))
        allowed = POSITION_TOLERANCE * (1 + float(np.linalg.norm(a.p_1i[j])))
        if angle > max(ANGLE_TOLERANCE_RAD, 5 * np.sqrt(variance[:3].sum())):
            return f"R_1{j + 1} differs by {np.rad2deg(angle):.0f} deg"
        if shift > max(allowed, 5 * np.sqrt(variance[3:].sum())):
            return f"p_1{j + 1} differs by {shift:.2g} m"
    return None


def _exchanged(grasps: GraspEstimate, i: int, j: int) -> GraspEstimate:
    """Renumber robots with index i < j; the covariance stays unchanged and serves only as a rough tolerance."""
    order = np.arange(grasps.robots)
    order[[i, j]] = order[[j, i]]
    R, p = grasps.R_1i[order], grasps.p_1i[order]
    return replace(grasps, R_1i=R[0].T @ R, p_1i=(p - p[0]) @ R[0])


AT_GIMBAL_M = 5e-3
"""Distance of the centre of mass from the gimbal of a single robot [m], below which its moments vanish. A robot of a
team with missing robots looks the same. Measured: for one of three robots the distance is below 1.2 mm."""
FORCE_WITHHELD = 0.1
"""Force residual over weight above which mass and all dependent results are withheld. Measured: up to 0.04 for poorly
calibrated robots, 0.11 and more for random trials with one of three robots missing."""


def withheld(estimate: PayloadEstimate, team: int) -> PayloadEstimate:
    """Remove results that the force balance contradicts, and add the reason to the flags.

    If some robots of a team are missing, the others determine only the part that they carry, and their mass looks
    plausible. ``team`` is the number of robots that carry the payload, according to the recordings.
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

"""What two estimates both give."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from estimator import so3
from estimator.arm.unit import MIXED, in_encoder_frames
from estimator.arrays import Array, inertia_parameters
from estimator.errors import InputError
from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.inertia import PARAMETERS
from estimator.estimate.result import PayloadEstimate
from mocobot.comparison.difference import Group

XYZ = ("x", "y", "z")


def groups_of(a: PayloadEstimate, b: PayloadEstimate) -> list[Group]:
    """Mass, centre of mass, inertia and grasps, as far as both have them.

    Raises:
        InputError: they are of different numbers of robots.
    """
    if a.robots != b.robots:
        raise InputError(
            f"the estimates are of {a.robots} and {b.robots} robots; both must be of the same number"
        )
    groups = []
    if a.mass and b.mass:
        mass = [(np.array([one.mass]), np.array([[one.se**2]])) for one in (a.mass, b.mass)]
        groups.append(Group.of("mass", "kg", ("",), *mass))
    if in_encoder_frames(a.units) != in_encoder_frames(b.units):
        return groups
    if a.p_1c is not None and b.p_1c is not None:
        assert a.p_1c_covariance is not None
        assert b.p_1c_covariance is not None
        com = (a.p_1c, a.p_1c_covariance), (b.p_1c, b.p_1c_covariance)
        groups.append(Group.of("centre of mass", "m", XYZ, *com))
    if a.inertia and b.inertia:
        inertia = [(inertia_parameters(one.inertia), one.covariance) for one in (a.inertia, b.inertia)]
        groups.append(Group.of("inertia", "kg m^2", PARAMETERS, *inertia))
    if a.grasps and b.grasps:
        groups += grasp_groups(a.grasps, b.grasps)
    return groups


def grasp_groups(
    a: GraspEstimate, b: GraspEstimate, prefix: str = "", common: tuple[Array, Array] | None = None
) -> list[Group]:
    """Rotation and position of every grasp but the first, in {1}.

    Args:
        a, b: of the same number of robots.
        prefix: of the groups' names.
        common: as of ``Group.of``, for (d_2, e_2, ...) as in ``GraspEstimate``.
    """
    groups = []
    by_a, by_b = common or (np.zeros(len(a.covariance)),) * 2
    for i in range(1, a.robots):
        turn, shift = slice(6 * i - 6, 6 * i - 3), slice(6 * i - 3, 6 * i)
        name, x = f"{prefix}grasp of robot {i + 1}", Rotation.from_matrix(a.R_1i[i]).as_rotvec()
        first = _turned(x, a.covariance[turn, turn], by_a[turn])
        other = _turned(_near(x, b.R_1i[i]), b.covariance[turn, turn], by_b[turn])
        groups.append(
            Group.of(f"{name}, rotation", "deg", XYZ, first[:2], other[:2], common=(first[2], other[2]))
        )
        places = [(one.p_1i[i], one.covariance[shift, shift]) for one in (a, b)]
        groups.append(Group.of(f"{name}, position", "m", XYZ, *places, common=(by_a[shift], by_b[shift])))
    return groups


def _near(x: Array, R: Array) -> Array:
    """Rotation vector of R, of the two within 2 pi the one that is nearer to x [rad], shape (3,)."""
    y = Rotation.from_matrix(R).as_rotvec()
    angle = float(np.linalg.norm(y))
    other = y * (1.0 - 2.0 * np.pi / angle) if angle > 0 else y
    return min((y, other), key=lambda one: float(np.linalg.norm(one - x)))


def _turned(x: Array, covariance: Array, by: Array) -> tuple[Array, Array, Array]:
    """A rotation vector, its covariance and its derivative from those of an error rotation in {1}, all in degrees."""
    J = np.rad2deg(np.linalg.inv(so3.left_jacobian(x)))
    return np.rad2deg(x), J @ covariance @ J.T, J @ by


def notes_of(a: PayloadEstimate, b: PayloadEstimate) -> list[str]:
    """What a reader must know of both."""
    notes = _one_sided(a, b)
    if in_encoder_frames(a.units) != in_encoder_frames(b.units):
        notes.append(MIXED)
    if a.payload != b.payload:
        notes.append(f"The payloads go by different names: {a.payload or 'none'} and {b.payload or 'none'}.")
    doubtful = [name for name, one in (("A", a), ("B", b)) if one.contradicts]
    if doubtful:
        notes.append(
            f"In {' and '.join(doubtful)} the robots contradict each other beyond noise: standard errors are too small "
            "there, and differences look larger than they are; calibrate the robots first."
        )
    if a.units is not None and b.units is not None and np.array_equal(a.units.x, b.units.x):
        notes.append(
            "Both take the robots from the same calibration: its errors are in both, and differences are better known "
            "than is said."
        )
    elif a.units is not None or b.units is not None:
        notes.append("They take the robots to be different ones, as calibrated or as designed.")
    return notes


def _one_sided(a: PayloadEstimate, b: PayloadEstimate) -> list[str]:
    kinds: Sequence[tuple[str, object, object]] = (
        ("mass", a.mass, b.mass),
        ("centre of mass", a.p_1c, b.p_1c),
        ("inertia", a.inertia, b.inertia),
        ("grasps", a.grasps, b.grasps),
    )
    return [
        f"The {what} is determined by {'A' if there is not None else 'B'} alone."
        for what, there, other in kinds
        if (there is None) != (other is None)
    ]

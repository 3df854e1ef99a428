"""Where robots and payload are: from the grasps and the joint angles, as no sensor says where a base stands.

The world W lies on the floor under robot 1, its axes those of {b1}. All bases are taken as level, but for tilts that
a calibration has found: any other is what a diagnosis looks for, not what a picture assumes.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from estimator import so3
from estimator.arm.unit import Arms, ArmUnit
from estimator.arrays import Array
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording

SPACING_M = 1.2
"""Distance of robots in a row, where nothing tells how they stand."""


@dataclass(frozen=True)
class Grasps:
    """Grasp frames in {1}, estimated or true.

    Attributes:
        R_1i: orientations, shape (N, 3, 3).
        p_1i: positions [m], shape (N, 3).
    """

    R_1i: Array
    p_1i: Array


@dataclass(frozen=True)
class Bases:
    """Base frames {b} in the world.

    Attributes:
        R_Wb: orientations, turned about z only where nothing is known of a tilt, shape (N, 3, 3).
        p_Wb: positions [m], shape (N, 3).
    """

    R_Wb: Array
    p_Wb: Array


@dataclass(frozen=True)
class PayloadMotion:
    """The payload's frame {1} in the world, and how far each robot's flange is from its grasp.

    Attributes:
        R_W1: orientations, shape (Q, 3, 3).
        p_W1: positions [m], shape (Q, 3).
        gap_rotation_rad: angle between flange and grasp frame, shape (Q, N).
        gap_position_m: distance between them, shape (Q, N).
    """

    R_W1: Array
    p_W1: Array
    gap_rotation_rad: Array
    gap_position_m: Array

    @property
    def quaternion(self) -> Array:
        """Orientations as (x, y, z, w), shape (Q, 4)."""
        return Rotation.from_matrix(self.R_W1).as_quat()


def place_bases(R_bi: Array, p_bi: Array, grasps: Grasps, height_m: float) -> Bases:
    """Bases that the grasps and the mean of what the joints say ask for.

    Args:
        R_bi: orientation of each flange in its {b}, shape (Q, N, 3, 3).
        p_bi: wrist positions in {b} [m], shape (Q, N, 3).
        grasps: how the payload is held.
        height_m: height of {b1} over the floor [m].
    """
    R_b1b, p_b1b = [np.eye(3)], [np.zeros(3)]
    for i in range(1, R_bi.shape[1]):
        turn = so3.chordal_mean(R_bi[:, 0] @ grasps.R_1i[i] @ np.swapaxes(R_bi[:, i], -1, -2))
        yaw = np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
        R = Rotation.from_rotvec([0.0, 0.0, yaw]).as_matrix()
        R_b1b.append(R)
        p_b1b.append(np.mean(p_bi[:, 0] + R_bi[:, 0] @ grasps.p_1i[i] - p_bi[:, i] @ R.T, axis=0))
    return Bases(np.array(R_b1b), np.array(p_b1b) + np.array([0.0, 0.0, height_m]))


def in_a_row(robots: int, height_m: float) -> Bases:
    """Robots side by side, for recordings that do not tell how they stand."""
    places = np.zeros((robots, 3))
    places[:, 0], places[:, 2] = SPACING_M * np.arange(robots), height_m
    return Bases(np.tile(np.eye(3), (robots, 1, 1)), places)


def placed(
    R_bi: Array, p_bi: Array, grasps: Grasps | None, height_m: float, at: slice = slice(None)
) -> tuple[Bases, PayloadMotion | None]:
    """Bases, and the payload at the samples ``at``; a row of robots and None where the grasps are not known.

    Arguments as for ``place_bases``.
    """
    if grasps is None:
        return in_a_row(R_bi.shape[1], height_m), None
    bases = place_bases(R_bi, p_bi, grasps, height_m)
    return bases, payload_motion(R_bi[at], p_bi[at], grasps, bases)


def payload_motion(R_bi: Array, p_bi: Array, grasps: Grasps, bases: Bases) -> PayloadMotion:
    """The payload where all robots together hold it: the mean over robots of what each says.

    Shapes of ``R_bi`` and ``p_bi`` as for ``place_bases``.
    """
    R_Wi = bases.R_Wb @ R_bi
    p_Wi = np.einsum("nij,qnj->qni", bases.R_Wb, p_bi) + bases.p_Wb
    R_W1 = so3.chordal_mean(np.swapaxes(R_Wi @ np.swapaxes(grasps.R_1i, -1, -2), 0, 1))
    p_W1 = np.mean(p_Wi - np.einsum("qij,nj->qni", R_W1, grasps.p_1i), axis=1)
    held = p_W1[:, None] + np.einsum("qij,nj->qni", R_W1, grasps.p_1i)
    # |R1 - R2|_F = 2 sqrt(2) sin(angle / 2): exact for small angles, where arccos is not.
    chord = np.linalg.norm(R_Wi - R_W1[:, None] @ grasps.R_1i, axis=(-2, -1)) / np.sqrt(8.0)
    return PayloadMotion(
        R_W1, p_W1, 2.0 * np.arcsin(np.clip(chord, 0.0, 1.0)), np.linalg.norm(p_Wi - held, axis=-1)
    )


def as_estimated(recording: Recording, estimate: PayloadEstimate | None) -> Recording:
    """A recording whose robots are those of its estimate, where it says nothing of them itself and they fit."""
    metadata, units = recording.metadata, None if estimate is None else estimate.units
    if units is None or metadata.units is not None:
        return recording
    if units.design != metadata.design or len(units.x) != metadata.robots:
        return recording
    return replace(recording, metadata=replace(metadata, units=units))


def tilted(bases: Bases, arms: Arms) -> Bases:
    """Bases as they stand: level ones, turned by what a calibration says of each."""
    if not isinstance(arms, ArmUnit) or not np.any(arms.of("tilt")):
        return bases
    R: Array = bases.R_Wb @ arms.R_ba
    return Bases(R, bases.p_Wb)

"""The frames that numbers are in: the zero of theta_x turns {i} about its x axis, and no carry shows it."""

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.unit import ArmUnit
from estimator.arrays import Array

ENCODERS = "frames {i} as the encoders define them: each turned about its x axis by the zero of that theta_x"
MIXED = "Frames are the encoders' in one and the drawing's in the other: of the payload, the mass alone is compared."


def frames_said(zero_sd_rad: float) -> str:
    """The frames of encoders, with the tolerance of their zeros."""
    return f"{ENCODERS} (0 +- {np.rad2deg(zero_sd_rad):.2g} deg, which is not in the standard errors)"


def in_encoder_frames(units: ArmUnit | None) -> bool:
    """Whether theta_x is taken as it is read, for robots as designed (None) or as calibrated."""
    return units is None or not units.of("theta_zero")[..., 2].any()


def seen_by_encoders(zeros: Array, R_1i: Array, p_1i: Array, *vectors: Array) -> list[Array]:
    """What a drawing has, in the frames of encoders.

    Args:
        zeros: of theta_x of every robot, reading minus truth [rad], shape (N,).
        R_1i, p_1i: grasp frames, shapes (N, 3, 3) and (N, 3).
        vectors: any others in {1}, as columns.
    """
    turn = Rotation.from_rotvec(np.outer(zeros, [1.0, 0.0, 0.0])).as_matrix()
    return [turn[0].T @ R_1i @ turn, p_1i @ turn[0], *(turn[0].T @ vector for vector in vectors)]

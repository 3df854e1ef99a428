"""From the true joint motion and spring torques of arms to pose, twist and wrench at the grasp."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from estimator.arm.delta import leg_geometry, wrist_motion
from estimator.arm.dynamics import wrench_on_payload
from estimator.arm.gimbal import Gimbal
from estimator.arm.numbers import Arm
from estimator.arrays import Array
from estimator.so3 import cross, times


class ArmData(NamedTuple):
    """What one arm tells of its grasp; leading axes are samples, or anything else.

    Attributes:
        R_bi: orientation of {i} in the arm's base frame, shape (..., 3, 3).
        h: wrist position there [m], shape (..., 3).
        twist: body twist (omega_i [rad/s], v_i [m/s]) in {i}, equation (29), shape (..., 6).
        twist_dot: its component-wise time derivative, shape (..., 6).
        wrench: (m_i [N m], f_i [N]) of the arm ON the payload at the origin of {i}, in {i}, shape (..., 6).
    """

    R_bi: Array
    h: Array
    twist: Array
    twist_dot: Array
    wrench: Array


def arm_data(
    phi: tuple[Array, Array, Array], theta: tuple[Array, Array, Array], tau: Array, arm: Arm
) -> ArmData:
    """Kinematics and dynamics of an arm (paper, equations (28)-(29), section IV.B).

    Args:
        phi: driven angles [rad], rates and accelerations, each of shape (..., 3).
        theta: gimbal angles (z, y, x) [rad], rates and accelerations, each (..., 3).
        tau: spring torques [N m], shape (..., 3).
        arm: the arm's numbers; leading axes of theirs go with those of the angles.

    Raises:
        InputError: no wrist position exists at some configuration.
    """
    legs = leg_geometry(phi[0], arm)
    h_dot, h_ddot = wrist_motion(legs, phi[1], phi[2])
    gimbal = Gimbal.at(theta[0])
    R_bi = gimbal.rotation()
    R_ib = np.swapaxes(R_bi, -1, -2)
    omega, omega_dot = gimbal.motion(theta[1], theta[2])
    v = times(R_ib, h_dot)
    v_dot = times(R_ib, h_ddot) - cross(omega, v)
    wrench = wrench_on_payload(phi, theta, tau, arm, legs, gimbal, R_bi, h_ddot)
    return ArmData(
        R_bi,
        legs.h,
        np.concatenate([omega, v], axis=-1),
        np.concatenate([omega_dot, v_dot], axis=-1),
        wrench,
    )

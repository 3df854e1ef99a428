"""The paper's data points D_iq: pose, twist, twist derivative and wrench of every grasp at every sample."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array


@dataclass(frozen=True)
class GraspData:
    """Data points D_iq = {T_bi, V_i, dV_i/dt, F_i} (paper, section II) of Q samples and N robots.

    {b} is each robot's own base frame (the paper's {i0} up to a constant), {i} its grasp frame on the
    payload side of the gimbal. Twists and wrenches list the angular part first, as in the paper.

    Attributes:
        time: sample times [s], shape (Q,).
        R_bi: orientation g(theta) of {i} in {b}, shape (Q, N, 3, 3).
        p_bi: wrist position h(phi) in {b} [m], shape (Q, N, 3).
        twist: body twist (omega_i [rad/s], v_i [m/s]) in {i}, equation (29), shape (Q, N, 6).
        twist_dot: component-wise time derivative of ``twist`` (v-dot, not the acceleration), shape (Q, N, 6).
        wrench: wrench (m_i [N m], f_i [N]) of robot i ON the payload at the origin of {i}, in {i},
            shape (Q, N, 6).
        rate_hz: sampling rate [Hz].
        gravity_mps2: magnitude of gravity, along -z of every base frame [m/s^2].
    """

    time: Array
    R_bi: Array
    p_bi: Array
    twist: Array
    twist_dot: Array
    wrench: Array
    rate_hz: float
    gravity_mps2: float

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return self.twist.shape[1]

    @property
    def samples(self) -> int:
        """Number of samples Q."""
        return self.twist.shape[0]

    def at(self, kept: NDArray[np.bool_]) -> GraspData:
        """Some of the samples, shape (Q,)."""
        names = ("time", "R_bi", "p_bi", "twist", "twist_dot", "wrench")
        return replace(self, **{name: getattr(self, name)[kept] for name in names})

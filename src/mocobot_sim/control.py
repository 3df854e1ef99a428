"""Wrist impedance control of one Omnid team, with the SEA torque loop inside; compiled with numba.

Each robot sees only its own joints, as read by its own sensors (calibration errors included), and the design
geometry. Per robot, at the control rate:

    F     = K (ref - h) + D (ref_dot - h_dot) + F_ff               wrist force, in {b}
    tau_d = (dh/dphi)^T F + tau_gravity(phi)                        desired spring torque
    u     = tau_d + k_p (tau_d - tau) - k_d tau_dot                 motor torque

F_ff takes the static load up from the measured wrist force during the first seconds and is then frozen: the
controller never knows the payload.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import mujoco
import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimator.design import OmnidDesign
from estimator.errors import InputError
from mocobot_sim.as_built import AsBuilt
from mocobot_sim.team_index import TeamIndex

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ControlGains:
    """Gains of the wrist impedance and of the SEA torque loop.

    Attributes:
        rate_hz: control rate [Hz].
        stiffness_N_per_m: K, isotropic.
        damping_Ns_per_m: D, isotropic.
        torque_gain: k_p [-].
        torque_rate_gain_s: k_d [s].
        rate_filter_s: time constant of the first-order filter on differenced phi and tau [s].
        take_up_s: how long F_ff follows the measured wrist force [s].
        take_up_time_constant_s: with which time constant it follows [s].
        motor_torque_limit_Nm: saturation of u [N m].
    """

    rate_hz: float = 1000.0
    stiffness_N_per_m: float = 400.0
    damping_Ns_per_m: float = 50.0
    torque_gain: float = 4.0
    torque_rate_gain_s: float = 0.05
    rate_filter_s: float = 0.002
    take_up_s: float = 1.0
    take_up_time_constant_s: float = 0.3
    motor_torque_limit_Nm: float = 40.0

    def to_dict(self) -> dict[str, float]:
        """Plain numbers, keyed as documented for a recording's ``control``."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> ControlGains:
        """Read the gains out of a recording's ``control`` (other keys there are left alone).

        Raises:
            InputError: a gain is missing or not a positive number.
        """
        gains = {}
        for entry in fields(cls):
            value = values.get(entry.name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < np.inf:
                raise InputError(f"control.{entry.name} is {value!r}; it must be a number greater than 0")
            gains[entry.name] = float(value)
        return cls(**gains)


class TeamController:
    """Controller of all robots; holds their filter states and feed-forward forces.

    Args:
        index: addresses in the model.
        design: geometry and masses that the robots believe in.
        gains: control gains.
        data: MuJoCo data of the trial; the controller reads ``qpos`` and writes ``ctrl`` in place.
        as_built: sensor zeros and true stiffness of every unit; empty for robots as designed.
    """

    def __init__(
        self,
        index: TeamIndex,
        design: OmnidDesign,
        gains: ControlGains,
        data: mujoco.MjData,
        as_built: Sequence[AsBuilt] = (),
    ) -> None:
        robots = index.robots
        units = list(as_built) or [AsBuilt()] * robots
        self.feed_forward = np.zeros((robots, 3))  # F_ff in {b} [N]
        self._state = np.zeros((robots, 4, 3))  # phi, tau (previous); their filtered rates
        self._tick = 0
        phi_home = home_phi(design)
        self._fixed = (
            data.qpos,
            data.ctrl,
            index.motor_qpos,
            index.spring_qpos,
            index.actuator,
            np.array([unit.phi_zero_rad for unit in units]) + phi_home,
            np.array([unit.tau_zero_Nm for unit in units]),
            np.array(
                [
                    design.base_radius_m - design.platform_radius_m,
                    design.proximal_length_m,
                    design.rod_length_m,
                    design.sea_stiffness_Nm_per_rad,
                    # gravity torque per cos(phi) of one driven link with half its rod at the knee [N m]
                    design.gravity_mps2
                    * (design.proximal_mass_kg * design.proximal_com_m
                       + 0.5 * design.rod_mass_kg * design.proximal_length_m),
                    # weight that hangs at the wrist [N]
                    design.gravity_mps2 * (design.wrist_mass_kg + 1.5 * design.rod_mass_kg),
                ]
            ),
            np.array(
                [
                    gains.stiffness_N_per_m,
                    gains.damping_Ns_per_m,
                    gains.torque_gain,
                    gains.torque_rate_gain_s,
                    1.0 / gains.rate_hz,
                    1.0 / (1.0 + gains.rate_filter_s * gains.rate_hz),
                    1.0 / (gains.take_up_time_constant_s * gains.rate_hz),
                    gains.motor_torque_limit_Nm,
                ]
            ),
            self._state,
            self.feed_forward,
        )  # fmt: skip
        self._take_up_ticks = round(gains.take_up_s * gains.rate_hz)

    def update(self, ref: Array, ref_dot: Array) -> None:
        """One control tick: read ``qpos``, write ``ctrl``.

        Args:
            ref: commanded wrist positions in every robot's {b} [m], shape (N, 3).
            ref_dot: their rates [m/s], shape (N, 3).
        """
        _update(*self._fixed, ref, ref_dot, self._tick == 0, self._tick < self._take_up_ticks)
        self._tick += 1


def home_phi(design: OmnidDesign) -> float:
    """Driven angle of every leg at the home height [rad]: where ``qpos`` = 0 in the MJCF."""
    reach = design.base_radius_m - design.platform_radius_m
    height = design.home_height_m
    distance = np.hypot(reach, height)
    # Triangle axis - knee - platform joint; the knee is outside the line from axis to platform joint.
    cosine = (design.proximal_length_m**2 + distance**2 - design.rod_length_m**2) / (
        2.0 * design.proximal_length_m * distance
    )
    return float(np.arctan2(height, -reach) - np.arccos(cosine))


@njit(cache=True, nogil=True, fastmath=False)
def _update(  # noqa: PLR0913
    qpos, ctrl, motor, spring, actuator, phi_offset, tau_zero, body, gain, state, feed_forward,
    ref, ref_dot, first, taking_up,
):  # fmt: skip
    reach, proximal, rod, stiffness, link_gravity, wrist_weight = body
    impedance, damping, torque_gain, rate_gain, period, rate_weight, take_up_weight, limit = gain
    s = np.empty((3, 3))
    lever = np.empty(3)
    phi = np.empty(3)
    tau = np.empty(3)
    force = np.empty(3)
    for i in range(motor.shape[0]):
        for k in range(3):
            deflection = qpos[spring[i, k]]
            phi[k] = qpos[motor[i, k]] + deflection + phi_offset[i, k]
            tau[k] = -stiffness * deflection + tau_zero[i, k]
            if first:
                state[i, 0, k] = phi[k]
                state[i, 1, k] = tau[k]
            state[i, 2, k] += rate_weight * ((phi[k] - state[i, 0, k]) / period - state[i, 2, k])
            state[i, 3, k] += rate_weight * ((tau[k] - state[i, 1, k]) / period - state[i, 3, k])
            state[i, 0, k] = phi[k]
            state[i, 1, k] = tau[k]
        h = _legs(phi, reach, proximal, rod, s, lever)

        # h_dot = S^-1 (lever * phi_dot); measured force without the arm's weight f = S^T (tau_load / lever)
        h_dot = _solve(s, lever * state[i, 2])
        for j in range(3):
            measured = 0.0
            for k in range(3):
                measured += s[k, j] * (tau[k] - link_gravity * np.cos(phi[k])) / lever[k]
            if j == 2:
                measured -= wrist_weight
            if first:
                feed_forward[i, j] = measured
            elif taking_up:
                feed_forward[i, j] += take_up_weight * (measured - feed_forward[i, j])
            force[j] = (
                impedance * (ref[i, j] - h[j]) + damping * (ref_dot[i, j] - h_dot[j]) + feed_forward[i, j]
            )
        force[2] += wrist_weight
        leg_force = _solve(s.T, force)
        for k in range(3):
            desired = lever[k] * leg_force[k] + link_gravity * np.cos(phi[k])
            command = desired + torque_gain * (desired - tau[k]) - rate_gain * state[i, 3, k]
            ctrl[actuator[i, k]] = min(max(command, -limit), limit)


@njit(cache=True, nogil=True)
def _legs(phi, reach, proximal, rod, s, lever):
    """Wrist position h; fills the rod vectors s (3, 3) and lever_k = s_k . dc_k/dphi_k.

    c_k is the knee moved inward by the platform radius, so |h - c_k| = rod for all legs and
    S h_dot = lever * phi_dot.
    """
    c = np.empty((3, 3))
    for k in range(3):
        cos_az, sin_az = np.cos(2.0 * np.pi * k / 3.0), np.sin(2.0 * np.pi * k / 3.0)
        radius = reach + proximal * np.cos(phi[k])
        c[k, 0] = radius * cos_az
        c[k, 1] = radius * sin_az
        c[k, 2] = proximal * np.sin(phi[k])
    # Circumcentre of the three c_k, then up along their normal.
    a = c[1] - c[0]
    b = c[2] - c[0]
    n = _cross(a, b)
    nn = n[0] * n[0] + n[1] * n[1] + n[2] * n[2]
    aa = a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
    bb = b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
    centre = (aa * _cross(b, n) + bb * _cross(n, a)) / (2.0 * nn)
    # Out of reach the root is clipped; the trial's joint check reports such a state.
    rise = np.sqrt(max(rod * rod - (centre[0] ** 2 + centre[1] ** 2 + centre[2] ** 2), 1e-8))
    if n[2] < 0.0:
        rise = -rise
    h = c[0] + centre + rise * n / np.sqrt(nn)
    for k in range(3):
        cos_az, sin_az = np.cos(2.0 * np.pi * k / 3.0), np.sin(2.0 * np.pi * k / 3.0)
        for j in range(3):
            s[k, j] = h[j] - c[k, j]
        lever[k] = proximal * (
            np.cos(phi[k]) * s[k, 2] - np.sin(phi[k]) * (cos_az * s[k, 0] + sin_az * s[k, 1])
        )
    return h


@njit(cache=True, nogil=True)
def _cross(a, b):
    out = np.empty(3)
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out


@njit(cache=True, nogil=True)
def _solve(m, y):
    """Solve the 3x3 system m x = y by Cramer's rule (LAPACK's call costs more than the work)."""
    c0 = _cross(m[1], m[2])
    c1 = _cross(m[2], m[0])
    c2 = _cross(m[0], m[1])
    det = m[0, 0] * c0[0] + m[0, 1] * c0[1] + m[0, 2] * c0[2]
    return (y[0] * c0 + y[1] * c1 + y[2] * c2) / det

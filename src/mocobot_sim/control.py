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

import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import mujoco
import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimator.design import OmnidDesign
from estimator.errors import InputError
from mocobot_sim.as_built import AsBuilt, units_of
from mocobot_sim.team_index import TeamIndex

Array = NDArray[np.float64]

# Also refuses inf, NaN and whole numbers too large for a float.
_LARGEST = sys.float_info.max


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
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value <= _LARGEST:
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
        as_built: sensor zeros of every unit; empty for robots as designed.

    Raises:
        InputError: ``as_built`` does not match the number of robots.
    """

    def __init__(
        self,
        index: TeamIndex,
        design: OmnidDesign,
        gains: ControlGains,
        data: mujoco.MjData,
        as_built: Sequence[AsBuilt] = (),
    ) -> None:
        units = units_of(as_built, index.robots)
        phi_zero = np.array([unit.phi_zero_rad for unit in units])
        self._qpos, self._ctrl = data.qpos, data.ctrl
        self._address = np.stack([index.motor_qpos, index.spring_qpos, index.actuator], axis=1)  # (N, 3, leg)
        self._offset = np.stack([home_phi(design) + phi_zero, [unit.tau_zero_Nm for unit in units]], axis=1)
        self._constants = (
            design.base_radius_m - design.platform_radius_m,
            design.proximal_length_m,
            design.rod_length_m,
            design.sea_stiffness_Nm_per_rad,
            # gravity torque per cos(phi) of a driven link that carries half its rod at the knee [N m]
            design.gravity_mps2
            * (
                design.proximal_mass_kg * design.proximal_com_m
                + 0.5 * design.rod_mass_kg * design.proximal_length_m
            ),
            # weight that hangs at the wrist [N]
            design.gravity_mps2 * (design.wrist_mass_kg + 1.5 * design.rod_mass_kg),
            gains.stiffness_N_per_m,
            gains.damping_Ns_per_m,
            gains.torque_gain,
            gains.torque_rate_gain_s,
            1.0 / gains.rate_hz,
            1.0 / (1.0 + gains.rate_filter_s * gains.rate_hz),
            1.0 / (gains.take_up_time_constant_s * gains.rate_hz),
            gains.motor_torque_limit_Nm,
        )
        self._state = np.zeros((index.robots, 5, 3))  # phi, tau, their filtered rates, F_ff
        self._take_up_ticks = round(gains.take_up_s * gains.rate_hz)
        self._tick = 0

    @property
    def feed_forward(self) -> Array:
        """F_ff of every robot in its {b} [N], shape (N, 3)."""
        return self._state[:, 4].copy()

    def update(self, ref: Array, ref_dot: Array) -> None:
        """One control tick: read ``qpos``, write ``ctrl``.

        Args:
            ref: commanded wrist positions in every robot's {b} [m], shape (N, 3).
            ref_dot: their rates [m/s], shape (N, 3).
        """
        phase = 0 if self._tick == 0 else 1 if self._tick < self._take_up_ticks else 2
        _update(
            self._qpos, self._ctrl, self._address, self._offset, self._constants, self._state,
            ref, ref_dot, phase,
        )  # fmt: skip
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


# The kernel works on tuples of three floats: an array per vector would cost more than the arithmetic.

_COS = (1.0, -0.5, -0.5)
_SIN = (0.0, float(np.sqrt(0.75)), -float(np.sqrt(0.75)))


@njit(cache=True, nogil=True)
def _update(qpos, ctrl, address, offset, constants, state, ref, ref_dot, phase):
    (reach, proximal, rod, stiffness, link_gravity, wrist_weight, impedance, damping,
     torque_gain, rate_gain, period, rate_weight, take_up_weight, limit) = constants  # fmt: skip
    for i in range(address.shape[0]):
        robot = state[i]
        for k in range(3):
            deflection = qpos[address[i, 1, k]]
            phi = qpos[address[i, 0, k]] + deflection + offset[i, 0, k]
            tau = -stiffness * deflection + offset[i, 1, k]
            if phase > 0:
                robot[2, k] += rate_weight * ((phi - robot[0, k]) / period - robot[2, k])
                robot[3, k] += rate_weight * ((tau - robot[1, k]) / period - robot[3, k])
            robot[0, k] = phi
            robot[1, k] = tau
        h, s, lever, cos_phi = wrist(robot[0], reach, proximal, rod)
        # h_dot = S^-1 (lever * phi_dot); f_measured = S^T (tau without the arm's gravity / lever)
        h_dot = _solve(s, (lever[0] * robot[2, 0], lever[1] * robot[2, 1], lever[2] * robot[2, 2]))
        if phase < 2:
            for j in range(3):
                measured = -wrist_weight if j == 2 else 0.0
                for k in range(3):
                    measured += s[k][j] * (robot[1, k] - link_gravity * cos_phi[k]) / lever[k]
                robot[4, j] += (1.0 if phase == 0 else take_up_weight) * (measured - robot[4, j])
        fx = impedance * (ref[i, 0] - h[0]) + damping * (ref_dot[i, 0] - h_dot[0])
        fy = impedance * (ref[i, 1] - h[1]) + damping * (ref_dot[i, 1] - h_dot[1])
        fz = impedance * (ref[i, 2] - h[2]) + damping * (ref_dot[i, 2] - h_dot[2])
        transposed = ((s[0][0], s[1][0], s[2][0]), (s[0][1], s[1][1], s[2][1]), (s[0][2], s[1][2], s[2][2]))
        along_rods = _solve(transposed, (fx + robot[4, 0], fy + robot[4, 1], fz + robot[4, 2] + wrist_weight))
        for k in range(3):
            desired = lever[k] * along_rods[k] + link_gravity * cos_phi[k]
            command = desired + torque_gain * (desired - robot[1, k]) - rate_gain * robot[3, k]
            ctrl[address[i, 2, k]] = min(max(command, -limit), limit)


@njit(cache=True, nogil=True)
def wrist(phi, reach, proximal, rod):
    """Forward kinematics of one Delta.

    c_k is the knee moved inward by the platform radius, so |h - c_k| = rod for every leg, and with
    s_k = h - c_k and lever_k = s_k . dc_k/dphi_k the rates obey S h_dot = lever * phi_dot.

    Args:
        phi: driven angles [rad], shape (3,).
        reach: base radius minus platform radius [m].
        proximal, rod: lengths [m].

    Returns:
        h [m], (s_1, s_2, s_3) [m], lever [m^2/rad], cos(phi): tuples of three.
    """
    cos_phi = (np.cos(phi[0]), np.cos(phi[1]), np.cos(phi[2]))
    sin_phi = (np.sin(phi[0]), np.sin(phi[1]), np.sin(phi[2]))
    c0 = _knee(cos_phi[0], sin_phi[0], 0, reach, proximal)
    c1 = _knee(cos_phi[1], sin_phi[1], 1, reach, proximal)
    c2 = _knee(cos_phi[2], sin_phi[2], 2, reach, proximal)
    # From the circumcentre of the three c_k up along their normal.
    a, b = _minus(c1, c0), _minus(c2, c0)
    n = _cross(a, b)
    nn, aa, bb = _dot(n, n), _dot(a, a), _dot(b, b)
    bn, na = _cross(b, n), _cross(n, a)
    half = 0.5 / nn
    centre = (
        half * (aa * bn[0] + bb * na[0]),
        half * (aa * bn[1] + bb * na[1]),
        half * (aa * bn[2] + bb * na[2]),
    )
    # The normal points up for every phi in range. Out of reach there is no root; the trial's checks report it.
    rise = np.sqrt(max(rod * rod - _dot(centre, centre), 1e-8) / nn)
    h = (
        c0[0] + centre[0] + rise * n[0],
        c0[1] + centre[1] + rise * n[1],
        c0[2] + centre[2] + rise * n[2],
    )
    s = (_minus(h, c0), _minus(h, c1), _minus(h, c2))
    lever = (
        proximal * (cos_phi[0] * s[0][2] - sin_phi[0] * (_COS[0] * s[0][0] + _SIN[0] * s[0][1])),
        proximal * (cos_phi[1] * s[1][2] - sin_phi[1] * (_COS[1] * s[1][0] + _SIN[1] * s[1][1])),
        proximal * (cos_phi[2] * s[2][2] - sin_phi[2] * (_COS[2] * s[2][0] + _SIN[2] * s[2][1])),
    )
    return h, s, lever, cos_phi


@njit(cache=True, nogil=True)
def _knee(cos_phi, sin_phi, leg, reach, proximal):
    radius = reach + proximal * cos_phi
    return (radius * _COS[leg], radius * _SIN[leg], proximal * sin_phi)


@njit(cache=True, nogil=True)
def _minus(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@njit(cache=True, nogil=True)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True)
def _cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@njit(cache=True, nogil=True)
def _solve(m, y):
    """Solve the 3x3 system m x = y by Cramer's rule (LAPACK's call costs more than the work)."""
    c0, c1, c2 = _cross(m[1], m[2]), _cross(m[2], m[0]), _cross(m[0], m[1])
    scale = 1.0 / _dot(m[0], c0)
    return (
        scale * (y[0] * c0[0] + y[1] * c1[0] + y[2] * c2[0]),
        scale * (y[0] * c0[1] + y[1] * c1[1] + y[2] * c2[1]),
        scale * (y[0] * c0[2] + y[1] * c1[2] + y[2] * c2[2]),
    )

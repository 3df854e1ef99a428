"""Arithmetic that runs every control tick, compiled where numba is installed.

numba keeps the machine code for the next process in the folder ``NUMBA_CACHE_DIR`` if that is set, else beside the
source, else, where an installation cannot be written, in the user's cache folder. Where none of them can be written,
every process compiles again.

Without numba (``pip install 'mocobot[fast]'`` brings it) Python itself does the same arithmetic, to the same bits. It
reads arrays through memoryviews: those give plain floats, with which Python is faster than with numpy's. A function
that is compiled here therefore indexes arrays to the last axis (``a[i, k]``, never ``a[i]``).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from math import cos, sin, sqrt
from typing import Any

import numpy as np

try:
    from numba import njit
except ImportError:
    njit = None


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function when it is first called, without Python's lock while it runs; nothing without numba."""
    if njit is None:
        return function
    try:
        return njit(cache=True, nogil=True)(function)
    except RuntimeError:  # no folder can be written
        return njit(nogil=True)(function)


def entry(function: Callable[..., Any]) -> Callable[..., Any]:
    """``compiled``, for what is called with arrays; they are changed in place."""
    if njit is not None:
        return compiled(function)

    def called(*given: Any) -> Any:
        return function(*[one.data if isinstance(one, np.ndarray) else one for one in given])

    return called


# The kernel works on tuples of three floats: an array per vector would cost more than the arithmetic.

_COS = (1.0, -0.5, -0.5)
_SIN = (0.0, sqrt(0.75), -sqrt(0.75))


@entry
def update_team(qpos, ctrl, address, units, constants, state, commands, sensed, tick):
    """One control tick of all robots: what ``TeamController`` says, in place.

    Few arrays, for each costs as much as a tenth of the arithmetic to hand over; all are explained in ``control``.
    Commands and what is sensed have a row for every tick, or one.
    """
    reach, proximal, rod, stiffness = constants[0], constants[1], constants[2], constants[3]
    link_gravity, wrist_weight = constants[4], constants[5]
    impedance, damping, torque_gain, rate_gain = constants[6], constants[7], constants[8], constants[9]
    period, rate_weight, take_up_weight, limit = constants[10], constants[11], constants[12], constants[13]
    home = constants[14]
    first, take_up = tick == 0, tick < constants[15]
    row, kept = tick % commands.shape[0], tick % sensed.shape[0]
    for i in range(address.shape[0]):
        for k in range(3):
            deflection = qpos[address[i, 1, k]]
            phi = qpos[address[i, 0, k]] + deflection + units[i, 0, k]
            read = -stiffness * deflection
            if units[i, 2, 2] > 0.0:
                before = state[i, 5, k]
                state[i, 5, k] = read
                if not first:
                    read = units[i, 2, 0] * state[i, 6, k] + units[i, 2, 1] * before + units[i, 2, 2] * read
                state[i, 6, k] = read
            sensed[kept, i, 0, k] = home + qpos[address[i, 0, k]] + deflection
            sensed[kept, i, 1, k] = qpos[address[i, 3, k]]
            sensed[kept, i, 2, k] = read
            tau = read + units[i, 1, k]
            if not first:
                state[i, 2, k] += rate_weight * ((phi - state[i, 0, k]) / period - state[i, 2, k])
                state[i, 3, k] += rate_weight * ((tau - state[i, 1, k]) / period - state[i, 3, k])
            state[i, 0, k] = phi
            state[i, 1, k] = tau
        h, s, lever, cos_phi = wrist((state[i, 0, 0], state[i, 0, 1], state[i, 0, 2]), reach, proximal, rod)
        # h_dot = S^-1 (lever * phi_dot); f_measured = S^T (tau without the arm's gravity / lever)
        h_dot = _solve(s, (lever[0] * state[i, 2, 0], lever[1] * state[i, 2, 1], lever[2] * state[i, 2, 2]))
        if take_up:
            for j in range(3):
                measured = -wrist_weight if j == 2 else 0.0
                for k in range(3):
                    measured += s[k][j] * (state[i, 1, k] - link_gravity * cos_phi[k]) / lever[k]
                state[i, 4, j] += (1.0 if first else take_up_weight) * (measured - state[i, 4, j])
        fx = impedance * (commands[row, 0, i, 0] - h[0]) + damping * (commands[row, 1, i, 0] - h_dot[0])
        fy = impedance * (commands[row, 0, i, 1] - h[1]) + damping * (commands[row, 1, i, 1] - h_dot[1])
        fz = impedance * (commands[row, 0, i, 2] - h[2]) + damping * (commands[row, 1, i, 2] - h_dot[2])
        transposed = ((s[0][0], s[1][0], s[2][0]), (s[0][1], s[1][1], s[2][1]), (s[0][2], s[1][2], s[2][2]))
        along_rods = _solve(
            transposed, (fx + state[i, 4, 0], fy + state[i, 4, 1], fz + state[i, 4, 2] + wrist_weight)
        )
        for k in range(3):
            desired = lever[k] * along_rods[k] + link_gravity * cos_phi[k]
            command = desired + torque_gain * (desired - state[i, 1, k]) - rate_gain * state[i, 3, k]
            ctrl[address[i, 2, k]] = min(max(command, -limit), limit)


@compiled
def wrist(phi, reach, proximal, rod):
    """Forward kinematics of one Delta from three driven angles [rad].

    c_k is the knee moved inward by the platform radius, so |h - c_k| = rod for every leg, and with
    s_k = h - c_k and lever_k = s_k . dc_k/dphi_k the rates obey S h_dot = lever * phi_dot. ``reach`` is the base radius
    minus the platform radius [m].

    Returns:
        h [m], (s_1, s_2, s_3) [m], lever [m^2/rad], cos(phi): tuples of three.
    """
    cos_phi = (cos(phi[0]), cos(phi[1]), cos(phi[2]))
    sin_phi = (sin(phi[0]), sin(phi[1]), sin(phi[2]))
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
    rise = sqrt(max(rod * rod - _dot(centre, centre), 1e-8) / nn)
    h = (c0[0] + centre[0] + rise * n[0], c0[1] + centre[1] + rise * n[1], c0[2] + centre[2] + rise * n[2])
    s = (_minus(h, c0), _minus(h, c1), _minus(h, c2))
    lever = (
        proximal * (cos_phi[0] * s[0][2] - sin_phi[0] * (_COS[0] * s[0][0] + _SIN[0] * s[0][1])),
        proximal * (cos_phi[1] * s[1][2] - sin_phi[1] * (_COS[1] * s[1][0] + _SIN[1] * s[1][1])),
        proximal * (cos_phi[2] * s[2][2] - sin_phi[2] * (_COS[2] * s[2][0] + _SIN[2] * s[2][1])),
    )
    return h, s, lever, cos_phi


@compiled
def _knee(cos_phi, sin_phi, leg, reach, proximal):
    radius = reach + proximal * cos_phi
    return (radius * _COS[leg], radius * _SIN[leg], proximal * sin_phi)


@compiled
def _minus(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@compiled
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@compiled
def _solve(m, y):
    """Solve the 3x3 system m x = y by Cramer's rule (LAPACK's call costs more than the work)."""
    c0, c1, c2 = _cross(m[1], m[2]), _cross(m[2], m[0]), _cross(m[0], m[1])
    scale = 1.0 / _dot(m[0], c0)
    return (
        scale * (y[0] * c0[0] + y[1] * c1[0] + y[2] * c2[0]),
        scale * (y[0] * c0[1] + y[1] * c1[1] + y[2] * c2[1]),
        scale * (y[0] * c0[2] + y[1] * c1[2] + y[2] * c2[2]),
    )


@entry
def update_drives(
    qpos, qvel, ctrl, wheel_qpos, wheel_dof, drive, matrix, inverse, constants, pose, twist, odometry, angle, lag, speed
):  # fmt: skip
    """One control tick of all bases, in place.

    Addresses have shape (N, 4), the kinematics' matrices (4, 3) and (3, 4). ``constants`` are the position gain [1/s],
    speed gain, integral gain, torque limit and period [s]; ``pose`` and ``twist`` are planned for this tick, (N, 3).
    Brought up to date: ``odometry``, the pose by it, (N, 3); ``angle`` of the wheels at the last tick and ``lag``, by
    how much they lag their commanded angles [rad], (N, 4). Written: ``ctrl`` and the commanded ``speed``, (N, 4).
    """
    position_gain, gain, integral, limit, period = constants
    for i in range(wheel_qpos.shape[0]):
        turn, along, across = 0.0, 0.0, 0.0
        for k in range(4):
            step = qpos[wheel_qpos[i, k]] - angle[i, k]
            angle[i, k] += step
            turn += inverse[0, k] * step
            along += inverse[1, k] * step
            across += inverse[2, k] * step
        # As planar.moved: the chord of the arc.
        half = 0.5 * turn
        chord = math.sin(half) / half if abs(half) > 1e-9 else 1.0
        cos, sin = math.cos(odometry[i, 2] + half), math.sin(odometry[i, 2] + half)
        odometry[i, 0] += chord * (cos * along - sin * across)
        odometry[i, 1] += chord * (sin * along + cos * across)
        odometry[i, 2] += turn

        ahead, aside = pose[i, 0] - odometry[i, 0], pose[i, 1] - odometry[i, 1]
        cos, sin = math.cos(odometry[i, 2]), math.sin(odometry[i, 2])
        rest = pose[i, 2] - odometry[i, 2]
        # The planned twist is in the planned frame, which the base has not quite reached.
        cos_rest, sin_rest = math.cos(rest), math.sin(rest)
        v_x = cos_rest * twist[i, 1] - sin_rest * twist[i, 2] + position_gain * (cos * ahead + sin * aside)
        v_y = sin_rest * twist[i, 1] + cos_rest * twist[i, 2] + position_gain * (cos * aside - sin * ahead)
        w = twist[i, 0] + position_gain * rest
        for k in range(4):
            command = matrix[k, 0] * w + matrix[k, 1] * v_x + matrix[k, 2] * v_y
            error = command - qvel[wheel_dof[i, k]]
            torque = gain * error + integral * lag[i, k]
            # No wind-up: a drive at its limit does not add to what it owes.
            if abs(torque) < limit or torque * error < 0.0:
                lag[i, k] += error * period
            ctrl[drive[i, k]] = min(max(torque, -limit), limit)
            speed[i, k] = command

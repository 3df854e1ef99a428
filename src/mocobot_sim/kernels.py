"""Computations of every control tick, compiled with numba if it is installed.

numba caches the machine code in the folder ``NUMBA_CACHE_DIR`` if set, else beside the source, else in the user's cache
folder. If none of them is writable, every process compiles again.

Without numba (installed by ``pip install 'mocobot[fast]'``), plain Python gives bit-identical results. It reads arrays
through memoryviews, because plain floats are faster than numpy scalars. Functions in this module must therefore index
arrays to the last axis (``a[i, k]``, never ``a[i]``).
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
    """Compile a function at its first call and let it run without the GIL; without numba, return it unchanged."""
    if njit is None:
        return function
    try:
        return njit(cache=True, nogil=True)(function)
    except RuntimeError:  # no cache folder is writable
        return njit(nogil=True)(function)


def entry(function: Callable[..., Any]) -> Callable[..., Any]:
    """Like ``compiled``, for functions called with numpy arrays, which they change in place."""
    if njit is not None:
        return compiled(function)

    def called(*given: Any) -> Any:
        return function(*[one.data if isinstance(one, np.ndarray) else one for one in given])

    return called


# Vectors are tuples of three floats, because creating arrays would take longer than the arithmetic.

_COS = (1.0, -0.5, -0.5)
_SIN = (0.0, sqrt(0.75), -sqrt(0.75))


@entry
def update_team(qpos, ctrl, address, units, constants, state, commands, sensed, tick):
    """Run one control tick of all robots in place; ``TeamController`` documents control law and arrays.

    ``commands`` and ``sensed`` have one row per tick, or a single row. The data are packed into few arrays, because
    passing an array takes about a tenth of the time of the arithmetic.
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
    """Compute the forward kinematics of one Delta robot.

    c_k is the knee of leg k moved inward by the platform radius, so |h - c_k| = rod. With s_k = h - c_k and
    lever_k = s_k . dc_k/dphi_k, the velocities satisfy S h_dot = lever * phi_dot.

    Args:
        phi: driven angles [rad].
        reach: base radius minus platform radius [m].
        proximal, rod: lengths of the proximal links and rods [m].

    Returns:
        Tuples of three: wrist position h [m], (s_1, s_2, s_3) [m], lever [m^2/rad], cos(phi).
    """
    cos_phi = (cos(phi[0]), cos(phi[1]), cos(phi[2]))
    sin_phi = (sin(phi[0]), sin(phi[1]), sin(phi[2]))
    c0 = _knee(cos_phi[0], sin_phi[0], 0, reach, proximal)
    c1 = _knee(cos_phi[1], sin_phi[1], 1, reach, proximal)
    c2 = _knee(cos_phi[2], sin_phi[2], 2, reach, proximal)
    # h lies above the circumcentre of the three c_k, along the normal of their plane.
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
    # The normal points up for every phi in range. Out of reach there is no solution; the checks of a trial report it.
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
    """Solve the 3x3 system m x = y by Cramer's rule, which is faster here than a call of LAPACK."""
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
    """Run one control tick of all bases in place.

    Args:
        qpos, qvel: state of the physics.
        ctrl: written: motor torques [N m].
        wheel_qpos, wheel_dof, drive: addresses of wheels and motors, shape (N, 4).
        matrix, inverse: wheel kinematics that every base assumes, shapes (N, 4, 3) and (N, 3, 4).
        constants: position gain [1/s], speed gain, integral gain, torque limit [N m], control period [s].
        pose, twist: planned for this tick, shape (N, 3).
        odometry: updated: pose by odometry, shape (N, 3).
        angle: updated: wheel angles at the last tick [rad], shape (N, 4).
        lag: updated: integral of the speed error [rad], shape (N, 4).
        speed: written: commanded wheel speeds [rad/s], shape (N, 4).
    """
    position_gain, gain, integral, limit, period = constants
    for i in range(wheel_qpos.shape[0]):
        turn, along, across = 0.0, 0.0, 0.0
        for k in range(4):
            step = qpos[wheel_qpos[i, k]] - angle[i, k]
            angle[i, k] += step
            turn += inverse[i, 0, k] * step
            along += inverse[i, 1, k] * step
            across += inverse[i, 2, k] * step
        # Chord of the arc, as in ``trajectories.moved``.
        half = 0.5 * turn
        chord = math.sin(half) / half if abs(half) > 1e-9 else 1.0
        cos, sin = math.cos(odometry[i, 2] + half), math.sin(odometry[i, 2] + half)
        odometry[i, 0] += chord * (cos * along - sin * across)
        odometry[i, 1] += chord * (sin * along + cos * across)
        odometry[i, 2] += turn

        ahead, aside = pose[i, 0] - odometry[i, 0], pose[i, 1] - odometry[i, 1]
        cos, sin = math.cos(odometry[i, 2]), math.sin(odometry[i, 2])
        rest = pose[i, 2] - odometry[i, 2]
        # Rotate the planned twist from the planned frame into the frame by odometry.
        cos_rest, sin_rest = math.cos(rest), math.sin(rest)
        v_x = cos_rest * twist[i, 1] - sin_rest * twist[i, 2] + position_gain * (cos * ahead + sin * aside)
        v_y = sin_rest * twist[i, 1] + cos_rest * twist[i, 2] + position_gain * (cos * aside - sin * ahead)
        w = twist[i, 0] + position_gain * rest
        for k in range(4):
            command = matrix[i, k, 0] * w + matrix[i, k, 1] * v_x + matrix[i, k, 2] * v_y
            error = command - qvel[wheel_dof[i, k]]
            torque = gain * error + integral * lag[i, k]
            # Anti-windup: at the torque limit the integral must not grow.
            if abs(torque) < limit or torque * error < 0.0:
                lag[i, k] += error * period
            ctrl[drive[i, k]] = min(max(torque, -limit), limit)
            speed[i, k] = command

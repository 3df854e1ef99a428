"""Arithmetic of the drives (see ``drive``), compiled where numba is installed."""

import math

from mocobot_sim.compiled import entry


@entry
def update_drives(
    qpos, qvel, ctrl, wheel_qpos, wheel_dof, drive, matrix, inverse, constants, pose, twist, odometry, angle, lag, speed
):  # fmt: skip
    """One control tick of all bases, in place.

    Args:
        qpos, qvel, ctrl: MuJoCo's.
        wheel_qpos, wheel_dof, drive: addresses, shape (N, 4).
        matrix, inverse: kinematics, shapes (4, 3), (3, 4).
        constants: position gain [1/s], speed gain, integral gain, torque limit, period [s].
        pose, twist: planned ones of this tick, shape (N, 3).
        odometry: pose by odometry, shape (N, 3); brought up to date.
        angle: wheel angles at the last tick, shape (N, 4); brought up to date.
        lag: by how much the wheels lag their commanded angles [rad], shape (N, 4); brought up to date.
        speed: commanded wheel speeds, shape (N, 4); written.
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

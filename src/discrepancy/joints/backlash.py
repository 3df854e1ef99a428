"""Columns of a gear with play between a motor and its link, where a position loop's formula tells the torque.

The link lies against the side of the play to which the transmitted torque pushes it: the motor's position is the
link's plus half the width times the sign of that torque. So a column is what an offset in position does to the torque.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from discrepancy.joints.causes import JointSignals
from discrepancy.joints.signals import Signals, along
from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass

SIDES = LOOP_AT_MOTOR, LOOP_BEHIND, READ_AT_MOTOR = 0.0, 1.0, 2.0
"""Positions are read behind the play, with the loop closed at the motor or there, too, or at the motor."""
WIDTH_RAD, LOAD, LATE_S, PASSED_HZ = 0.01, 0.2, (0.01, 0.025), 10.0
"""Prior width [rad or m]; torque at which the play is passed, over the rms; the time that this takes [s]; and cut-off
of the passage [Hz]. Chosen."""
SHAPES = tuple((("side", side), ("late_s", late)) for side in SIDES for late in LATE_S)


def columns(
    parts: Sequence[Signals], joints: Sequence[JointSignals], j: int, damping: float, rotor: float
) -> Iterator[list[Array]]:
    """Torques per unit of width for each of ``SHAPES``, shape (W, J) for each log.

    Args:
        parts: smoothed logs.
        joints: the joint's signals in each of them.
        j: the joint, from 0.
        damping, rotor: viscous friction and reflected inertia of the motor.
    """
    for (_, side), (_, late) in SHAPES:
        out = []
        for s, own in zip(parts, joints, strict=True):
            size = LOAD * float(np.sqrt(np.mean(own.load**2))) + 1e-12
            way = 0.5 * np.interp(own.t - late, own.t, np.tanh(own.load / size))
            way = low_pass(way, s.rate_hz, min(PASSED_HZ, 0.2 * s.rate_hz))
            if side == READ_AT_MOTOR:
                out.append(-along(s, j, way))
                continue
            rate, torque = differentiate(way, s.rate_hz), np.zeros_like(s.q)
            kp = s.log.drive.position_gain[j] if side == LOOP_AT_MOTOR else 0.0
            kd = np.nan_to_num(s.log.drive.velocity_gain)[j] + damping
            torque[:, j] = kp * way + kd * rate + rotor * differentiate(rate, s.rate_hz)
            out.append(torque)
        yield out

"""Torques that drives without torque readings are asked for: by a command, or by a position loop with known gains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from mocobot_logs.joints.joint_log import JointLog

SMOOTH_HZ, SMOOTH_SHARE = 60.0, 0.2
"""Cut-off of positions before their derivative [Hz], and its upper limit over the rate. Chosen: as in the diagnosis."""


def with_asked_torques(log: JointLog) -> JointLog:
    """Fill in the torques of joints that have neither a torque nor a duty, if their commands tell them.

    A position loop whose gains give torques asks for position_gain (command - position) - velocity_gain velocity,
    within its limit. A drive that is off gives none.
    """
    if log.command is None or log.drive.command not in ("position", "torque"):
        return log
    drive, known = log.drive, np.zeros(len(log.joints), dtype=bool)
    for logged in (log.torque, drive.duty):
        known |= False if logged is None else np.isfinite(logged).any(axis=0)
    asked = log.command if drive.command == "torque" else _by_loop(log)
    asked = np.clip(asked, -_limit(log), _limit(log))
    if log.enabled is not None:
        asked = asked * log.enabled[:, None]
    told = ~known & np.isfinite(asked).any(axis=0)
    if not told.any():
        return log
    torque = np.full(log.q.shape, np.nan) if log.torque is None else log.torque
    names = ", ".join(name for name, is_told in zip(log.joints, told, strict=True) if is_told)
    how = "commanded" if drive.command == "torque" else "asked for by the position loop with the map's gains"
    note = f"Torques of {names} are those {how}; no sensor measured them."
    by_loop = drive.command == "position" and bool(told.all())
    return replace(log, torque=np.where(told, asked, torque), asked=by_loop, notes=(*log.notes, note))


def _by_loop(log: JointLog) -> Array:
    """Torques that the position loops ask for, NaN without a gain, shape (Q, J)."""
    drive = log.drive
    assert log.command is not None
    if drive.gain_of != "torque":
        return np.full(log.q.shape, np.nan)
    smooth = low_pass(log.q, log.rate_hz, min(SMOOTH_HZ, SMOOTH_SHARE * log.rate_hz))
    velocity = differentiate(smooth, log.rate_hz)
    if log.dq is not None:
        velocity = np.where(np.isfinite(log.dq), log.dq, velocity)
    damping = np.nan_to_num(drive.velocity_gain)
    return drive.position_gain * (log.command - log.q) - damping * velocity


def _limit(log: JointLog) -> Array:
    return np.where(np.isnan(log.drive.limit), np.inf, log.drive.limit)

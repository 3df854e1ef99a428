"""Torques that drives without torque readings are asked for: by a command, or by a position loop with known gains."""

from dataclasses import replace

import numpy as np

from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from mocobot_logs.joints.joint_log import JointLog

SMOOTH_HZ, SMOOTH_SHARE = 60.0, 0.2
"""Cut-off of positions before their derivative [Hz], and its upper limit over the rate. Chosen: as in the diagnosis."""
FREE = (
    " The position gains are free, so the torques are those with which the model's masses explain the motion best.",
    " The velocity gains are free, so they count as viscous friction.",
)
"""What is said where position and velocity gains are free."""


def with_asked_torques(log: JointLog) -> JointLog:
    """Fill in the torques of joints that have neither a torque nor a duty, if their commands tell them.

    A position loop whose gains are known and give torques asks for position_gain (command - position) + velocity_gain
    (command_velocity - velocity) + feedforward, within its limit, ``delay_s`` after the command. A drive that is off
    gives none.
    """
    if log.command is None or log.drive.command not in ("position", "torque"):
        return log
    drive, known = log.drive, np.zeros(len(log.joints), dtype=bool)
    for logged in (log.torque, drive.duty):
        known |= False if logged is None else np.isfinite(logged).any(axis=0)
    asked = _late(log, log.command) if drive.command == "torque" else _by_loop(log)
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
    if drive.command == "position":
        free = drive.gain_free[told]
        note += "".join(
            said for said, is_free in zip(FREE, np.any(free, axis=0).tolist(), strict=True) if is_free
        )
        if (rough := drive.gain_within[told][~free].max(initial=1.0)) > 1.0:
            note += f" The gains are known within a factor of {rough:g}, and so are these torques."
    return replace(log, torque=np.where(told, asked, torque), notes=(*log.notes, note), asked=told)


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
    damping = np.nan_to_num(drive.velocity_gain)  # a free one counts as viscous friction
    wanted = 0.0 if drive.command_velocity is None else np.nan_to_num(_late(log, drive.command_velocity))
    added = 0.0 if drive.feedforward is None else np.nan_to_num(_late(log, drive.feedforward))
    return drive.position_gain * (_late(log, log.command) - log.q) + damping * (wanted - velocity) + added


def _late(log: JointLog, told: Array) -> Array:
    """Return what the drives follow at each instant, ``delay_s`` after it was told, shape (Q, J).

    A command that holds is in force for the period after its sample; half a period earlier is the mean around it.
    """
    late_s = np.nan_to_num(log.drive.delay_s) + 0.5 * log.period_s * log.drive.held
    columns = [
        np.interp(log.time - late, log.time, x) if late else x for late, x in zip(late_s, told.T, strict=True)
    ]
    return np.column_stack(columns)


def _limit(log: JointLog) -> Array:
    return np.where(np.isnan(log.drive.limit), np.inf, log.drive.limit)

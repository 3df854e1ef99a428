"""Is a recording what it seems to be? Stuck sensors, coarse ones, a voltage of the wrong sign, saturation."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from discrepancy.emps.recording.axis_log import LIMIT_V, AxisLog
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.filtering import differentiate, low_pass


def checked(log: AxisLog) -> AxisLog:
    """The recording with unusable samples marked, and notes on what was found.

    Raises:
        InputError: nothing moves, too much of it is stuck, or voltage and acceleration contradict each other.
    """
    notes = list(log.notes)
    if np.ptp(log.position) < rules.LEAST_MOTION_M:
        raise InputError(
            f"{log.name}: qm moves by {1e3 * np.ptp(log.position):.3g} mm in all; at least "
            f"{1e3 * rules.LEAST_MOTION_M:g} mm are needed to tell anything"
        )
    usable, position = log.usable.copy(), log.position.copy()
    for start, stop in stuck(log):
        usable[start:stop] = False
        _bridge(position, log.reference, start, stop)
        moved = 1e3 * np.ptp(log.reference[start:stop])
        notes.append(
            f"qm is stuck at {log.position[start]:.6g} m from {log.time[start]:.3f} to {log.time[stop - 1]:.3f} s "
            f"while the reference moves by {moved:.3g} mm; that time is left out."
        )
    if (~usable).mean() > rules.LONGEST_STUCK_SHARE:
        raise InputError(
            f"{log.name}: qm is stuck for {100 * (~usable).mean():.0f} % of the time; nothing can be made of the rest"
        )
    log = replace(log, position=position)
    _check_sign(log, usable)
    step = log.step_m
    if step > rules.COARSE_M:
        notes.append(
            f"qm comes in steps of {1e6 * step:.3g} um, so what moves less, and forces that change quickly, are lost "
            "in rounding."
        )
    if log.saturated.any():
        notes.append(
            f"The drive saturates (+-{LIMIT_V:g} V) in {log.saturated.sum()} of {len(log.time)} samples; rows there "
            "are left out."
        )
    return replace(log, usable=usable, notes=tuple(notes))


def stuck(log: AxisLog) -> list[tuple[int, int]]:
    """Spans of samples with one and the same position, long enough, while the reference moves away."""
    same = np.abs(np.diff(log.position)) <= rules.STUCK_SHARE * np.ptp(log.position)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(int))).reshape(-1, 2)
    return [
        (int(a), int(b) + 1)
        for a, b in edges
        if (b - a) * log.period_s >= rules.STUCK_S and np.ptp(log.reference[a : b + 1]) >= rules.STUCK_WHILE_M
    ]


def _bridge(position: Array, reference: Array, start: int, stop: int) -> None:
    """Replace a stuck reading by one that follows the reference, so that no jump rings in the filters beside it."""
    ends = [max(start - 1, 0), min(stop, len(position) - 1)]
    at = np.arange(start, stop)
    position[at] = reference[at] - np.interp(at, ends, reference[ends] - position[ends])


def _check_sign(log: AxisLog, usable: NDArray[np.bool_]) -> None:
    """Push and acceleration must agree: friction, whatever it is, follows the velocity."""
    smooth = low_pass(log.position, log.rate_hz, min(rules.SIGN_HZ, 0.2 * log.rate_hz))
    velocity = differentiate(smooth, log.rate_hz)
    acceleration = differentiate(velocity, log.rate_hz)
    force = log.gain_N_per_V * low_pass(log.voltage, log.rate_hz, min(rules.SIGN_HZ, 0.2 * log.rate_hz))
    edge = max(8, round(0.1 * log.rate_hz))
    keep = usable.copy()
    keep[:edge] = keep[-edge:] = False
    moving = np.abs(velocity) > 0.05 * np.sqrt(np.mean(velocity**2))
    columns = np.column_stack([acceleration, np.sign(velocity), velocity])[keep & moving]
    mass, coulomb, _ = np.linalg.lstsq(columns, force[keep & moving], rcond=None)[0]
    if mass < 0 and coulomb < 0:
        raise InputError(
            f"{log.name}: vir drives the axis backwards: the data say a mass of {mass:.3g} kg and friction of "
            f"{coulomb:.3g} N, both negative; is its sign wrong, or that of qm?"
        )
    if mass < 0:
        raise InputError(
            f"{log.name}: vir and the acceleration of qm contradict each other: the data say a mass of {mass:.3g} kg; "
            "are they of one recording?"
        )

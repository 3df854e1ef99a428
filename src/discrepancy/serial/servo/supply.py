"""What a drive has of its supply: the mean of what is read, not the instant of a reading."""

from __future__ import annotations

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.recording.joint_log import JointLog
from estimator.arrays import Array
from estimator.filtering import MIN_SAMPLES, low_pass


def supply_of(log: JointLog) -> Array | None:
    """Supply voltage, low-passed, NaN where it is not known [V], shape (Q,); None where the log has none.

    A bus that a drive switches rings, and a reading meets it at any instant of the drive's period: an XL330 at a steady
    duty of 0.7 reads 6.2, 7.3 and 8.2 V in turn, with about the mean of its idle supply. The winding has the mean.
    """
    raw = log.drive.supply_V
    if raw is None:
        return None
    known = np.isfinite(raw)
    if np.count_nonzero(known) < MIN_SAMPLES:
        return raw
    filled = np.interp(log.time, log.time[known], raw[known])
    # A filter goes through the first and the last reading of what it is given: means there are none by chance.
    end = round(log.rate_hz / rules.SUPPLY_HZ)
    wide = np.concatenate([np.full(end, filled[:end].mean()), filled, np.full(end, filled[-end:].mean())])
    return np.where(known, low_pass(wide, log.rate_hz, rules.SUPPLY_HZ)[end : end + len(raw)], np.nan)

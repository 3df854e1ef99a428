"""What motors have of their supply: the mean of what is read, not the instant of a reading."""

import numpy as np

from estimator.arrays import Array
from estimator.filtering import low_pass

SUPPLY_HZ = 1.0
"""Cut-off of a supply's reading. Chosen: batteries and their cables sag in seconds; faster is how a bus rings that is
switched, met by chance (an XL330's reads 5.7 to 9.2 V, with a mean at any duty of 7.0 to 7.4 V)."""


def mean_supply(reading: Array, rate_hz: float) -> Array:
    """A supply's reading, low-passed [V], shape (Q,).

    A bus that a drive switches rings, and a reading meets it at any instant of the drive's period: an XL330 at a steady
    duty of 0.7 reads 6.2, 7.3 and 8.2 V in turn, with about the mean of its idle supply. The winding has the mean.

    Args:
        reading: even samples [V], shape (Q,), at least 16.
        rate_hz: of the samples [Hz].
    """
    # A filter goes through the first and the last reading of what it is given: means there are none by chance.
    end = round(rate_hz / SUPPLY_HZ)
    wide = np.concatenate([np.full(end, reading[:end].mean()), reading, np.full(end, reading[-end:].mean())])
    return low_pass(wide, rate_hz, SUPPLY_HZ)[end : end + len(reading)]

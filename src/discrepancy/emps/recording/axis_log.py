"""What is recorded of the axis."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array
from estimator.quantisation import quantisation_step

LIMIT_V = 10.0
"""The drive saturates there (Janot, Gautier, Brunot)."""
FIRST_GUESS_KG = 100.0
"""Moving mass as assumed; ``models/emps/README.md`` says why."""


@dataclass(frozen=True, eq=False)
class AxisLog:
    """One recording of the axis, sampled evenly.

    Attributes:
        name: for messages.
        time: [s], shape (Q,).
        position: measured [m], shape (Q,).
        reference: commanded position [m], shape (Q,).
        voltage: of the drive [V], shape (Q,); held from one sample to the next.
        gain_N_per_V: of the drive, nominal.
        kp_per_s: of the position loop, nominal.
        kv_Vs_per_m: of the velocity loop, nominal.
        usable: samples that are what they seem, shape (Q,).
        notes: what was found odd, and done about it; sentences.
    """

    name: str
    time: Array
    position: Array
    reference: Array
    voltage: Array
    gain_N_per_V: float
    kp_per_s: float
    kv_Vs_per_m: float
    usable: NDArray[np.bool_]
    notes: tuple[str, ...] = ()

    @property
    def saturated(self) -> NDArray[np.bool_]:
        """Samples at which the drive gives all it has, shape (Q,): its law does not hold there."""
        return np.abs(self.voltage) >= LIMIT_V * (1.0 - 1e-6)

    @property
    def rate_hz(self) -> float:
        """Sampling rate [Hz]."""
        return (len(self.time) - 1) / float(self.time[-1] - self.time[0])

    @property
    def period_s(self) -> float:
        """Sampling period [s]."""
        return 1.0 / self.rate_hz

    @property
    def step_m(self) -> float:
        """Step in which the position is read [m]; 0 where none shows."""
        return quantisation_step(self.position) or 0.0

"""All numbers that the simulated axis and its loop have; effects change them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mocobot_sim.emps.law import AxisLaw

SLACK_S = 1e-6
"""Samples and edges are on a grid: what is a rounding error before an edge is on it."""


@dataclass(frozen=True)
class PulseTrain:
    """Rectangular pulses from ``start_s`` on: on for ``width_s`` every ``period_s``."""

    start_s: float
    period_s: float
    width_s: float
    size: float

    def on(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """1 while a pulse is on, else 0, shape (Q,) like ``time`` [s]."""
        since = time - self.start_s + SLACK_S
        return ((since > 0.0) & (since % self.period_s < self.width_s)).astype(float)


@dataclass(frozen=True)
class ForcePush:
    """A constant force [N] on the carriage for a while."""

    start_s: float
    duration_s: float
    force_N: float


@dataclass(frozen=True)
class Ripple:
    """A force that repeats along the way: cosine and sine parts [N] of 2 pi x / wavelength."""

    wavelength_m: float
    cosine_N: float
    sine_N: float


@dataclass(frozen=True)
class Plant:
    """The axis, its drive and its loop; forces in N oppose or push as their names say.

    Attributes:
        mass_kg: all that moves, seen from the carriage.
        gain_N_per_V: of the drive.
        kp_per_s, kv_Vs_per_m: V = kv (kp (q_ref - q) - dq).
        period_s: of the loop.
        limit_V: saturation of the drive.
        coulomb_N: dry friction in forward and backward motion.
        viscous_Ns_per_m: viscous friction in forward and backward motion.
        stribeck_N, stribeck_mps: further dry friction at low speed, fading with exp(-|v| / stribeck_mps).
        resisting_N: constant force against forward motion, whether it moves or not.
        ripples: forces that depend on the position, resisting forward motion.
        play_m: between motor and carriage.
        delay_s: from voltage to force, beyond the loop's hold.
        velocity_lag_s: age of the velocity that the loop uses.
        voltage_pulses: added to the loop's voltage; size in V.
        force_pulses: resisting forward motion; size in N.
        pushes: outside forces that push forward.
        laws: formulas that nobody has listed: forces against forward motion, and voltages.
    """

    mass_kg: float
    gain_N_per_V: float
    kp_per_s: float
    kv_Vs_per_m: float
    period_s: float
    limit_V: float
    coulomb_N: tuple[float, float] = (0.0, 0.0)
    viscous_Ns_per_m: tuple[float, float] = (0.0, 0.0)
    stribeck_N: float = 0.0
    stribeck_mps: float = 0.01
    resisting_N: float = 0.0
    ripples: tuple[Ripple, ...] = ()
    play_m: float = 0.0
    delay_s: float = 0.0
    velocity_lag_s: float = 0.0
    voltage_pulses: tuple[PulseTrain, ...] = ()
    force_pulses: tuple[PulseTrain, ...] = ()
    pushes: tuple[ForcePush, ...] = ()
    laws: tuple[AxisLaw, ...] = ()

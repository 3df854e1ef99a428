"""From what is there to what a log says: springs, zeros, lags, clocks, noise and steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from estimator.arm.design import OmnidDesign
from independent.as_built import ROBOTS, AsBuilt
from independent.effects.effect import Effect
from independent.numerics import Array, lagged, play
from independent.team import Truth

RATE_HZ = 100.0


@dataclass(frozen=True)
class Sensors:
    """What one set of recordings was read with.

    Attributes:
        phi_step_rad, theta_step_rad: encoders' steps; 0: none.
        jitter_steps: white noise before rounding, in encoder steps.
        torque_noise_Nm: white noise.
        coloured_noise_Nm, colour: of first-order noise at ``RATE_HZ``: standard deviation, and share kept per sample.
        torque_step_Nm: rounding; 0: none.
        offsets: where the channels' grids lie, in steps, shape (3, N, 3): phi, theta, torque.
    """

    phi_step_rad: float = 0.0
    theta_step_rad: float = 0.0
    jitter_steps: float = 0.0
    torque_noise_Nm: float = 0.0
    coloured_noise_Nm: float = 0.0
    colour: float = 0.0
    torque_step_Nm: float = 0.0
    offsets: tuple[float, ...] = (0.0,) * 27


IDEAL = Sensors()


def draw_sensors(rng: np.random.Generator, noise: str) -> Sensors:
    """Encoders of 14 to 18 bits, torques with noise of milli-newton-metres and rounding.

    Args:
        rng: their source.
        noise: ``white``, ``coloured`` (as well), or ``drawn``: coloured in half of the sets.
    """
    bits = rng.integers(14, 19, 2)
    white = rng.uniform(0.005, 0.020)
    amount, often = rng.uniform(0.3, 1.0), rng.random() < 0.5
    coloured = noise == "coloured" or (noise == "drawn" and often)
    return Sensors(
        phi_step_rad=float(2 * np.pi / 2 ** bits[0]),
        theta_step_rad=float(2 * np.pi / 2 ** bits[1]),
        jitter_steps=float(rng.uniform(0, 1)),
        torque_noise_Nm=float(white),
        coloured_noise_Nm=float(white * amount * coloured),
        colour=float(rng.uniform(0.5, 0.95)),
        torque_step_Nm=float(rng.uniform(0.001, 0.010)),
        offsets=tuple(rng.uniform(-0.5, 0.5, 27).tolist()),
    )


def spring_readings(torque: Array, robots: AsBuilt, effects: Sequence[Effect], design: OmnidDesign) -> Array:
    """Design stiffness times the springs' deflection [N m], on the fine grid, shape (Q, N, 3)."""
    carried = play(torque, robots["sea_hysteresis"])
    for effect in effects:
        # Forms of springs: whatever stands beside the spring is taken off before its own law.
        if (found := effect.spring(carried, design.sea_stiffness_Nm_per_rad)) is not None:
            carried[:, found[0], found[1]] = found[2]
    k = design.sea_stiffness_Nm_per_rad * (1 + robots["sea_scale"])
    deflection = carried / k
    for _ in range(8):  # Newton's method on k d + k3 d^3
        cubic = robots["sea_hardening"]
        deflection -= (k * deflection + cubic * deflection**3 - carried) / (k + 3 * cubic * deflection**2)
    return design.sea_stiffness_Nm_per_rad * deflection


def log(
    rng: np.random.Generator,
    truth: Truth,
    robots: AsBuilt,
    effects: Sequence[Effect],
    sensors: Sensors,
    design: OmnidDesign,
    duration_s: float,
) -> tuple[Array, Array, Array, Array]:
    """Times [s] and readings of phi, theta [rad] and torque [N m] at ``RATE_HZ``, shapes (Q,) and (Q, N, 3).

    Args:
        rng: source of the noise.
        truth: the trial.
        robots: how the robots are off.
        effects: what else is hidden.
        sensors: the set's.
        design: the robots' numbers.
        duration_s: of the recording [s].
    """
    torque = spring_readings(truth.torque, robots, effects, design) + robots["sea_bias"]
    for i in range(ROBOTS):
        for joint in range(3):
            lag = float(robots["sensor_lag"][i, joint])
            torque[:, i, joint] = lagged(torque[:, i, joint], lag)
        torque[:, i] = lagged(torque[:, i], float(robots["torque_lag"][i, 0]))
    for effect in effects:
        if (found := effect.sensed(torque)) is not None:
            torque[:, found[0]] = found[1]
    time = np.arange(round(duration_s * RATE_HZ) + 1) / RATE_HZ
    phi, theta, read = (np.empty((len(time), ROBOTS, 3)) for _ in range(3))
    for i in range(ROBOTS):
        late = time - float(robots["clock_delay"][i, 0])
        phi[:, i] = CubicSpline(truth.scene.time, truth.phi[:, i])(late)
        theta[:, i] = CubicSpline(truth.scene.time, truth.theta[:, i])(late)
        read[:, i] = CubicSpline(truth.scene.time, torque[:, i])(late - float(robots["torque_skew"][i, 0]))
    offsets = np.reshape(sensors.offsets, (3, ROBOTS, 3))
    phi = _rounded(rng, phi + robots["phi_zero"], sensors.phi_step_rad, sensors.jitter_steps, offsets[0])
    theta = _rounded(
        rng, theta + robots["theta_zero"], sensors.theta_step_rad, sensors.jitter_steps, offsets[1]
    )
    read += rng.normal(0.0, 1.0, read.shape) * sensors.torque_noise_Nm
    if sensors.coloured_noise_Nm:
        # The first samples are dropped, so that the noise is stationary from the start.
        drive = rng.normal(0.0, 1.0, (200 + len(read), ROBOTS, 3)) * np.sqrt(1 - sensors.colour**2)
        noise = np.asarray(lfilter([1.0], [1.0, -sensors.colour], drive, axis=0))
        read += sensors.coloured_noise_Nm * noise[200:]
    return time, phi, theta, _rounded(rng, read, sensors.torque_step_Nm, 0.0, offsets[2])


def _rounded(rng: np.random.Generator, x: Array, step: float, jitter: float, offset: Array) -> Array:
    if step <= 0:
        return x
    noisy = x / step - offset + rng.normal(0.0, 1.0, x.shape) * jitter
    return (np.round(noisy) + offset) * step

"""What of the torque is noise: as loud as sensors are where nothing moves, as coloured as what all causes leave.

Weights must suit what will be left over (as ``discrepancy.emps.noise`` has it for an axis). So the colour, and how the
joints' rows go together, is that of what the whole catalogue leaves, and the level that of the sensors: the torque's
own, read off above the rows' frequencies, and that of the positions, through the nominal model.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from discrepancy.least_squares.whitening import Whitening
from discrepancy.serial import rules
from discrepancy.serial.mechanics.regressor import rigid_torque, torque_of
from discrepancy.serial.rows.reduction import Reduction, cutoff_hz
from discrepancy.serial.rows.signals import Signals, smoothing_hz, work_step
from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass


def sensor_rows(signals: Signals, reduction: Reduction, rng: np.random.Generator) -> list[Array]:
    """A draw of the sensors' noise in the rows of every block, shape (n, J)."""
    log, rate = signals.log, signals.log.rate_hz
    cutoff = cutoff_hz(rate)
    low, high = (share * cutoff for share in rules.NOISE_BAND)
    torque = np.nan_to_num(log.torque) if log.torque is not None else np.zeros_like(log.q)
    torque_density = _density(torque, rate, low, min(high, rules.TOP_BAND[1] * rate))
    angle_density = _density(log.q, rate, *(share * rate for share in rules.TOP_BAND))
    rounding = log.position_step**2 / 12.0 / (rate / 2.0)  # per hertz, as if it were white
    step, shape = work_step(rate), log.q.shape
    white = np.sqrt(rate / 2.0) * rng.standard_normal((2, *shape))
    noise = low_pass(np.sqrt(torque_density) * white[0], rate, smoothing_hz(rate))[::step]
    dq_noise = low_pass(np.sqrt(np.maximum(angle_density, rounding)) * white[1], rate, smoothing_hz(rate))
    first = differentiate(dq_noise, rate)
    second = differentiate(first, rate)
    moved = torque_of(
        signals.tree,
        signals.q + dq_noise[::step],
        signals.dq + first[::step],
        signals.ddq + second[::step],
    )
    through = moved - rigid_torque(signals.motion) + signals.nominal.armature * second[::step]
    return reduction(noise - through)


def whitening_of(
    left: Sequence[Array], sensors: Sequence[Array], moving: Sequence[Array], freedom: float
) -> tuple[Whitening, NDArray[np.float64]]:
    """Whitening of rows, and the level of the sensors' noise over what the whole catalogue leaves, shape (C,).

    Args:
        left: what the whole catalogue leaves, rows (n, C) per block.
        sensors: a draw of the sensors' noise, the same.
        moving: measured torques, the same.
        freedom: share of the residual's freedom that the catalogue's fit has left, 0 to 1.
    """
    shortest = min(len(rows) for rows in left)
    floor = rules.LEAST_LEVEL * np.sqrt(np.mean(np.concatenate(list(moving)) ** 2, axis=0))
    draws = np.stack([rows[:shortest] for rows in left]) / np.sqrt(freedom)
    spread = np.sqrt(np.mean(draws**2, axis=(0, 1)))
    small = np.maximum(floor - spread, 0.0)  # where a fit leaves nothing, rounding must not decide
    draws = draws + small * np.random.default_rng(rules.NOISE_SEED).standard_normal(draws.shape)
    white = Whitening.of(draws, shortest, rules.AR_ORDER)
    from_sensors = np.concatenate([white(rows)[rules.AR_ORDER :] for rows in sensors])
    level = np.minimum(np.sqrt(np.mean(from_sensors**2, axis=0)), 1.0)
    # Whitened channels are mixtures of joints; what counts as noise in each is brought back through the mixing.
    scaled = white.chol_moving * level
    least = np.maximum(floor / np.maximum(np.linalg.norm(scaled, axis=1), 1e-300), 1.0)
    return Whitening.of(_recoloured(draws, white, level) * least, shortest, rules.AR_ORDER), level


def _recoloured(draws: Array, white: Whitening, level: Array) -> Array:
    """Draws with every whitened channel at another level, shape (D, n, C)."""
    rows = draws.reshape(-1, draws.shape[2])
    back = white.chol_moving @ np.diag(level) @ np.linalg.inv(white.chol_moving)
    return (rows @ back.T).reshape(draws.shape)


def _density(x: Array, rate_hz: float, low: float, high: float) -> Array:
    """Power density of every channel in a band, median over time and frequency, shape (J,) per hertz."""
    size = min(len(x), max(16, round(rules.SEGMENT_S * rate_hz)))
    starts = range(0, len(x) - size + 1, max(1, size // 2))
    each = []
    for start in starts:
        frequency, power = welch(x[start : start + size], rate_hz, nperseg=size, axis=0, detrend="linear")
        each.append(power)
    band = (frequency >= low) & (frequency <= high)
    if not band.any():
        band = frequency >= frequency[-1] / 2.0
    # A periodogram's ordinate scatters as chi-square of two degrees of freedom, whose median is ln 2 of its mean.
    return np.asarray(np.median(np.array(each)[:, band], axis=(0, 1)) / np.log(2.0))

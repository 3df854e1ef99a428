"""Whitening of the rows of all logs, from the logs themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from discrepancy.least_squares.whitening import Whitening
from discrepancy.rules import serial as rules
from discrepancy.serial.candidate import SerialCandidate
from discrepancy.serial.logs import Part
from discrepancy.serial.rows.noise import SensorNoise, draws_of, whitening_of
from discrepancy.serial.rows.remainder import Key, NoiseInTraces, remainder, reversals
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Whitened:
    """What logs say of their noise.

    Attributes:
        whitening: of every block.
        level: sensors' noise over what all causes leave, shape (C,).
        spoilt: cause and place of what noise hides.
        traces: of every cause and block, rows (n, C, k) in N m or N: they take time to make.
    """

    whitening: tuple[Whitening, ...]
    level: Array
    spoilt: frozenset[Key]
    traces: list[list[Array]]


def whiten(
    parts: Sequence[Part], joints: NDArray[np.intp], candidates: Sequence[SerialCandidate]
) -> Whitened:
    """Whitening of every block, and what comes with it.

    Args:
        parts: the logs.
        joints: those with torques, from 0, shape (C,).
        candidates: every lasting cause at every place.
    """
    rng = np.random.default_rng(rules.NOISE_SEED)
    noises = [SensorNoise.of(part.signals, rng) for part in parts]
    angles, sensors = [], []
    for part, noise in zip(parts, noises, strict=True):
        own = [rows[:, joints] for rows in noise.of_angles(part.signals, part.reduction)]
        angles += own
        sensors += [a + b[:, joints] for a, b in zip(own, part.reduction(noise.torque), strict=True)]
    torques = [rows[:, joints] for part in parts for rows in part.reduction(part.signals.torque)]
    draws = draws_of(sensors, torques)
    first = Whitening.of(draws, draws.shape[1], rules.AR_ORDER)
    noisy = every = NoiseInTraces.of(parts, noises, joints, candidates)
    spoilt = noisy.spoilt(candidates, angles, first)
    clear = [k for k, c in enumerate(candidates) if c.key not in spoilt]
    told, noisy = [candidates[k] for k in clear], noisy.only(clear)
    left = remainder(parts, joints, noisy.traces, first)
    # Sensors' noise goes through what the arm is, not through what its model says.
    through = [a - b for a, b in zip(sensors, noisy.of_values(left.values), strict=True)]
    uncertain = reversals(parts, joints, told, left.values)
    draws = draws_of(through, torques)
    whitening, level = whitening_of(left.rows, left.freedom, uncertain, draws, torques)
    return Whitened(whitening, level, spoilt, every.traces)

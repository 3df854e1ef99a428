"""Where the payload rests and where it moves."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.arm.design import OmnidDesign
from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from estimator.signals.holds import DURATION_S, STILL_RATE_RADPS, STILL_SPEED_MPS
from mocobot_inspect.signals import CUTOFF_HZ, RATE_HZ, TRIM_S
from mocobot_logs.log import Level

WINDOW_S = 0.5


@dataclass(frozen=True)
class Segments:
    """Rest and motion.

    Attributes:
        still_s, moving_s: time at rest and in motion [s].
        rests: stretches of rest (first instant, duration) [s], those long enough for a static hold.
    """

    still_s: float
    moving_s: float
    rests: tuple[tuple[float, float], ...]


def segments(level: Level, parts: Sequence[tuple[float, Array]], design: OmnidDesign) -> Segments:
    """Judge windows of half a second by the fastest robot.

    Args:
        level: what the channels are.
        parts: uniform stretches: first instant [s] and samples (q, N, 9) at 100 Hz.
        design: the robots' numbers.
    """
    # The wrist's speed in order of magnitude: of a driven rate at joint level.
    lever = 1.0 if level == "wrist" else design.proximal_length_m
    window, drop = round(WINDOW_S * RATE_HZ), round(TRIM_S * RATE_HZ)
    still_s = moving_s = 0.0
    rests: list[tuple[float, float]] = []
    for start, part in parts:
        rate = differentiate(low_pass(part[..., :6], RATE_HZ, CUTOFF_HZ), RATE_HZ)[drop:-drop]
        count = len(rate) // window
        square = (rate[: count * window] ** 2).reshape(count, window, -1, 2, 3).sum(axis=-1).mean(axis=1)
        speed, turning = np.sqrt(square).max(axis=1).T
        still = (lever * speed < STILL_SPEED_MPS) & (turning < STILL_RATE_RADPS)
        still_s += float(np.sum(still)) * WINDOW_S
        moving_s += float(np.sum(~still)) * WINDOW_S
        edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
        for first, last in edges.reshape(-1, 2):
            if (last - first) * WINDOW_S >= DURATION_S:
                rests.append((start + TRIM_S + first * WINDOW_S, float(last - first) * WINDOW_S))
    return Segments(still_s, moving_s, tuple(rests))

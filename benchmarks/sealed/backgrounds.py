"""Robots as they are: within their tolerances, three and ten times out of them, never calibrated."""

from __future__ import annotations

from math import hypot
from typing import Literal, get_args

import numpy as np

from discrepancy.team.causes import default_tolerances
from hidden.limits import LIMITS
from mocobot.campaign.effects import SPREAD_IN_UNCALIBRATED, cheaper, draw_background
from mocobot_sim.effects import EFFECTS, Effect
from mocobot_sim.scene.as_built import AsBuilt
from mocobot_sim.trial.sensors import sensor_preset

Background = Literal["x1", "x3", "x10", "uncalibrated"]
BACKGROUNDS: tuple[Background, ...] = get_args(Background)
TIMES: dict[Background, float] = {"x1": 1.0, "x3": 3.0, "x10": 10.0}
SIGMAS = 6.2
"""Tolerances at a detection limit, however precise the data: sqrt(38)."""
OVER_NOMINAL: dict[str, tuple[float, float, float, float]] = {
    "tether": (1.24, 1.54, 1.70, 1.52),
    "payload_tether": (1.60, 2.19, 2.74, 2.34),
}
"""Limit over that of ``hidden.limits`` of what has no tolerance and yet looks like what has one: a force that stays is
a torque's zero and a tilt. Measured: medians of eight places on payloads (b) and (c). Masses and
what swings have 0.91 to 1.03 in all backgrounds."""


def units_of(background: Background, robots: int, rng: np.random.Generator) -> tuple[AsBuilt, ...]:
    """The robots; none for robots as designed."""
    if background != "uncalibrated":
        return ()
    return sensor_preset("uncalibrated").spread.draw(robots, rng)


def tolerated(background: Background, robots: int, rng: np.random.Generator) -> list[Effect]:
    """What is a little off everywhere besides; an uncalibrated team's other parts are within their tolerances."""
    effects = cheaper(draw_background(robots, rng, TIMES.get(background, 1.0)))
    if background != "uncalibrated":
        return effects
    return [effect for effect in effects if effect.cause not in SPREAD_IN_UNCALIBRATED]


def limit_over_nominal(cause: str, background: Background) -> float:
    """Detection limit of a listed cause in a background over that within tolerances.

    A limit is six tolerances and what noise adds to them in squares; a wider background has wider tolerances.
    """
    if cause in OVER_NOMINAL:
        return dict(zip(BACKGROUNDS, OVER_NOMINAL[cause], strict=True))[background]
    tolerance, times = default_tolerances().get(cause, {}), TIMES.get(background, 1.0)
    ratios = [
        hypot(times * SIGMAS * value, _by_noise(LIMITS[cause][name], SIGMAS * value)) / LIMITS[cause][name]
        for name, value in tolerance.items()
        if name in LIMITS.get(cause, {}) and cause in EFFECTS and cause != "push"
    ]
    return float(np.median(ratios)) if ratios else 1.0


def _by_noise(limit: float, by_tolerance: float) -> float:
    return float(np.sqrt(max(limit**2 - by_tolerance**2, 0.0)))

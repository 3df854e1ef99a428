"""Backgrounds, and detection limits of forms in each: the size of the parameter that a form calls its ``size``.

Fixed, so that campaigns hide the same. From traces as simulated, medians of two to four places on payloads (b) and (c),
of cables eight; the catalogue's own forms so have 0.83 to 1.15 times what ``hidden.LIMITS`` has, but for tethers
(``OVER_NOMINAL``). Listed ones are at the limit where freeing the right answer from its tolerance is worth 38
(chi-square). What nobody lists needs ten times as much, 400, to be told from a healthy team by a search that does not
know its formula: thirty free numbers at the price of 1.6 ln n each.
"""

from __future__ import annotations

from math import hypot
from typing import Literal, get_args

import numpy as np

from discrepancy.team.causes import default_tolerances
from hidden import LIMITS as IN_TOLERANCE
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
"""Limit over that of ``hidden.LIMITS`` of what has no tolerance and yet looks like what has one: a force that stays is
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
        hypot(times * SIGMAS * value, _by_noise(IN_TOLERANCE[cause][name], SIGMAS * value))
        / IN_TOLERANCE[cause][name]
        for name, value in tolerance.items()
        if name in IN_TOLERANCE.get(cause, {}) and cause in EFFECTS and cause != "push"
    ]
    return float(np.median(ratios)) if ratios else 1.0


def _by_noise(limit: float, by_tolerance: float) -> float:
    return float(np.sqrt(max(limit**2 - by_tolerance**2, 0.0)))


UNLISTED = (400.0 / 38.0) ** 0.5

_LISTED = {
    "driven_lugre": (0.0124, 0.0370, 0.123, 0.0124),
    "driven_dahl": (0.0119, 0.0353, 0.117, 0.0119),
    "gimbal_lugre": (0.0172, 0.0508, 0.172, 0.0172),
    "gimbal_dahl": (0.0178, 0.0442, 0.138, 0.0178),
    "bouc_wen_spring": (0.033, 0.101, 0.341, 0.034),
    "soft_play": (1.87e-5, 5.61e-5, 1.87e-4, 1.87e-5),
    "slow_grasp": (8.2e-7, 2.29e-6, 7.6e-6, 8.1e-7),
    "turning_grasp": (6.8e-7, 1.87e-6, 6.1e-6, 6.8e-7),
    "slow_base_compliance": (8.0e-7, 2.27e-6, 7.6e-6, 8.0e-7),
    "late_creep": (4.0e-7, 1.06e-6, 3.4e-6, 4.0e-7),  # base_creep's, by how much of its way is left
    "ramp_push": (0.17, 0.17, 0.17, 0.17),
    "half_sine_push": (0.25, 0.25, 0.25, 0.25),
    "double_pendulum": (1.84, 1.89, 1.94, 1.97),  # over slosh's, of the upper length
    "unequal_pendulum": (1.86, 1.95, 2.05, 2.01),
    "second_order_torque_lag": (9.0e-4, 2.65e-3, 8.8e-3, 9.0e-4),
    "single_torque_lag": (9.0e-4, 2.65e-3, 8.8e-3, 9.0e-4),  # a robot's
    "payload_cable": (0.97, 1.18, 1.23, 0.98),
    "robot_cable": (0.44, 0.46, 0.53, 0.63),
    "stiffening_strap": (0.125, 0.128, 0.147, 0.147),
    "rubber_cord": (0.25, 0.34, 0.49, 0.27),
    "turning_drag": (0.58, 1.32, 3.36, 0.58),
    "quadratic_drag": (3.0, 7.6, 21.4, 3.0),
    "power_drag": (0.77, 2.03, 6.6, 0.77),
    "torque_backlash": (0.0138, 0.0415, 0.138, 0.0138),
    "mass_drift": (7.0e-5, 7.1e-5, 7.1e-5, 7.0e-5),
    "mass_of_trials": (9.0e-4, 9.2e-4, 9.3e-4, 9.1e-4),
}
_SHARES = {name: (0.01,) * 4 for name in ("dropouts_phi", "dropouts_theta")}
"""Share of an angle's samples. Chosen: less than what is drawn."""
_AT_38 = {
    "cross_talk": (5.5e-4, 5.6e-4, 5.7e-4, 5.6e-4),
    "warming_scale": (1.55e-3, 1.62e-3, 1.66e-3, 1.58e-3),
    "warming_zero": (3.4e-3, 3.5e-3, 3.5e-3, 3.5e-3),
    "saturation": (2.3e-3, 3.5e-3, 4.5e-3, 2.3e-3),
    "quadratic_reading": (3.7e-4, 7.2e-4, 1.3e-3, 4.2e-4),
    "angle_in_torque": (1.56e-3, 1.67e-3, 1.71e-3, 1.63e-3),
    "torque_hum": (1.08e-3, 1.08e-3, 1.08e-3, 1.08e-3),
    "eccentric_phi": (3.6e-4, 6.4e-4, 7.6e-4, 7.8e-4),
    "eccentric_theta": (4.7e-5, 4.7e-5, 4.7e-5, 4.7e-5),
    "cyclic_phi": (4.3e-6, 4.5e-6, 4.5e-6, 4.5e-6),
    "encoder_backlash": (3.0e-6, 3.0e-6, 3.0e-6, 3.0e-6),
    "soft_encoder_mount": (4.1e-6, 4.2e-6, 4.2e-6, 4.1e-6),
    "slipping_zero": (2.5e-7, 2.6e-7, 2.6e-7, 2.5e-7),
    "cogging": (8.7e-4, 8.8e-4, 8.9e-4, 8.8e-4),
    "cubic_spring": (10.1, 10.2, 10.3, 10.3),
    "cable_spring": (0.10, 0.107, 0.112, 0.113),
    "door_closer": (3.0e-3, 3.0e-3, 3.0e-3, 3.0e-3),
    "growing_push": (6.6e-4, 6.7e-4, 6.8e-4, 6.7e-4),
    "shaker": (6.5e-3, 6.5e-3, 6.5e-3, 6.5e-3),
    "gyroscope": (0.0121, 0.0122, 0.0122, 0.0121),
    "shifting_load": (0.022, 0.023, 0.024, 0.023),
    "sinking_base": (5.0e-6, 5.0e-6, 5.0e-6, 5.0e-6),
    "scratched_disc": (1.04e-5, 1.05e-5, 1.06e-5, 1.06e-5),
    "soft_saturation": (8.1e-3, 1.65e-2, 3.50e-2, 8.5e-3),
    "loose_bridge": (1.54e-3, 1.60e-3, 1.63e-3, 1.57e-3),
    "fine_interpolation": (2.23e-6, 2.24e-6, 2.24e-6, 2.24e-6),
    "torque_ramp": (1.15e-4,) * 4,
    "torque_walk": (5.4e-4,) * 4,
    "dead_band": (1.35e-3,) * 4,
    "slack_hose": (5.9, 6.0, 6.2, 6.2),
}
LIMITS: dict[str, dict[Background, float]] = {
    name: dict(zip(BACKGROUNDS, values, strict=True)) for name, values in (_LISTED | _SHARES).items()
} | {
    name: {at: UNLISTED * value for at, value in zip(BACKGROUNDS, values, strict=True)}
    for name, values in _AT_38.items()
}

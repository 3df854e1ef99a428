"""Tolerances: every parameter of every cause that has one, a little off at every place."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import ClassVar

import numpy as np

from discrepancy.team.causes import default_tolerances
from mocobot.campaign.draw import signed
from mocobot_sim.effects import EFFECTS, Effect, make_effect
from mocobot_sim.effects import springs as listed

SPREAD_IN_UNCALIBRATED = ("phi_zero", "theta_zero", "link_length", "sea_scale", "sea_bias")
"""Causes of which an uncalibrated team has so much everywhere that no single one stands out."""


@dataclass(frozen=True)
class GimbalFriction(listed.GimbalFriction):
    """The same with a single row, which lets stiction fade within ten seconds: nine gimbals then cost a third less."""

    rows: ClassVar[int] = 1


def draw_background(
    robots: int,
    rng: np.random.Generator,
    times: float = 1.0,
    tolerances: Mapping[str, Mapping[str, float]] | None = None,
) -> list[Effect]:
    """Every cause with a tolerance at every place, normal, with its standard deviation.

    Args:
        robots: how many.
        rng: what is drawn from.
        times: deviations over the tolerances.
        tolerances: standard deviations by cause and parameter; the defaults if None. What is 0 is exact.

    Magnitudes where a parameter cannot be negative. Pushes are left out: their tolerance stands for friction at rest.
    """
    out = []
    for cause, deviations in (default_tolerances() if tolerances is None else tolerances).items():
        if cause == "push" or not any(deviations.values()):
            continue
        names = EFFECTS[cause].place_names()
        places = product(
            range(1, robots + 1) if "robot" in names else [None], (1, 2, 3) if "joint" in names else [None]
        )
        for robot, joint in places:
            values = {
                name: signed(cause, name, float(times * deviation * rng.standard_normal()))
                for name, deviation in deviations.items()
            }
            out.append(make_effect(cause, values, robot, joint))
    return out


def cheaper(effects: list[Effect]) -> list[Effect]:
    """The same with friction of the gimbals that costs less time."""
    return [
        GimbalFriction(**vars(effect)) if isinstance(effect, listed.GimbalFriction) else effect
        for effect in effects
    ]

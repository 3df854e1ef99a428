"""Tolerances: every parameter of every cause that has one, a little off at every place."""

from __future__ import annotations

from itertools import product

import numpy as np

from discrepancy.team.tolerances import default_tolerances
from hidden.draw import signed
from mocobot_sim.effects import EFFECTS, Effect, make_effect


def draw_background(robots: int, rng: np.random.Generator, times: float = 1.0) -> list[Effect]:
    """Every cause with a tolerance at every place, normal, with its standard deviation.

    Args:
        robots: how many.
        rng: what is drawn from.
        times: deviations over the tolerances.

    Magnitudes where a parameter cannot be negative. Pushes are left out: their tolerance stands for friction at rest.
    """
    out = []
    for cause, deviations in default_tolerances().items():
        if cause == "push":
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

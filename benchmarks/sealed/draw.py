"""Draw effects: which, where, and as large as a multiple of the detection limit of their background."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from discrepancy.team.causes import CAUSES
from hidden.draw import ground_of
from mocobot.campaign.effects import SPREAD_IN_UNCALIBRATED, UNDECIDABLE, draw_effect
from mocobot_sim.effects import EFFECTS, Effect
from sealed.backgrounds import Background, limit_over_nominal
from sealed.forms.base import Form
from sealed.forms.pushes import HalfSinePush, RampPush, in_every_trial
from sealed.ground import Ground
from sealed.limits import LIMITS
from sealed.registry import FAULTS, FORMS, LISTED, OUTSIDE, UNLISTED

SIZES = (2.0, 20.0)
"""Over the limit; drawn evenly in logarithm."""
MOST: dict[str, float] = {
    "phi_zero": 60.0, "theta_zero": 80.0, "link_length": 40.0, "base_tilt": 40.0, "base_creep": 100.0,
    "base_compliance": 40.0, "grasp_flex": 25.0, "grasp_play": 20.0, "sea_bias": 50.0, "sea_scale": 40.0,
    "sea_hardening": 25.0, "sea_hysteresis": 30.0, "joint_friction": 40.0, "gimbal_friction": 25.0,
    "torque_skew": 15.0, "torque_lag": 5.0, "sensor_lag": 5.0, "clock_delay": 40.0,
    "second_order_torque_lag": 5.0, "single_torque_lag": 5.0, "turning_grasp": 15.0, "slow_grasp": 20.0,
    "soft_play": 20.0, "bouc_wen_spring": 12.0, "driven_lugre": 40.0, "driven_dahl": 40.0, "gimbal_lugre": 25.0,
    "gimbal_dahl": 25.0, "slow_base_compliance": 40.0, "late_creep": 100.0, "cubic_spring": 6.0,
    "dropouts_phi": 8.0, "dropouts_theta": 8.0,
}  # fmt: skip
"""Largest size over the limit within tolerances with which a trial runs: a torque loop with 9 ms of lag does not."""


def largest(name: str, background: Background) -> float:
    """Largest size over the limit of the background."""
    return MOST.get(name, np.inf) / over_nominal(name, background)


def over_nominal(name: str, background: Background) -> float:
    """Detection limit of a cause or form in a background over that within tolerances."""
    if name == "pushes":
        return 1.0
    if name in FORMS:
        return LIMITS[name][background] / LIMITS[name]["x1"]
    return limit_over_nominal(name, background)


def possible(names: Sequence[str], background: Background, least: float = SIZES[0]) -> list[str]:
    """Those that can be hidden in a background."""
    hidden = SPREAD_IN_UNCALIBRATED if background == "uncalibrated" else ()
    return [name for name in names if name not in hidden and largest(name, background) >= least]


def family(name: str) -> str:
    """Family of a cause or form; an unlisted one is its own."""
    answer = FORMS[name].answer if name in FORMS else name
    return CAUSES[answer].family if answer in CAUSES else f"unlisted {name}"


def draw(
    name: str, factor: float, background: Background, ground: Ground, rng: np.random.Generator
) -> list[Effect]:
    """One effect of ``factor`` times the limit of its background; ``pushes`` are one in every trial that moves."""
    if name == "pushes":
        kind = RampPush if rng.uniform() < 0.5 else HalfSinePush
        return list(in_every_trial(kind, factor * LIMITS[kind.cause][background], ground, rng))
    if name in EFFECTS:
        factor *= limit_over_nominal(name, background)
        return [draw_effect(name, factor, ground_of(ground.robots, ground.p_1c, ground.moving), rng)]
    form = FORMS[name]
    return [form.drawn(factor * LIMITS[name][background], ground, _place(form, ground, rng), rng)]


def _place(form: type[Form], ground: Ground, rng: np.random.Generator) -> dict[str, int]:
    names = form.place_names()
    joints = [joint for joint in (1, 2, 3) if (form.answer, joint) not in UNDECIDABLE]
    place = {"robot": int(rng.integers(1, ground.robots + 1))} if "robot" in names else {}
    return place | ({"joint": int(rng.choice(joints))} if "joint" in names else {})


CATALOGUE = tuple(name for name in CAUSES if name in EFFECTS)
OTHER = tuple(form.cause for form in LISTED)
NOWHERE = tuple(form.cause for form in UNLISTED)
BEYOND = tuple(form.cause for form in OUTSIDE)
WORN = tuple(form.cause for form in FAULTS)

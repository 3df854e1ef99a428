"""Draw one effect of a cause: in which direction, and as large as a multiple of its detection limit."""

from collections.abc import Mapping

import numpy as np

from discrepancy.team.causes.payload import MASS_OVER_S
from estimator.arrays import Array
from mocobot.campaign.ground import Ground
from mocobot_sim.effects import EFFECTS, Effect, make_effect
from mocobot_sim.scene.models import omnid_design

UNDECIDABLE = {("theta_zero", 3)}
"""Cause and joint that no recording can show: nothing is hidden there."""
REACH_M = 0.2
"""Pushes act and pendulums hang this near to the centre of mass."""
TETHER_STIFFNESS = 0.5
"""Share of a tether's size that is its stiffness; the rest is its force at home."""
PUSH_S = (0.5, 2.0)
"""How long a push lasts."""
DAMPING_RATIO = 0.05
"""Of a pendulum."""


def draw_effect(cause: str, factor: float, ground: Ground, rng: np.random.Generator) -> Effect:
    """One effect of ``factor`` times the detection limit, at a random place."""
    names = EFFECTS[cause].place_names()
    joints = [joint for joint in (1, 2, 3) if (cause, joint) not in UNDECIDABLE]
    robot = int(rng.integers(1, ground.robots + 1)) if "robot" in names else None
    joint = int(rng.choice(joints)) if "joint" in names else None
    return draw_at(cause, factor, robot, joint, ground, rng)


def draw_at(
    cause: str, factor: float, robot: int | None, joint: int | None, ground: Ground, rng: np.random.Generator
) -> Effect:
    """One effect of ``factor`` times the detection limit, at a given place.

    Raises:
        InputError: no such effect is so large.
    """
    if cause == "push":
        parameters = _push(factor, ground, rng)
    elif cause == "slosh":
        parameters = _slosh(factor, ground, rng)
    elif cause == "payload_mass":  # a drift: another mass in some trials needs several
        rate = factor * ground.limits.at(cause)["mass_kg"] / MASS_OVER_S * rng.choice([-1.0, 1.0])
        parameters = {"rate_kgps": float(rate)} | _vector("point", "m", _near(ground.p_1c, rng))
    elif cause == "tether":
        parameters = _tether(factor, ground.limits.at(cause, robot), np.zeros(3), rng)
    elif cause == "payload_tether":
        point = _near(ground.p_1c, rng)
        parameters = _tether(factor, ground.limits.at(cause), point, rng) | _vector("point", "m", point)
    else:
        parameters = _sized(cause, factor, ground.limits.at(cause, robot, joint), rng)
    return make_effect(cause, parameters, robot, joint)


def signed(cause: str, name: str, value: float) -> float:
    """The value, or its magnitude where the parameter cannot be negative."""
    low = EFFECTS[cause].ranges.get(name, (-np.inf, np.inf))[0]
    return abs(value) if low >= 0 else value


def _sized(
    cause: str, factor: float, limits: Mapping[str, float], rng: np.random.Generator
) -> dict[str, float]:
    direction = _direction(rng, len(limits))
    if cause == "link_length":  # one of the lengths
        direction = np.eye(len(limits))[rng.integers(len(limits))] * rng.choice([-1.0, 1.0])
    return {
        name: signed(cause, name, float(factor * limit * d))
        for (name, limit), d in zip(limits.items(), direction, strict=True)
    }


def _push(factor: float, ground: Ground, rng: np.random.Generator) -> dict[str, float]:
    number, begin, end = ground.moving[int(rng.integers(len(ground.moving)))]
    duration = rng.uniform(*PUSH_S)
    limits = ground.limits.at("push", trial=number)
    force = factor * _components("force", "N", limits) * _direction(rng, 3)
    return {"trial": number, "start_s": rng.uniform(begin, end - duration), "duration_s": duration} | (
        _vector("force", "N", force) | _vector("point", "m", _near(ground.p_1c, rng))
    )


def _slosh(factor: float, ground: Ground, rng: np.random.Generator) -> dict[str, float]:
    length_m, limit_kg = ground.limits.pendulum(rng)
    shape = {"length_m": length_m, "damping_ratio": DAMPING_RATIO}
    mass = {"mass_kg": factor * limit_kg}
    return mass | shape | _vector("point", "m", _near(ground.p_1c, rng))


def _tether(
    factor: float, limits: Mapping[str, float], point: Array, rng: np.random.Generator
) -> dict[str, float]:
    """From a point, in the axes of {b} from where {i} is at home."""
    stiffness = factor * TETHER_STIFFNESS * limits["stiffness_N_per_m"]
    force = (
        factor * np.sqrt(1.0 - TETHER_STIFFNESS**2) * _components("force", "N", limits) * _direction(rng, 3)
    )
    anchor = force / stiffness + point + [0.0, 0.0, omnid_design().home_height_m]
    return {"stiffness_N_per_m": float(stiffness)} | _vector("anchor", "m", anchor)


def _direction(rng: np.random.Generator, size: int) -> Array:
    draw = rng.standard_normal(size)
    return draw / np.linalg.norm(draw)


def _near(point: Array, rng: np.random.Generator) -> Array:
    return point + REACH_M * np.cbrt(rng.uniform()) * _direction(rng, 3)


def _components(name: str, unit: str, limits: Mapping[str, float]) -> Array:
    return np.array([limits[f"{name}_{axis}_{unit}"] for axis in "xyz"])


def _vector(name: str, unit: str, values: Array) -> dict[str, float]:
    return {f"{name}_{axis}_{unit}": float(value) for axis, value in zip("xyz", values, strict=True)}

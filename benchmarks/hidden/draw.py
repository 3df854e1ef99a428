"""Draw one effect of a cause: where, in which direction, and as large as a multiple of its detection limit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hidden.limits import LIMITS, pendulum_limit_kg
from hidden.of_log import Place
from hidden.schedule import moving_intervals
from mocobot_sim.effects import EFFECTS, Effect, make_effect
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.trial.trajectories import Trajectory
from mocobot_sim.trial.truth import GroundTruth

Array = NDArray[np.float64]

UNDECIDABLE = {("theta_zero", 3)}
"""Cause and joint that no recording can show: nothing is hidden there."""
REACH_M = 0.2
"""Pushes act and pendulums hang this near to the centre of mass."""
TETHER_STIFFNESS = 0.5
"""Share of a tether's size that is its stiffness; the rest is its force at home."""


@dataclass(frozen=True)
class Ground:
    """What a draw needs to know of the team.

    Attributes:
        robots: number of robots.
        p_1c: centre of mass in {1} [m], shape (3,).
        moving: trial number, begin and end of motion [s].
        limits: detection limits over those of ``hidden.limits``, by place; one where it is not there.
    """

    robots: int
    p_1c: Array
    moving: list[tuple[int, float, float]]
    limits: Mapping[Place, float] = field(default_factory=dict)

    @classmethod
    def of(cls, scene: TeamScene, trajectories: list[Trajectory]) -> Ground:
        """Of a team without effects."""
        return cls(scene.robots, GroundTruth.of(scene).p_1c, moving_intervals(trajectories))


def draw_effect(cause: str, factor: float, ground: Ground, rng: np.random.Generator) -> Effect:
    """One effect of ``factor`` times the detection limit, at a random place."""
    names = EFFECTS[cause].place_names()
    joints = [joint for joint in (1, 2, 3) if (cause, joint) not in UNDECIDABLE]
    robot = int(rng.integers(1, ground.robots + 1)) if "robot" in names else None
    joint = int(rng.choice(joints)) if "joint" in names else None
    factor *= ground.limits.get((cause, robot, joint, None), 1.0)
    if cause == "push":
        parameters = _push(factor, ground, rng)
    elif cause == "slosh":
        parameters = _slosh(factor, ground, rng)
    elif cause == "tether":
        parameters = _tether(factor, np.zeros(3), rng)
    elif cause == "payload_tether":
        point = _near(ground.p_1c, rng)
        parameters = _tether(factor, point, rng) | _vector("point", "m", point)
    else:
        parameters = _sized(cause, factor, rng)
    return make_effect(cause, parameters, robot, joint)


def signed(cause: str, name: str, value: float) -> float:
    """The value, or its magnitude where the parameter cannot be negative."""
    low = EFFECTS[cause].ranges.get(name, (-np.inf, np.inf))[0]
    return abs(value) if low >= 0 else value


def _sized(cause: str, factor: float, rng: np.random.Generator) -> dict[str, float]:
    limits = LIMITS[cause]
    direction = _direction(rng, len(limits))
    if cause == "link_length":  # one of the lengths
        direction = np.eye(len(limits))[rng.integers(len(limits))] * rng.choice([-1.0, 1.0])
    return {
        name: signed(cause, name, float(factor * limit * d))
        for (name, limit), d in zip(limits.items(), direction, strict=True)
    }


def _push(factor: float, ground: Ground, rng: np.random.Generator) -> dict[str, float]:
    number, begin, end = ground.moving[rng.integers(len(ground.moving))]
    duration = rng.uniform(0.5, 2.0)
    factor *= ground.limits.get(("push", None, None, number), 1.0)
    force = factor * np.array(list(LIMITS["push"].values())) * _direction(rng, 3)
    return {"trial": number, "start_s": rng.uniform(begin, end - duration), "duration_s": duration} | (
        _vector("force", "N", force) | _vector("point", "m", _near(ground.p_1c, rng))
    )


def _slosh(factor: float, ground: Ground, rng: np.random.Generator) -> dict[str, float]:
    shape = {"length_m": rng.uniform(0.08, 0.5), "damping_ratio": 0.05}
    mass = {"mass_kg": factor * pendulum_limit_kg(shape["length_m"])}
    return mass | shape | _vector("point", "m", _near(ground.p_1c, rng))


def _tether(factor: float, point: Array, rng: np.random.Generator) -> dict[str, float]:
    """From a point, in the axes of {b} from where {i} is at home."""
    limits = np.array(list(LIMITS["tether"].values()))
    stiffness = factor * TETHER_STIFFNESS * limits[3]
    force = factor * np.sqrt(1.0 - TETHER_STIFFNESS**2) * limits[:3] * _direction(rng, 3)
    anchor = force / stiffness + point + [0.0, 0.0, omnid_design().home_height_m]
    return {"stiffness_N_per_m": float(stiffness)} | _vector("anchor", "m", anchor)


def _direction(rng: np.random.Generator, size: int) -> Array:
    draw = rng.standard_normal(size)
    return draw / np.linalg.norm(draw)


def _near(point: Array, rng: np.random.Generator) -> Array:
    return point + REACH_M * np.cbrt(rng.uniform()) * _direction(rng, 3)


def _vector(name: str, unit: str, values: Array) -> dict[str, float]:
    return {f"{name}_{axis}_{unit}": float(value) for axis, value in zip("xyz", values, strict=True)}

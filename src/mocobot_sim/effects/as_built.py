"""Change one robot's as-built unit, and the simulated robot with it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mocobot_sim.scene.as_built import AsBuilt
from mocobot_sim.scene.design import omnid_design

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


def add_to_unit(scene: TeamScene, robot: int, joint: int, **additions: float) -> TeamScene:
    """Add to attributes of ``AsBuilt`` on top of what the unit has, for one leg or gimbal axis (1-based).

    Only the record changes: sensors and controllers follow it; the MJCF does not.
    """
    unit = scene.units[robot - 1]
    changed: dict[str, np.ndarray] = {}
    for name, addition in additions.items():
        values = np.array(getattr(unit, name), dtype=float)
        values[joint - 1] += addition
        changed[name] = values
    units: list[AsBuilt] = list(scene.units)
    units[robot - 1] = replace(unit, **changed)
    return replace(scene, units=tuple(units))


def set_linear_stiffness(scene: TeamScene, robot: int, joint: int, stiffness_Nm_per_rad: float) -> None:
    """Set the linear part of one spring, leaving a cubic part as it is."""
    spring = scene.root.find("joint", f"omnid{robot}/spring{joint}")
    old = spring.stiffness
    rest = [] if old is None else list(np.atleast_1d(old)[1:])
    spring.stiffness = [stiffness_Nm_per_rad, *rest]


def linear_stiffness(scene: TeamScene, robot: int, joint: int) -> float:
    """Linear part of one spring as built [N m/rad]."""
    unit = scene.units[robot - 1]
    return float(omnid_design().sea_stiffness_Nm_per_rad * (1.0 + unit.stiffness_ratio[joint - 1]))

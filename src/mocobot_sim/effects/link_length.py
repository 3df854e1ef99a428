"""Links and base radius of another length than designed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from mocobot_sim.effects.as_built import add_to_unit
from mocobot_sim.effects.base import Effect
from mocobot_sim.scene.as_built import AsBuilt, deviate_geometry

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class LinkLength(Effect):
    """One leg's proximal length, rod length and base radius, true minus design [m]: body and site positions."""

    ranges: ClassVar = {name: (-0.05, 0.05) for name in ("proximal_m", "rod_m", "base_radius_m")}
    robot: int
    joint: int
    proximal_m: float = 0.0
    rod_m: float = 0.0
    base_radius_m: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        at = np.arange(3) == self.joint - 1
        change = AsBuilt(
            proximal_length_m=self.proximal_m * at,
            rod_length_m=self.rod_m * at,
            base_radius_m=self.base_radius_m * at,
        )
        deviate_geometry(scene.root.find("body", f"omnid{self.robot}/chassis").root, change)
        return add_to_unit(
            scene, self.robot, self.joint, proximal_length_m=self.proximal_m, rod_length_m=self.rod_m,
            base_radius_m=self.base_radius_m,
        )  # fmt: skip

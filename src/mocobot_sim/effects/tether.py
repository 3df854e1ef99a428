"""Something elastic that ties a grasp to the room."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.spring import SPRING_RANGES, tie

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class Tether(Effect):
    """A spring from the payload's grasp at one robot to a fixed point; a cable, if it has a length.

    A spatial tendon with ``stiffness`` between the payload's site ``grasp{i}`` and a site of the world, slack below
    ``length_m`` and pulling with k d + ``stiffening_N_per_m2`` d^2 if stretched by d beyond it; at a length of zero a
    spring pulls back on all axes alike. The anchor is given in the robot's {b} as its floor mount has it, without any
    tilt [m].
    """

    on_payload = True
    ranges: ClassVar = SPRING_RANGES
    robot: int
    stiffness_N_per_m: float
    anchor_x_m: float
    anchor_y_m: float
    anchor_z_m: float
    length_m: float = 0.0
    stiffening_N_per_m2: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        if not (self.stiffness_N_per_m or self.stiffening_N_per_m2):
            return scene
        at = scene.X_Wb[self.robot - 1].apply([self.anchor_x_m, self.anchor_y_m, self.anchor_z_m])
        grasp = scene.root.find("site", f"omnid1/payload/grasp{self.robot}")
        strength = self.stiffness_N_per_m, self.length_m, self.stiffening_N_per_m2
        tie(scene, f"tether{self.robot}", grasp, at, *strength)
        return scene

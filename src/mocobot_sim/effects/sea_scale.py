"""Spring of another stiffness than designed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from mocobot_sim.effects.as_built import add_to_unit, linear_stiffness, set_linear_stiffness
from mocobot_sim.effects.base import Effect

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class SeaScale(Effect):
    """True stiffness is greater than built so far by ``scale`` times the design: the spring joint's ``stiffness``.

    The reading is the design stiffness times the deflection, so it is low by 1 / (1 + scale).
    """

    ranges: ClassVar = {"scale": (-0.9, 10.0)}
    robot: int
    joint: int
    scale: float

    def _edit(self, scene: TeamScene) -> TeamScene:
        scene = add_to_unit(scene, self.robot, self.joint, stiffness_ratio=self.scale)
        set_linear_stiffness(scene, self.robot, self.joint, linear_stiffness(scene, self.robot, self.joint))
        return scene

"""A spring that hardens."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from mocobot_sim.effects.as_built import linear_stiffness
from mocobot_sim.effects.base import Effect

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class SeaHardening(Effect):
    """Spring torque -(k d + k3 d^3) at a deflection d: polynomial ``stiffness`` of the spring joint, k3 [N m/rad^3].

    The reading is the design stiffness times the deflection, as of any spring.
    """

    ranges: ClassVar = {"cubic_Nm_per_rad3": (-500.0, 1e6)}
    robot: int
    joint: int
    cubic_Nm_per_rad3: float

    def _edit(self, scene: TeamScene) -> TeamScene:
        stiffness = linear_stiffness(scene, self.robot, self.joint)
        spring = scene.root.find("joint", f"omnid{self.robot}/spring{self.joint}")
        spring.stiffness = [stiffness, 0.0, self.cubic_Nm_per_rad3]
        return scene

"""Torque zero of a series-elastic actuator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mocobot_sim.effects.as_built import add_to_unit
from mocobot_sim.effects.base import Effect

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class SeaBias(Effect):
    """One torque reading, for log and controller, is ``bias_Nm`` above the truth [N m]; no MJCF edit."""

    robot: int
    joint: int
    bias_Nm: float

    def _edit(self, scene: TeamScene) -> TeamScene:
        return add_to_unit(scene, self.robot, self.joint, tau_zero_Nm=self.bias_Nm)

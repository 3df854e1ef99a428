"""Encoder zero of a gimbal joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mocobot_sim.effects.as_built import add_to_unit
from mocobot_sim.effects.base import Effect

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class ThetaZero(Effect):
    """One gimbal encoder (joints 1, 2, 3 are z, y, x) reads ``zero_rad`` more than the truth [rad]; no MJCF edit."""

    robot: int
    joint: int
    zero_rad: float

    def _edit(self, scene: TeamScene) -> TeamScene:
        return add_to_unit(scene, self.robot, self.joint, theta_zero_rad=self.zero_rad)

"""Encoder zero of a driven joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mocobot_sim.effects.as_built import add_to_unit
from mocobot_sim.effects.base import Effect

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class PhiZero(Effect):
    """One phi encoder, for log and controller, reads ``zero_rad`` more than the truth [rad]; no MJCF edit."""

    robot: int
    joint: int
    zero_rad: float

    def _edit(self, scene: TeamScene) -> TeamScene:
        return add_to_unit(scene, self.robot, self.joint, phi_zero_rad=self.zero_rad)

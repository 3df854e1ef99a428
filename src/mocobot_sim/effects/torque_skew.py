"""The log of one robot's torques is late."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

from mocobot_sim.effects.base import Effect

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class TorqueSkew(Effect):
    """All torques that one robot logs are ``delay_s`` older than the angles beside them [s]; may be negative.

    An entry of the scene's ``sensors``; no MJCF edit.
    """

    ranges: ClassVar = {"delay_s": (-1.0, 1.0)}
    robot: int
    delay_s: float

    def _edit(self, scene: TeamScene) -> TeamScene:
        sensors = scene.sensors.added("torque_delay_s", self.robot, self.delay_s, scene.robots)
        return replace(scene, sensors=sensors)

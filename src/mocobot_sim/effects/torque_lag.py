"""A torque sensor that follows late."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

from mocobot_sim.effects.base import Effect

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class TorqueLag(Effect):
    """A first-order lag of ``time_constant_s`` in one robot's torque sensors, seen by log and controller [s].

    An entry of the scene's ``sensors``; no MJCF edit.
    """

    ranges: ClassVar = {"time_constant_s": (0.0, 10.0)}
    robot: int
    time_constant_s: float

    def _edit(self, scene: TeamScene) -> TeamScene:
        sensors = scene.sensors.added("torque_lag_s", self.robot, self.time_constant_s, scene.robots)
        return replace(scene, sensors=sensors)

"""A single torque sensor that follows late."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from estimator.arrays import Array
from mocobot_sim.control.control import lag_filter
from mocobot_sim.effects.base import Effect
from mocobot_sim.trial.actors import Actor, Reader
from mocobot_sim.trial.readings import Misreading, RobotReadings

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class SensorLag(Effect):
    """A first-order lag of ``time_constant_s`` in one torque sensor, seen by log and controller [s].

    A reader of the trial; no MJCF edit.
    """

    ranges: ClassVar = {"time_constant_s": (0.0, 10.0)}
    robot: int
    joint: int
    time_constant_s: float

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        """Nobody."""
        return ()

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """The sensor, at rest when the trial begins."""
        if not self.time_constant_s:
            return ()
        weights: list[float] = []
        last: list[float] = []

        def ready(dt: float) -> None:
            weights[:] = lag_filter(self.time_constant_s, dt)

        def change(readings: RobotReadings, seen: Array, time: float) -> None:
            x = readings.tau(seen, self.joint)
            a, of_old, of_new = weights
            y = a * last[0] + of_old * last[1] + of_new * x if last else x
            last[:] = (y, x)
            readings.set_tau(seen, self.joint, y)

        return (Misreading(self.robot, change, ready),)

    def _edit(self, scene: TeamScene) -> TeamScene:
        return scene

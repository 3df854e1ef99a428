"""Sensors that misread: an error that follows from what is read now, or from what has been."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from mocobot_sim.trial.actors import Misreading, Reader, RobotReadings
from sealed.forms.base import Form
from sealed.laws.hysteresis import Play

Error = Callable[[RobotReadings, np.ndarray, float, float], float]
"""Reading minus truth [rad or N m]: of all readings of the robot, what is seen, the true value and the time [s]."""


@dataclass(frozen=True)
class Misread(Form):
    """One reading of one joint is off."""

    channel: ClassVar[Literal["phi", "theta", "tau"]]
    robot: int
    joint: int

    @abstractmethod
    def error_of_trial(self) -> Error:
        """What the reading is off by in a trial; it may remember."""

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        error = self.error_of_trial()

        def change(readings: RobotReadings, seen: np.ndarray, time: float) -> None:
            if self.channel == "tau":
                tau = readings.tau(seen, self.joint)
                readings.set_tau(seen, self.joint, tau + error(readings, seen, tau, time))
                return
            phi = self.channel == "phi"
            angle = (readings.phi if phi else readings.theta)(seen, self.joint)
            add = readings.add_phi if phi else readings.add_theta
            add(seen, self.joint, error(readings, seen, angle, time))

        return [Misreading(self.robot, change)]

    def _law(self, variables: list[str], formula: str, unit: str) -> dict[str, Any]:
        return self.told(f"{self.channel} reading", variables, formula, unit)


@dataclass(frozen=True)
class MisreadNow(Misread):
    """Off by a function of this instant."""

    @abstractmethod
    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        """Reading minus truth [rad or N m]."""

    def error_of_trial(self) -> Error:
        return self.error


@dataclass(frozen=True)
class Gap(Misread):
    """It follows only once the truth has crossed a gap, ``size`` being half of its width."""

    def law(self) -> dict[str, Any] | None:
        unit = "N m" if self.channel == "tau" else "rad"
        return self._law([f"own {self.channel}, its history"], "play of half width a", unit)

    def error_of_trial(self) -> Error:
        play = Play(getattr(self, self.size))
        return lambda readings, seen, value, time: play.step(value) - value

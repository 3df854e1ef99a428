"""Torque sensors that follow late in another form, or one alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mocobot_sim.trial.actors import Misreading, Reader, RobotReadings
from sealed.forms.base import Form, Place
from sealed.ground import Ground
from sealed.laws.lag import SecondOrderLag


def _late(robot: int, joints: Sequence[int], time_s: float, damping_ratio: float) -> Misreading:
    """Sensors of some joints behind a lag of second order that is late by a time [s]."""
    laws: dict[int, SecondOrderLag] = {}

    def ready(dt: float) -> None:
        frequency = damping_ratio / (np.pi * time_s)
        laws.update({joint: SecondOrderLag(frequency, damping_ratio, dt) for joint in joints})

    def change(readings: RobotReadings, seen: np.ndarray, time: float) -> None:
        for joint, law in laws.items():
            readings.set_tau(seen, joint, law.step(readings.tau(seen, joint)))

    return Misreading(robot, change, ready)


@dataclass(frozen=True)
class SecondOrderTorqueLag(Form):
    """All torque sensors of a robot: second order, late by ``time_constant_s``."""

    answer = "torque_lag"
    size, size_is_known = "time_constant_s", True
    ranges: ClassVar = {"time_constant_s": (1e-5, 1.0), "damping_ratio": (0.1, 5.0)}
    robot: int
    time_constant_s: float
    damping_ratio: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"damping_ratio": float(rng.uniform(0.6, 1.2))}

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        return [_late(self.robot, (1, 2, 3), self.time_constant_s, self.damping_ratio)]


@dataclass(frozen=True)
class SingleTorqueLag(Form):
    """One torque sensor alone: first order (no damping ratio is then of use) or second."""

    answer = "sensor_lag"
    size, size_is_known = "time_constant_s", True
    ranges: ClassVar = {"time_constant_s": (1e-5, 1.0), "damping_ratio": (0.1, 50.0)}
    robot: int
    joint: int
    time_constant_s: float
    damping_ratio: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        # A damping ratio of 5 is a lag of first order but for a hundredth.
        return {"damping_ratio": float(rng.choice([5.0, rng.uniform(0.6, 1.2)]))}

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        return [_late(self.robot, (self.joint,), self.time_constant_s, self.damping_ratio)]

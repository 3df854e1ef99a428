"""A base that begins to creep in mid-trial."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mocobot_sim.effects.base import precise
from mocobot_sim.effects.geometry import ARMATURE_KG, DAMPING_NS_PER_M, TOLERANCE, base_slides
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.trial.actors import Actor, Stage
from sealed.forms.base import Form, Place
from sealed.ground import Ground


@dataclass(frozen=True)
class LateCreep(Form):
    """Still until ``start_s`` of every trial, then at a constant velocity in a direction of {b}."""

    answer = "base_creep"
    size = "speed_mps"
    ranges: ClassVar = {"speed_mps": (0.0, 1e-2), "start_s": (0.0, 1e6)}
    robot: int
    speed_mps: float
    heading_rad: float
    start_s: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"heading_rad": float(rng.uniform(-np.pi, np.pi)), "start_s": float(rng.uniform(10.0, 25.0))}

    def _edit(self, scene: TeamScene) -> TeamScene:
        precise(scene, TOLERANCE)
        base_slides(scene, self.robot, "late", armature=ARMATURE_KG, damping=DAMPING_NS_PER_M, stiffness=1.0)
        return scene

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        return [_Starts(self)]


class _Starts:
    """Pulls the slides, as strongly as their damping asks for, from a time on."""

    def __init__(self, creep: LateCreep) -> None:
        self._creep = creep

    def start(self, stage: Stage) -> None:
        self._data, self._dt = stage.data, 1.0 / stage.rate_hz
        joints = [stage.model.joint(f"omnid{self._creep.robot}/late_{axis}") for axis in "xy"]
        self._dofs = [int(joint.dofadr[0]) for joint in joints]
        heading = self._creep.heading_rad
        self._force = DAMPING_NS_PER_M * self._creep.speed_mps * np.array([np.cos(heading), np.sin(heading)])

    def act(self, tick: int) -> None:
        if tick * self._dt >= self._creep.start_s:
            self._data.qfrc_applied[self._dofs] += self._force

"""A base that creeps over the floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.slides import base_slides
from mocobot_sim.effects.solver import precise

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene
    from mocobot_sim.trial.actors import Actor, Reader, Stage

# So heavy that the arm's forces move it by less than 1e-9 m/s, and at its velocity within some 10 ms.
ARMATURE_KG = 1e9
DAMPING_NS_PER_M = 1e11
# The armature raises the mean inertia, which the solver's stopping rule scales with, by eight orders.
TOLERANCE = 1e-20


@dataclass(frozen=True)
class BaseCreep(Effect):
    """A base that moves at a constant velocity from ``start_s`` on, along x and y of its {b} [m/s].

    Two slides under the chassis with an immense ``armature`` and ``damping``, each pulled by a spring of 1 N/m whose
    ``springref`` is so far away that its force is constant: damping times the velocity. MJCF has no time: a base that
    starts later is pulled by the trial (``qfrc_applied``).
    """

    ranges: ClassVar = {"x_mps": (-1e-3, 1e-3), "y_mps": (-1e-3, 1e-3), "start_s": (0.0, 1e9)}
    robot: int
    x_mps: float = 0.0
    y_mps: float = 0.0
    start_s: float = 0.0

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        """What pulls it in a trial, if it starts later."""
        return [_Starts(self)] if self.start_s else []

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """It changes no reading."""
        return []

    def _edit(self, scene: TeamScene) -> TeamScene:
        precise(scene, TOLERANCE)
        slides = base_slides(
            scene, self.robot, "creep",
            armature=ARMATURE_KG, damping=DAMPING_NS_PER_M, stiffness=1.0,
        )  # fmt: skip
        if not self.start_s:
            for slide, velocity in zip(slides, (self.x_mps, self.y_mps), strict=True):
                slide.springref = DAMPING_NS_PER_M * velocity
        return scene


class _Starts:
    """Pulls the slides as strongly as their damping asks for, from a time on."""

    def __init__(self, creep: BaseCreep) -> None:
        self._creep = creep

    def start(self, stage: Stage) -> None:
        """Find the slides."""
        creep, self._dt = self._creep, 1.0 / stage.rate_hz
        joints = [stage.model.joint(f"omnid{creep.robot}/creep_{axis}") for axis in "xy"]
        self._data, self._dofs = stage.data, [int(joint.dofadr[0]) for joint in joints]
        self._force = DAMPING_NS_PER_M * np.array([creep.x_mps, creep.y_mps])

    def act(self, tick: int) -> None:
        """Pull."""
        if tick * self._dt >= self._creep.start_s - 1e-9:
            self._data.qfrc_applied[self._dofs] += self._force

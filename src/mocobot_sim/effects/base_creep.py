"""A base that creeps over the floor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.slides import base_slides
from mocobot_sim.effects.solver import precise

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene

# So heavy that the arm's forces move it by less than 1e-9 m/s, and at its velocity within some 10 ms.
ARMATURE_KG = 1e9
DAMPING_NS_PER_M = 1e11
# The armature raises the mean inertia, which the solver's stopping rule scales with, by eight orders.
TOLERANCE = 1e-20


@dataclass(frozen=True)
class BaseCreep(Effect):
    """A base that moves at a constant velocity from t = 0 on, along x and y of its {b} [m/s].

    Two slides under the chassis with an immense ``armature`` and ``damping``, each pulled by a spring of 1 N/m whose
    ``springref`` is so far away that its force is constant: damping times the velocity.
    """

    ranges: ClassVar = {"x_mps": (-1e-3, 1e-3), "y_mps": (-1e-3, 1e-3)}
    robot: int
    x_mps: float = 0.0
    y_mps: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        precise(scene, TOLERANCE)
        slides = base_slides(
            scene, self.robot, "creep",
            armature=ARMATURE_KG, damping=DAMPING_NS_PER_M, stiffness=1.0,
        )  # fmt: skip
        for slide, velocity in zip(slides, (self.x_mps, self.y_mps), strict=True):
            slide.springref = DAMPING_NS_PER_M * velocity
        return scene

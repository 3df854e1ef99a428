"""A loose grasp."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.slides import LOOSE_ARMATURE_KG, add_slides, grasp_body, widened
from mocobot_sim.effects.solver import precise
from mocobot_sim.solver_settings import STIFF

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene

# Stiffer than a weld, so that an impact goes less deep: the shortest time constant at 1 ms.
IMPACT = [0.002, 1.0]


@dataclass(frozen=True)
class GraspPlay(Effect):
    """The grasp moves freely within +-``play_m`` of its place along each axis of {i} [m], and cannot turn.

    Three slides with stiff ``range`` limits, on the payload (robot 1) or on a pad between flange and weld (the others).
    """

    on_payload = True
    ranges: ClassVar = {"play_m": (0.0, 5e-3)}
    robot: int
    play_m: float

    def _edit(self, scene: TeamScene) -> TeamScene:
        if not self.play_m:
            return scene
        precise(scene)
        add_slides(
            grasp_body(scene, self.robot), "play", "xyz", range=[-self.play_m, self.play_m], limited=True,
            armature=LOOSE_ARMATURE_KG,
            solreflimit=IMPACT, solimplimit=STIFF["solimp"],
        )  # fmt: skip
        # The corner of the box, and the softness of the limits.
        return widened(scene, self.robot, 1.75 * self.play_m + 40e-6)

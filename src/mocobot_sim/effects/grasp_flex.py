"""A grasp that flexes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.slides import SPRUNG_ARMATURE_KG, add_slides, add_springs, grasp_body, widened
from mocobot_sim.effects.solver import precise

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene

# More than any grasp carries: how far a sound grasp may give way.
LARGEST_FORCE_N = 400.0


@dataclass(frozen=True)
class GraspFlex(Effect):
    """Translational springs of ``compliance_m_per_N`` between flange and payload, the same in all directions [m/N].

    Three slides, on the payload (robot 1) or on a pad between flange and weld (the others), held by soft ``joint``
    equalities (see ``mocobot_sim.scene.soft``). They follow the force with a time constant of ``relaxation_s`` [s];
    below 5 ms, critically damped, as their mass lets them. The grasp cannot turn.
    """

    on_payload = True
    ranges: ClassVar = {"compliance_m_per_N": (0.0, 1e-3), "relaxation_s": (0.0, 10.0)}
    robot: int
    compliance_m_per_N: float
    relaxation_s: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        if not self.compliance_m_per_N:
            return scene
        precise(scene)
        slides = add_slides(grasp_body(scene, self.robot), "flex", "xyz", armature=SPRUNG_ARMATURE_KG)
        scene = add_springs(scene, slides, f"grasp{self.robot}", self.compliance_m_per_N, self.relaxation_s)
        return widened(scene, self.robot, LARGEST_FORCE_N * self.compliance_m_per_N)

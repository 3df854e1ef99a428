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

# More than any grasp carries.
LARGEST_FORCE_N = 400.0
# Stiffer than a weld, so that an impact goes less deep: the shortest time constant at 1 ms.
IMPACT = [0.002, 1.0]


@dataclass(frozen=True)
class GraspPlay(Effect):
    """The grasp moves freely within +-``play_m`` of its place along each axis of {i} [m], and cannot turn.

    Three slides with ``range`` limits, on the payload (robot 1) or on a pad between flange and weld (the others). The
    limits are stiff, or give way by ``contact_m_per_N`` [m/N], critically damped.
    """

    on_payload = True
    ranges: ClassVar = {"play_m": (0.0, 5e-3), "contact_m_per_N": (0.0, 1e-4)}
    robot: int
    play_m: float
    contact_m_per_N: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        if not self.play_m:
            return scene
        precise(scene)
        slides = add_slides(
            grasp_body(scene, self.robot), "play", "xyz", range=[-self.play_m, self.play_m], limited=True,
            armature=LOOSE_ARMATURE_KG,
            solreflimit=IMPACT, solimplimit=STIFF["solimp"],
        )  # fmt: skip
        if self.contact_m_per_N:
            from mocobot_sim.scene.soft import spring_parameters

            model = scene.compile()
            for slide in slides:
                dof = model.joint(slide.full_identifier).dofadr[0]
                slide.solreflimit, slide.solimplimit = spring_parameters(
                    self.contact_m_per_N, float(model.dof_invweight0[dof])
                )
        # The corner of the box, and the softness of the limits.
        soft = 40e-6 + 1.75 * LARGEST_FORCE_N * self.contact_m_per_N
        return widened(scene, self.robot, 1.75 * self.play_m + soft)

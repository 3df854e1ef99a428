"""A grasp that flexes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.slides import AXES, SPRUNG_ARMATURE_KG, add_slides, add_springs, grasp_body, widened
from mocobot_sim.effects.solver import precise

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene

# More than any grasp carries: how far a sound grasp may give way.
LARGEST_FORCE_N = 400.0
# Of the hinges' own, tiny, motion: a weld on a lighter pad would be softer (see ``slides``).
HINGE_ARMATURE_KGM2 = 0.01


@dataclass(frozen=True)
class GraspFlex(Effect):
    """Springs of ``compliance_m_per_N`` between flange and payload, the same in all directions [m/N].

    Three slides, on the payload (robot 1) or on a pad between flange and weld (the others), held by soft ``joint``
    equalities (see ``mocobot_sim.scene.soft``). They follow the force with a time constant of ``relaxation_s`` [s];
    below 5 ms, critically damped, as their mass lets them. The grasp may turn besides, by ``turning_rad_per_N`` of
    force across z of {i} [rad/N]: three hinges, held alike, about a point at ``offset_m`` [m] along z from the gimbal's
    centre. The gimbal passes no moment, so a grasp whose point is the centre does not turn at all.
    """

    on_payload = True
    ranges: ClassVar = {
        "compliance_m_per_N": (0.0, 1e-3), "relaxation_s": (0.0, 10.0), "turning_rad_per_N": (0.0, 0.01),
        "offset_m": (-0.5, 0.5),
    }  # fmt: skip
    inherent: ClassVar = {"relaxation_s": 0.005}
    robot: int
    compliance_m_per_N: float
    relaxation_s: float = 0.0
    turning_rad_per_N: float = 0.0
    offset_m: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        if self.compliance_m_per_N:
            precise(scene)
            slides = add_slides(grasp_body(scene, self.robot), "flex", "xyz", armature=SPRUNG_ARMATURE_KG)
            scene = add_springs(
                scene, slides, f"grasp{self.robot}", self.compliance_m_per_N, self.relaxation_s
            )
        if self.turning_rad_per_N and self.offset_m:
            scene = self._turning(scene)
        way = self.compliance_m_per_N + self.turning_rad_per_N * abs(self.offset_m)
        return widened(scene, self.robot, LARGEST_FORCE_N * way) if way else scene

    def _turning(self, scene: TeamScene) -> TeamScene:
        precise(scene)
        body, at = grasp_body(scene, self.robot), [0.0, 0.0, self.offset_m]
        hinges = [
            body.add(
                "joint", name=f"flex_about_{axis}", type="hinge", pos=at, axis=along, group=3,
                armature=HINGE_ARMATURE_KGM2,
            )
            for axis, along in AXES.items()
        ]  # fmt: skip
        by_moment = self.turning_rad_per_N / abs(self.offset_m)
        scene = add_springs(scene, hinges, f"grasp{self.robot}", by_moment, self.relaxation_s)
        slack = np.array(scene.grasp_slack_rad or (0.0,) * scene.robots)
        slack[self.robot - 1] += LARGEST_FORCE_N * self.turning_rad_per_N
        return replace(scene, grasp_slack_rad=tuple(slack.tolist()))

"""A base that gives way sideways."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.slides import SPRUNG_ARMATURE_KG, add_springs, base_slides, robot_mass_kg
from mocobot_sim.effects.solver import precise

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class BaseCompliance(Effect):
    """A base on horizontal springs of ``compliance_m_per_N``, the same in x and y [m/N].

    Two slides under the chassis, held by soft ``joint`` equalities (see ``mocobot_sim.scene.soft``). They follow the
    force with a time constant of ``relaxation_s`` [s]; below 5 ms, critically damped, as their mass lets them. What
    moves is the robot; where ``mass_kg`` [kg] is more than that, the rest moves along with the slides.
    """

    ranges: ClassVar = {"compliance_m_per_N": (0.0, 1e-2), "relaxation_s": (0.0, 10.0), "mass_kg": (0.0, 1e4)}
    inherent: ClassVar = {"relaxation_s": 0.005, "mass_kg": 35.0}
    robot: int
    compliance_m_per_N: float
    relaxation_s: float = 0.0
    mass_kg: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        if not self.compliance_m_per_N:
            return scene
        precise(scene)
        armature = max(self.mass_kg - robot_mass_kg(scene, self.robot), SPRUNG_ARMATURE_KG)
        slides = base_slides(scene, self.robot, "compliance", armature=armature)
        return add_springs(scene, slides, f"base{self.robot}", self.compliance_m_per_N, self.relaxation_s)

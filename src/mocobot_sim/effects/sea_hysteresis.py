"""A spring with friction inside."""

from dataclasses import dataclass
from typing import ClassVar

from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.friction import STICK
from mocobot_sim.effects.solver import precise
from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class SeaHysteresis(Effect):
    """Coulomb friction ``friction_Nm`` beside the spring: ``frictionloss`` of the spring joint [N m].

    The link feels spring plus friction; the reading is the deflection's alone.
    """

    ranges: ClassVar = {"friction_Nm": (0.0, 20.0)}
    robot: int
    joint: int
    friction_Nm: float

    def _edit(self, scene: TeamScene) -> TeamScene:
        if self.friction_Nm:
            precise(scene)
            spring = scene.root.find("joint", f"omnid{self.robot}/spring{self.joint}")
            spring.set_attributes(frictionloss=self.friction_Nm, **STICK)
        return scene

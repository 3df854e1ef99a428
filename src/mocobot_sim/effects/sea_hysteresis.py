"""A spring with friction inside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.friction import STICK
from mocobot_sim.effects.slider import Slider
from mocobot_sim.effects.solver import precise
from mocobot_sim.scene.design import omnid_design
from mocobot_sim.trial.actors import Actor, Reader

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class SeaHysteresis(Effect):
    """Coulomb friction ``friction_Nm`` beside the spring: ``frictionloss`` of the spring joint [N m].

    The link feels spring plus friction; the reading is the deflection's alone. With ``presliding_Nm`` the slider sits
    behind a spring of its own and gives way before it slips, by the deflection at which the spring reads that torque.
    """

    ranges: ClassVar = {"friction_Nm": (0.0, 20.0), "presliding_Nm": (0.0, 20.0)}
    robot: int
    joint: int
    friction_Nm: float
    presliding_Nm: float = 0.0

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        """The slider behind its spring."""
        if not (self.friction_Nm and self.presliding_Nm):
            return ()
        yield_rad = self.presliding_Nm / omnid_design().sea_stiffness_Nm_per_rad
        return (Slider("spring", self.robot, self.joint, self.friction_Nm, yield_rad),)

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """No sensor misreads."""
        return ()

    def _edit(self, scene: TeamScene) -> TeamScene:
        if self.friction_Nm and not self.presliding_Nm:
            precise(scene)
            spring = scene.root.find("joint", f"omnid{self.robot}/spring{self.joint}")
            spring.set_attributes(frictionloss=self.friction_Nm, **STICK)
        return scene

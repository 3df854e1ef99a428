"""Friction of a driven joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.friction import STICK
from mocobot_sim.effects.slider import Slider
from mocobot_sim.effects.solver import precise
from mocobot_sim.trial.actors import Actor, Reader

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class JointFriction(Effect):
    """Coulomb [N m] and viscous [N m s/rad] friction between a driven link and the chassis, past its spring.

    A fixed tendon of motor plus spring (so its length is phi) with ``frictionloss``, and a soft ``tendon`` equality
    (see ``mocobot_sim.scene.soft``) as its damper. The sensor does not feel it. With
    ``presliding_rad`` dry friction is a slider behind a spring of its own, which slips after that way.
    """

    ranges: ClassVar = {
        "coulomb_Nm": (0.0, 20.0),
        "viscous_Nms_per_rad": (0.0, 100.0),
        "presliding_rad": (0.0, 1.0),
    }
    robot: int
    joint: int
    coulomb_Nm: float = 0.0
    viscous_Nms_per_rad: float = 0.0
    presliding_rad: float = 0.0

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        """The slider behind its spring."""
        if not (self.coulomb_Nm and self.presliding_rad):
            return ()
        return (Slider("driven", self.robot, self.joint, self.coulomb_Nm, self.presliding_rad),)

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """No sensor misreads."""
        return ()

    def _edit(self, scene: TeamScene) -> TeamScene:
        if not (self.coulomb_Nm or self.viscous_Nms_per_rad):
            return scene
        precise(scene)
        root, name = scene.root, f"friction{self.robot}_{self.joint}"
        tendon = root.tendon.add("fixed", name=name)
        for part in ("motor", "spring"):
            joint = root.find("joint", f"omnid{self.robot}/{part}{self.joint}")
            tendon.add("joint", joint=joint, coef=1.0)
        if self.coulomb_Nm and not self.presliding_rad:
            tendon.set_attributes(frictionloss=self.coulomb_Nm, **STICK)
        if self.viscous_Nms_per_rad:
            root.equality.add("tendon", name=name, tendon1=tendon)
            scene = scene.damped(name, self.viscous_Nms_per_rad)
        return scene

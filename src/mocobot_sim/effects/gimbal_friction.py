"""Friction of a gimbal joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.friction import STICK
from mocobot_sim.effects.slider import Slider
from mocobot_sim.effects.solver import precise
from mocobot_sim.scene.design import GIMBAL_AXES
from mocobot_sim.trial.actors import Actor, Reader

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class GimbalFriction(Effect):
    """Coulomb [N m] and viscous [N m s/rad] friction of one gimbal joint (joints 1, 2, 3 are z, y, x).

    ``frictionloss`` of ``rows`` fixed tendons along the joint, and a soft ``joint`` equality (see
    ``mocobot_sim.scene.soft``) as its damper: damping of the joint itself would pull the welds open. With
    ``presliding_rad`` dry friction is a slider behind a spring of its own, which slips after that way.

    Attributes:
        rows: The gimbal is light, so one row would creep (see ``friction``): stiction would fade within ten seconds.
            Rows side by side share the torque, and creep by as much less.
    """

    rows: ClassVar[int] = 8

    ranges: ClassVar = {
        "coulomb_Nm": (0.0, 5.0),
        "viscous_Nms_per_rad": (0.0, 10.0),
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
        return (Slider("gimbal", self.robot, self.joint, self.coulomb_Nm, self.presliding_rad),)

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """No sensor misreads."""
        return ()

    def _edit(self, scene: TeamScene) -> TeamScene:
        if self.coulomb_Nm or self.viscous_Nms_per_rad:
            precise(scene)
        axis = GIMBAL_AXES[self.joint - 1]
        joint = scene.root.find("joint", f"omnid{self.robot}/gimbal_{axis}")
        for k in range(self.rows if self.coulomb_Nm and not self.presliding_rad else 0):
            tendon = scene.root.tendon.add(
                "fixed", name=f"friction{self.robot}_gimbal_{axis}{k + 1}",
                frictionloss=self.coulomb_Nm / self.rows, **STICK,
            )  # fmt: skip
            tendon.add("joint", joint=joint, coef=1.0)
        if self.viscous_Nms_per_rad:
            name = f"damping{self.robot}_gimbal_{axis}"
            scene.root.equality.add("joint", name=name, joint1=joint)
            scene = scene.damped(name, self.viscous_Nms_per_rad)
        return scene

"""An effect that the catalogue does not have: a spring, such as a bent hose, pulls a driven joint towards home."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from mocobot_sim.effects.base import Effect
from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class JointSpring(Effect):
    """Torque -k (phi - home) on a driven link, past its series-elastic spring: a tendon with ``stiffness``."""

    ranges: ClassVar = {"stiffness_Nm_per_rad": (0.0, 10.0)}
    robot: int
    joint: int
    stiffness_Nm_per_rad: float

    def _edit(self, scene: TeamScene) -> TeamScene:
        tendon = scene.root.tendon.add(
            "fixed", name=f"hose{self.robot}_{self.joint}",
            stiffness=self.stiffness_Nm_per_rad, springlength=[0.0, 0.0],
        )  # fmt: skip
        for part in ("motor", "spring"):
            joint = scene.root.find("joint", f"omnid{self.robot}/{part}{self.joint}")
            tendon.add("joint", joint=joint, coef=1.0)
        return scene

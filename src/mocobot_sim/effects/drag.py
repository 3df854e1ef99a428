"""Something that resists the payload's motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from mocobot_sim.effects.base import Effect

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class Drag(Effect):
    """A force -c v on the payload at its centre of mass, c in N s/m, and a moment -c_r omega, c_r in N m s/rad.

    Six ``general`` actuators with a site transmission relative to a site of the world, affine bias (0, 0, -c) and no
    use for their control.
    """

    on_payload = True
    ranges: ClassVar = {"coefficient_Ns_per_m": (0.0, 1e3), "turning_Nms_per_rad": (0.0, 1e3)}
    coefficient_Ns_per_m: float
    turning_Nms_per_rad: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        if not (self.coefficient_Ns_per_m or self.turning_Nms_per_rad):
            return scene
        root = scene.root
        com = scene.compile().body("omnid1/payload/payload").ipos
        payload = root.find("body", "omnid1/payload/payload")
        site = payload.add("site", name="drag", pos=com.tolist(), group=4, size=[0.006])
        still = root.worldbody.add("site", name="drag", group=4, size=[0.006])
        for k, name in enumerate(("x", "y", "z", "turn_x", "turn_y", "turn_z")):
            c = self.coefficient_Ns_per_m if k < 3 else self.turning_Nms_per_rad
            if not c:
                continue
            gear = [0.0] * 6
            gear[k] = 1.0
            root.actuator.add(
                "general", name=f"drag_{name}", site=site, refsite=still, gear=gear,
                gaintype="fixed", gainprm=[0.0], biastype="affine", biasprm=[0.0, 0.0, -c],
            )  # fmt: skip
        return scene

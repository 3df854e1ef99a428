"""Something elastic that ties the payload to the room."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.spring import SPRING_RANGES, add_site, tie

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class PayloadTether(Effect):
    """A spring from a point of the payload, given in {1}, to a fixed point; a cable, if it has a length.

    A spatial tendon like that of ``Tether``. The anchor is given in robot 1's {b} as its floor mount has it [m].
    """

    on_payload = True
    ranges: ClassVar = SPRING_RANGES
    stiffness_N_per_m: float
    anchor_x_m: float
    anchor_y_m: float
    anchor_z_m: float
    point_x_m: float
    point_y_m: float
    point_z_m: float
    length_m: float = 0.0
    stiffening_N_per_m2: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        if not (self.stiffness_N_per_m or self.stiffening_N_per_m2):
            return scene
        at = scene.X_Wb[0].apply([self.anchor_x_m, self.anchor_y_m, self.anchor_z_m])
        point = [self.point_x_m, self.point_y_m, self.point_z_m]
        site = add_site(scene.root.find("body", "omnid1/payload/payload"), "payload_tether", point)
        strength = self.stiffness_N_per_m, self.length_m, self.stiffening_N_per_m2
        tie(scene, "payload_tether", site, at, *strength)
        return scene

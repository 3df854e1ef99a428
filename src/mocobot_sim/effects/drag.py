"""Something that resists the payload's motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from mocobot_sim.effects.base import Effect

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


# A fluid so thin that it resists nothing but what has immense coefficients: any other body less than a nanonewton.
DENSITY_KG_PER_M3, RADIUS_M = 1e-6, 0.01


@dataclass(frozen=True)
class Drag(Effect):
    """A force -c v on the payload at its centre of mass, c in N s/m, and a moment -c_r omega, c_r in N m s/rad.

    Six ``general`` actuators with a site transmission relative to a site of the world, affine bias (0, 0, -c) and no
    use for their control. What goes with the square of the speed, -q |v| v and -q_r |omega| omega, is the drag of
    MuJoCo's fluid on a sphere (``fluidshape="ellipsoid"``): density times area, or 8/15 pi r^5, times ``fluidcoef``.
    """

    on_payload = True
    ranges: ClassVar = {
        "coefficient_Ns_per_m": (0.0, 1e3), "turning_Nms_per_rad": (0.0, 1e3),
        "quadratic_Ns2_per_m2": (0.0, 1e4), "turning_quadratic_Nms2_per_rad2": (0.0, 1e4),
    }  # fmt: skip
    coefficient_Ns_per_m: float
    turning_Nms_per_rad: float = 0.0
    quadratic_Ns2_per_m2: float = 0.0
    turning_quadratic_Nms2_per_rad2: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        linear, squares = self._numbers
        if not any((*linear, *squares)):
            return scene
        root = scene.root
        com = scene.compile().body("omnid1/payload/payload").ipos
        payload = root.find("body", "omnid1/payload/payload")
        site = payload.add("site", name="drag", pos=com.tolist(), group=4, size=[0.006])
        still = root.worldbody.add("site", name="drag", group=4, size=[0.006])
        for k, name in enumerate(("x", "y", "z", "turn_x", "turn_y", "turn_z")):
            c = linear[k // 3]
            if not c:
                continue
            gear = [0.0] * 6
            gear[k] = 1.0
            root.actuator.add(
                "general", name=f"drag_{name}", site=site, refsite=still, gear=gear,
                gaintype="fixed", gainprm=[0.0], biastype="affine", biasprm=[0.0, 0.0, -c],
            )  # fmt: skip
        if any(squares):
            root.option.density = DENSITY_KG_PER_M3
            own = DENSITY_KG_PER_M3 * np.pi * np.array([RADIUS_M**2, 8.0 / 15.0 * RADIUS_M**5])
            along, turning = np.array(squares) / own
            payload.add(
                "geom", name="drag", type="sphere", pos=com.tolist(), size=[RADIUS_M], group=4, contype=0,
                conaffinity=0, mass=0.0, fluidshape="ellipsoid", fluidcoef=[along, 0.0, turning, 0.0, 0.0],
            )  # fmt: skip
        return scene

    @property
    def _numbers(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """With the speeds and with their squares: of the motion, of turning."""
        return (
            (self.coefficient_Ns_per_m, self.turning_Nms_per_rad),
            (self.quadratic_Ns2_per_m2, self.turning_quadratic_Nms2_per_rad2),
        )

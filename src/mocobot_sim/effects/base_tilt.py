"""A base that does not stand level."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from estimator.arrays import Array
from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.slides import level_slides
from mocobot_sim.scene.design import base_height_m

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class BaseTilt(Effect):
    """A base turned by the rotation vector (roll, pitch, 0), in its own untilted axes, about its floor mount [rad].

    The chassis body's ``quat``.
    """

    ranges: ClassVar = {"roll_rad": (-0.2, 0.2), "pitch_rad": (-0.2, 0.2)}
    robot: int
    roll_rad: float = 0.0
    pitch_rad: float = 0.0

    @property
    def tilt(self) -> Rotation:
        """From the level axes to the tilted ones."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_rotvec([self.roll_rad, self.pitch_rad, 0.0])

    def base_shift(self) -> Array:
        """It turns about the mount, below {b}."""
        height = np.array([0.0, 0.0, base_height_m()])
        return np.asarray(self.tilt.apply(height) - height)

    def _edit(self, scene: TeamScene) -> TeamScene:
        chassis = scene.root.find("body", f"omnid{self.robot}/chassis")
        chassis.quat = self.tilt.as_quat(scalar_first=True)
        level_slides(chassis)
        return scene

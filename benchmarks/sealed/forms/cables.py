"""Cables: springs to a fixed point of the room, slack below their length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from mocobot.campaign.effects import REACH_M
from mocobot_sim.effects.spring import add_site, tie
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import TeamScene
from sealed.forms.base import Form, Place, direction, near, vector
from sealed.ground import Ground

TRAVEL_M = (0.01, 0.05)
"""How far a cable is stretched at home: the payload moves by as much, so it goes slack at times."""


@dataclass(frozen=True)
class PayloadCable(Form):
    """From a point of the payload, given in {1}, to a point of the room, given in {1} as the payload rests at home."""

    answer = "payload_tether"
    size = "stiffness_N_per_m"
    size_is_known = True
    on_payload = True
    ranges: ClassVar = {"stiffness_N_per_m": (0.0, 1e4), "length_m": (0.0, 100.0)}
    stiffness_N_per_m: float
    length_m: float
    point_x_m: float
    point_y_m: float
    point_z_m: float
    anchor_x_m: float
    anchor_y_m: float
    anchor_z_m: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        point, distance = near(ground.p_1c, REACH_M, rng), rng.uniform(0.5, 1.5)
        length = float(distance - rng.uniform(*TRAVEL_M))
        anchor = point + distance * direction(rng)
        return {"length_m": length} | vector("point", "m", point) | vector("anchor", "m", anchor)

    def _edit(self, scene: TeamScene) -> TeamScene:
        site = add_site(scene.root.find("body", "omnid1/payload/payload"), "cable", self.xyz("point"))
        rest = scene.X_Wb[0].apply(scene.wrist_home_b[0])  # origin of {1} at home
        R_W1 = (scene.X_Wb[0].rotation * _home_turn(scene)).as_matrix()
        anchor = rest + R_W1 @ self.xyz("anchor")
        tie(scene, "payload_cable", site, anchor, self.stiffness_N_per_m, self.length_m)
        return scene


def _home_turn(scene: TeamScene) -> Rotation:
    return Rotation.from_euler("ZYX", scene.theta_home[0])


@dataclass(frozen=True)
class RobotCable(Form):
    """From a robot's wrist to a point of the room, given in its {b}."""

    answer = "tether"
    size = "stiffness_N_per_m"
    size_is_known = True
    ranges: ClassVar = {"stiffness_N_per_m": (0.0, 1e4), "length_m": (0.0, 100.0)}
    robot: int
    stiffness_N_per_m: float
    length_m: float
    anchor_x_m: float
    anchor_y_m: float
    anchor_z_m: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        distance, home = rng.uniform(0.5, 1.5), np.array([0.0, 0.0, omnid_design().home_height_m])
        length = float(distance - rng.uniform(*TRAVEL_M))
        return {"length_m": length} | vector("anchor", "m", home + distance * direction(rng))

    def _edit(self, scene: TeamScene) -> TeamScene:
        platform = scene.root.find("body", f"omnid{self.robot}/platform")
        site = add_site(platform, "cable", [0.0, 0.0, 0.0])
        anchor = scene.X_Wb[self.robot - 1].apply(self.xyz("anchor"))
        tie(scene, f"cable{self.robot}", site, anchor, self.stiffness_N_per_m, self.length_m)
        return scene


@dataclass(frozen=True)
class StiffeningStrap(RobotCable):
    """A cable that gets stiffer the more it is stretched: k e (1 + e / e_2), as woven straps do."""

    size_is_known = False
    doubled_m: float = 0.02

    def _edit(self, scene: TeamScene) -> TeamScene:
        scene = super()._edit(scene)
        tendon = scene.root.find("tendon", f"cable{self.robot}")
        tendon.stiffness = [self.stiffness_N_per_m, self.stiffness_N_per_m / self.doubled_m]
        return scene


@dataclass(frozen=True)
class RubberCord(PayloadCable):
    """A cable that gets softer and then stiffer, k e (1 - e / e_1 + (e / e_2)^2), as rubber does."""

    size_is_known = False
    softer_m: float = 0.05
    stiffer_m: float = 0.04

    def _edit(self, scene: TeamScene) -> TeamScene:
        scene = super()._edit(scene)
        k, tendon = self.stiffness_N_per_m, scene.root.find("tendon", "payload_cable")
        tendon.stiffness = [k, -k / self.softer_m, k / self.stiffer_m**2]
        return scene

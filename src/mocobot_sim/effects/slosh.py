"""Liquid, or anything that swings, in the payload."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from estimator.arrays import Array
from estimator.inertia import inertia_parameters
from mocobot_sim.effects.base import Effect
from mocobot_sim.scene.design import omnid_design

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class Slosh(Effect):
    """A pendulum that hangs from a point of the payload, given in {1} [m]; its mass adds to the payload's.

    A child body of the payload with two hinges and a point mass ``length_m`` below them; ``damping_ratio`` is that of
    small swings.
    """

    on_payload = True
    ranges: ClassVar = {"mass_kg": (0.0, 100.0), "length_m": (0.005, 10.0), "damping_ratio": (0.0, 10.0)}
    mass_kg: float
    length_m: float
    damping_ratio: float
    point_x_m: float = 0.0
    point_y_m: float = 0.0
    point_z_m: float = 0.0

    def carried(self) -> Array:
        """The mass at its pivot, which is where small swings leave it."""
        at = np.array([self.point_x_m, self.point_y_m, self.point_z_m])
        about_1 = inertia_parameters(at @ at * np.eye(3) - np.outer(at, at))
        return self.mass_kg * np.concatenate([[1.0], at, about_1])

    def _edit(self, scene: TeamScene) -> TeamScene:
        if not self.mass_kg:
            return scene
        payload = scene.root.find("body", "omnid1/payload/payload")
        body = payload.add("body", name="slosh", pos=[self.point_x_m, self.point_y_m, self.point_z_m])
        inertia = self.mass_kg * self.length_m**2
        frequency = np.sqrt(omnid_design().gravity_mps2 / self.length_m)
        damping = 2.0 * self.damping_ratio * frequency * inertia
        for axis, along in (("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0])):
            body.add("joint", name=f"slosh_{axis}", type="hinge", axis=along, damping=damping, group=3)
        body.add(
            "inertial", pos=[0.0, 0.0, -self.length_m], mass=self.mass_kg, diaginertia=[1e-6 * inertia] * 3
        )
        body.add(
            "geom", name="slosh", type="sphere", pos=[0.0, 0.0, -self.length_m], size=[0.02], group=2,
            contype=0, conaffinity=0, mass=0.0, rgba=[0.2, 0.5, 0.9, 1.0],
        )  # fmt: skip
        return scene

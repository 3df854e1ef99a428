"""Liquid, or anything that swings, in the payload."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from estimator.arrays import Array, inertia_parameters
from mocobot_sim.effects.base import Effect
from mocobot_sim.scene.design import omnid_design

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class Slosh(Effect):
    """A pendulum that hangs from a point of the payload, given in {1} [m]; its mass adds to the payload's.

    A child body of the payload with two hinges and a point mass ``length_m`` below them; ``damping_ratio`` is that of
    small swings.

    With ``across_length_m`` it swings on ``length_m`` in the direction ``heading_rad`` from x of {1}, about z, and on
    the other length across: one hinge is that much nearer to the mass. ``second_share`` of the mass swings on
    ``second_length_m``, in a second body at the same point.
    """

    on_payload = True
    ranges: ClassVar = {
        "mass_kg": (0.0, 100.0), "length_m": (0.005, 10.0), "damping_ratio": (0.0, 10.0),
        "across_length_m": (0.0, 10.0), "second_length_m": (0.0, 10.0), "second_share": (0.0, 1.0),
    }  # fmt: skip
    mass_kg: float
    length_m: float
    damping_ratio: float
    point_x_m: float = 0.0
    point_y_m: float = 0.0
    point_z_m: float = 0.0
    across_length_m: float = 0.0
    heading_rad: float = 0.0
    second_length_m: float = 0.0
    second_share: float = 0.0

    def carried(self) -> Array:
        """The mass at its pivot, which is where small swings leave it; at the middle of two."""
        at = np.array([self.point_x_m, self.point_y_m, self.point_z_m])
        at[2] -= 0.5 * (self.length_m - self._across_m)
        about_1 = inertia_parameters(at @ at * np.eye(3) - np.outer(at, at))
        return self.mass_kg * np.concatenate([[1.0], at, about_1])

    @property
    def _across_m(self) -> float:
        return self.across_length_m or self.length_m

    def _edit(self, scene: TeamScene) -> TeamScene:
        second = self.second_share if self.second_length_m else 0.0
        self._hang(scene, "slosh", (1.0 - second) * self.mass_kg, self.length_m, self._across_m)
        self._hang(scene, "slosh_second", second * self.mass_kg, self.second_length_m, self.second_length_m)
        return scene

    def _hang(self, scene: TeamScene, name: str, mass_kg: float, length_m: float, across_m: float) -> None:
        """A body with a mass ``length_m`` below the point, which swings across on another length."""
        if not mass_kg:
            return
        payload = scene.root.find("body", "omnid1/payload/payload")
        half = 0.5 * self.heading_rad
        body = payload.add(
            "body", name=name, pos=[self.point_x_m, self.point_y_m, self.point_z_m],
            quat=[np.cos(half), 0.0, 0.0, np.sin(half)],
        )  # fmt: skip
        # Turning about x it swings along y.
        for axis, along, own_m in (("x", [1.0, 0.0, 0.0], across_m), ("y", [0.0, 1.0, 0.0], length_m)):
            damping = (
                2.0 * self.damping_ratio * np.sqrt(omnid_design().gravity_mps2 / own_m) * mass_kg * own_m**2
            )
            body.add(
                "joint", name=f"{name}_{axis}", type="hinge", axis=along, pos=[0.0, 0.0, own_m - length_m],
                damping=damping, group=3,
            )  # fmt: skip
        small = [1e-6 * mass_kg * length_m**2] * 3
        body.add("inertial", pos=[0.0, 0.0, -length_m], mass=mass_kg, diaginertia=small)
        body.add(
            "geom", name=name, type="sphere", pos=[0.0, 0.0, -length_m], size=[0.02], group=2,
            contype=0, conaffinity=0, mass=0.0, rgba=[0.2, 0.5, 0.9, 1.0],
        )  # fmt: skip

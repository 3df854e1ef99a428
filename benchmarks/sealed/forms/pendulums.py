"""What swings in the payload with two modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.linalg import eigh

from estimator.arrays import Array, inertia_parameters
from hidden.limits import pendulum_limit_kg
from mocobot.campaign.effects import REACH_M
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import TeamScene
from sealed.forms.base import Form, Place, near, vector
from sealed.ground import Ground


@dataclass(frozen=True)
class DoublePendulum(Form):
    """A mass on a string, and another on a string below it: two modes in each direction.

    What a payload feels of a mode is its effective mass. Known is that of the slower one, which a single pendulum is.
    """

    answer = "slosh"
    size = "mass_kg"
    on_payload = True
    ranges: ClassVar = {
        "mass_kg": (0.0, 100.0), "length_m": (0.01, 10.0), "lower_share": (0.0, 0.45), "lower_length_m": (0.01, 10.0),
        "damping_ratio": (0.0, 10.0),
    }  # fmt: skip
    mass_kg: float
    length_m: float
    lower_share: float
    lower_length_m: float
    damping_ratio: float
    point_x_m: float
    point_y_m: float
    point_z_m: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        length = float(rng.uniform(0.1, 0.35))
        return cls(
            mass_kg=size * pendulum_limit_kg(length),
            length_m=length,
            lower_share=float(rng.uniform(0.15, 0.4)),
            lower_length_m=float(length * rng.uniform(0.4, 1.2)),
            damping_ratio=float(rng.uniform(0.03, 0.08)),
            **vector("point", "m", near(ground.p_1c, REACH_M, rng)),
        )

    def known(self) -> dict[str, float]:
        upper, lower = self.length_m, self.lower_length_m
        hanging = self.lower_share * self.mass_kg
        # Of small angles about the upright, and per acceleration of the pivot.
        inertia = np.array([[self.mass_kg * upper**2, hanging * upper * lower], [0.0, hanging * lower**2]])
        inertia[1, 0] = inertia[0, 1]
        driven = np.array([self.mass_kg * upper, hanging * lower])
        _, modes = eigh(
            np.diag(driven), inertia
        )  # of unit inertia, the slowest first; gravity scales its rates only
        return {"mass_kg": float((modes[:, 0] @ driven) ** 2)}

    def carried(self) -> Array:
        """The mass at its pivot."""
        at = self.xyz("point")
        about_1 = inertia_parameters(at @ at * np.eye(3) - np.outer(at, at))
        return self.mass_kg * np.concatenate([[1.0], at, about_1])

    def _edit(self, scene: TeamScene) -> TeamScene:
        lower = self.lower_share * self.mass_kg
        parent = scene.root.find("body", "omnid1/payload/payload")
        upper = self._swinging(parent, "upper", self.xyz("point"), self.mass_kg - lower, self.length_m)
        self._swinging(upper, "lower", np.array([0.0, 0.0, -self.length_m]), lower, self.lower_length_m)
        return scene

    def _swinging(self, parent, name: str, pos: np.ndarray, mass: float, length: float):
        body = parent.add("body", name=name, pos=pos)
        inertia = mass * length**2
        damping = 2.0 * self.damping_ratio * np.sqrt(omnid_design().gravity_mps2 / length) * inertia
        for axis, along in (("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0])):
            body.add("joint", name=f"{name}_{axis}", type="hinge", axis=along, damping=damping, group=3)
        body.add("inertial", pos=[0.0, 0.0, -length], mass=mass, diaginertia=[1e-6 * inertia] * 3)
        return body


@dataclass(frozen=True)
class UnequalPendulum(Form):
    """A tank that is longer than wide: it swings at one frequency along it and at another across."""

    answer = "slosh"
    size, size_is_known = "mass_kg", True
    on_payload = True
    ranges: ClassVar = {
        "mass_kg": (0.0, 100.0), "length_m": (0.01, 10.0), "ratio": (0.1, 1.0), "damping_ratio": (0.0, 10.0),
        "heading_rad": (-4.0, 4.0),
    }  # fmt: skip
    mass_kg: float
    length_m: float
    ratio: float
    damping_ratio: float
    heading_rad: float
    point_x_m: float
    point_y_m: float
    point_z_m: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        length = float(rng.uniform(0.15, 0.4))
        return cls(
            mass_kg=size * pendulum_limit_kg(length),
            length_m=length,
            ratio=float(rng.uniform(0.3, 0.6)),
            damping_ratio=float(rng.uniform(0.03, 0.08)),
            heading_rad=float(rng.uniform(-np.pi, np.pi)),
            **vector("point", "m", near(ground.p_1c, REACH_M, rng)),
        )

    def _edit(self, scene: TeamScene) -> TeamScene:
        half, short = 0.5 * self.heading_rad, self.ratio * self.length_m
        gravity = omnid_design().gravity_mps2
        body = scene.root.find("body", "omnid1/payload/payload").add(
            "body", name="tank", pos=self.xyz("point"),
            quat=[np.cos(half), 0.0, 0.0, np.sin(half)],
        )  # fmt: skip
        # About x it swings from the body's origin, about y from a point further down.
        drop = self.length_m - short
        for axis, along, pos, length in (
            ("x", [1.0, 0.0, 0.0], 0.0, self.length_m),
            ("y", [0.0, 1.0, 0.0], -drop, short),
        ):
            damping = 2.0 * self.damping_ratio * np.sqrt(gravity / length) * self.mass_kg * length**2
            body.add(
                "joint", name=f"tank_{axis}", type="hinge", axis=along, pos=[0.0, 0.0, pos], damping=damping, group=3
            )  # fmt: skip
        small = [1e-6 * self.mass_kg * self.length_m**2] * 3
        body.add("inertial", pos=[0.0, 0.0, -self.length_m], mass=self.mass_kg, diaginertia=small)
        return scene

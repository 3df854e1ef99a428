"""Forms at the payload that the catalogue lists with another law."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

from estimator.arrays import Array, inertia_parameters
from hidden import pendulum_limit_kg
from mocobot.campaign.effects import REACH_M
from mocobot_sim.effects.payload import add_site, tie
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.trial.actors import Actor, Stage
from sealed.form import Form, Ground, PayloadWrench, Place, PointForce, direction, near, vector

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


@dataclass(frozen=True)
class TurningDrag(Form):
    """Force -c v at the centre of mass, and moment -c r^2 omega."""

    answer = "drag"
    size, size_is_known = "coefficient_Ns_per_m", True
    on_payload = True
    ranges: ClassVar = {"coefficient_Ns_per_m": (0.0, 1e3), "reach_m": (0.0, 10.0)}
    draws: ClassVar = {"reach_m": (0.2, 0.6)}
    coefficient_Ns_per_m: float
    reach_m: float

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        c, turn = self.coefficient_Ns_per_m, self.coefficient_Ns_per_m * self.reach_m**2
        return [PayloadWrench(lambda t, p, v, w: (-c * v, -turn * w))]


@dataclass(frozen=True)
class QuadraticDrag(Form):
    """Force -c |v| v at the centre of mass, and moment -c r^3 |omega| omega."""

    answer = "drag"
    size = "coefficient_Ns2_per_m2"
    on_payload = True
    ranges: ClassVar = {"coefficient_Ns2_per_m2": (0.0, 1e4), "reach_m": (0.0, 10.0)}
    draws: ClassVar = {"reach_m": (0.1, 0.4)}
    coefficient_Ns2_per_m2: float
    reach_m: float

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        c, turn = self.coefficient_Ns2_per_m2, self.coefficient_Ns2_per_m2 * self.reach_m**3
        return [
            PayloadWrench(
                lambda t, p, v, w: (-c * float(np.sqrt(v @ v)) * v, -turn * float(np.sqrt(w @ w)) * w)
            )
        ]


@dataclass(frozen=True)
class PowerDrag(Form):
    """Force -c |v|^(n-1) v at the centre of mass, and moment -c r^(n+1) |omega|^(n-1) omega: between the two."""

    answer = "drag"
    size = "coefficient"
    on_payload = True
    ranges: ClassVar = {"coefficient": (0.0, 1e4), "exponent": (1.0, 2.0), "reach_m": (0.0, 10.0)}
    draws: ClassVar = {"exponent": (1.3, 1.7), "reach_m": (0.1, 0.4)}
    coefficient: float
    exponent: float
    reach_m: float

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        c, turn = self.coefficient, self.coefficient * self.reach_m ** (self.exponent + 1.0)

        def power(v: np.ndarray) -> np.ndarray:
            speed = float(np.sqrt(v @ v))
            return speed ** (self.exponent - 1.0) * v if speed else v

        return [PayloadWrench(lambda t, p, v, w: (-c * power(v), -turn * power(w)))]


@dataclass(frozen=True)
class MassDrift(Form):
    """It loses (or gains) mass all the time, from everywhere alike: sand that runs out, water that runs in."""

    answer = "payload_mass"
    size, either_sign, size_is_known = "rate_kgps", True, True
    on_payload = True
    ranges: ClassVar = {"rate_kgps": (-0.1, 0.1)}
    rate_kgps: float

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        return [_Mass(lambda time: self.rate_kgps * time)]


@dataclass(frozen=True)
class MassOfTrials(Form):
    """It is another one from some trial on: something was taken off or put on."""

    answer = "payload_mass"
    size = "more_kg"
    on_payload = True
    ranges: ClassVar = {"more_kg": (-10.0, 10.0)}
    trial: int
    more_kg: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        return cls(trial=int(rng.integers(2, 4)), more_kg=float(rng.choice([-1.0, 1.0]) * size))

    def known(self) -> dict[str, float]:
        return {"trial": self.trial, "last_trial": 0, "mass_kg": self.more_kg}

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        changed = trial_number is not None and trial_number >= self.trial
        return [_Mass(lambda time: self.more_kg)] if changed else []


class _Mass:
    """Changes the payload's mass, and its inertia in proportion."""

    def __init__(self, more) -> None:
        self._more = more

    def start(self, stage: Stage) -> None:
        self._model, self._body, self._dt = stage.model, stage.index.payload_body, 1.0 / stage.rate_hz
        self._mass = float(self._model.body_mass[self._body])
        self._inertia = self._model.body_inertia[self._body].copy()

    def act(self, tick: int) -> None:
        ratio = 1.0 + self._more(tick * self._dt) / self._mass
        self._model.body_mass[self._body] = ratio * self._mass
        self._model.body_inertia[self._body] = ratio * self._inertia


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
        # For small angles about the upright, and per acceleration of the pivot.
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


@dataclass(frozen=True)
class _ShapedPush(Form):
    """A force during an interval of one trial; ``peak_*`` in robot 1's {b}, the point in {1}."""

    answer = "push"
    size = "peak_N"
    on_payload = True
    repeats = True
    ranges: ClassVar = {
        "start_s": (0.0, 1e9),
        "duration_s": (0.05, 1e9),
        "peak_N": (0.0, 1e3),
        "rise": (0.0, 0.5),
    }
    trial: int
    start_s: float
    duration_s: float
    rise: float
    peak_N: float
    along_x_m: float
    along_y_m: float
    along_z_m: float
    point_x_m: float
    point_y_m: float
    point_z_m: float

    @classmethod
    def drawn(
        cls, size: float, ground: Ground, place: Place, rng: np.random.Generator, trial: int | None = None
    ) -> Form:
        chosen = [at for at in ground.moving if trial in (None, at[0])]
        number, begin, end = chosen[rng.integers(len(chosen))]
        duration = float(rng.uniform(0.8, 3.0))
        return cls(
            trial=number,
            start_s=float(rng.uniform(begin, end - duration)),
            duration_s=duration,
            rise=float(rng.uniform(0.2, 0.5)),
            peak_N=float(size / np.sqrt(duration)),
            **vector("along", "m", direction(rng)),
            **vector("point", "m", near(ground.p_1c, REACH_M, rng)),
        )

    @abstractmethod
    def shape(self, share: float) -> float:
        """Force over its peak, at a share of the duration."""

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        if trial_number not in (None, self.trial):
            return []
        peak = self.peak_N * self.xyz("along")
        none = np.zeros(3)

        def force(time: float) -> np.ndarray:
            share = (time - self.start_s) / self.duration_s
            return peak * self.shape(share) if 0.0 <= share <= 1.0 else none

        return [PointForce(force, self.xyz("point"))]


@dataclass(frozen=True)
class RampPush(_ShapedPush):
    """It rises and falls in straight lines, each during a share ``rise`` of the duration."""

    def shape(self, share: float) -> float:
        return min(1.0, share / self.rise, (1.0 - share) / self.rise)


@dataclass(frozen=True)
class HalfSinePush(_ShapedPush):
    """Half a sine."""

    def shape(self, share: float) -> float:
        return math.sin(np.pi * share)


def in_every_trial(kind: type[Form], size: float, ground: Ground, rng: np.random.Generator) -> list[Form]:
    """One push in each trial that moves."""
    assert issubclass(kind, _ShapedPush)
    return [kind.drawn(size, ground, {}, rng, trial=number) for number, _, _ in ground.moving]

"""What an effect of another form is made of: numbers of the team, places, laws with a memory, torques and wrenches."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import mujoco
import numpy as np
from scipy.signal import cont2discrete

from mocobot.campaign.effects import moving_intervals
from mocobot_sim.effects.base import Effect
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.scene.team_index import TeamIndex
from mocobot_sim.trial.actors import Actor, Reader, Stage
from mocobot_sim.trial.assemble import assemble_at_home
from mocobot_sim.trial.trajectories import Trajectory
from mocobot_sim.trial.truth import GroundTruth


@dataclass(frozen=True)
class Ground:
    """A team without effects, and what it does.

    Attributes:
        robots: number of robots N.
        p_1c: centre of mass in {1} [m], shape (3,).
        moving: trial number, begin and end of motion [s] of every trial that moves.
        torque_Nm: load of every spring at home [N m], shape (N, 3).
    """

    robots: int
    p_1c: np.ndarray
    moving: list[tuple[int, float, float]]
    torque_Nm: np.ndarray

    @classmethod
    def of(cls, scene: TeamScene, trajectories: Sequence[Trajectory]) -> Ground:
        """From a team and the commands of its trials."""
        model = scene.compile()
        torque = assemble_at_home(scene, model, mujoco.MjData(model), TeamIndex.of(model))
        moving = moving_intervals(trajectories)
        return cls(scene.robots, GroundTruth.of(scene).p_1c, moving, torque)


Place = dict[str, int]


@dataclass(frozen=True)
class Form(Effect):
    """An effect of the sealed campaign.

    Attributes:
        answer: the cause of the diagnosis' catalogue that is right; None for a law that nobody has listed.
        size: the parameter that makes it larger; its trace is proportional to it as long as it is small.
        either_sign: whether it is drawn with either sign.
        size_is_known: whether the answer has this parameter, too, by the same name and of the same value.
        draws: parameters besides place and size that are drawn evenly, and between what.
        of: of a law that nobody has listed, what is wrong there.
        formula: of such a law its variables, its formula with the parameters in braces, and its unit.
    """

    answer: ClassVar[str | None] = None
    size: ClassVar[str]
    either_sign: ClassVar[bool] = False
    size_is_known: ClassVar[bool] = False
    draws: ClassVar[dict[str, tuple[float, float]]] = {}
    of: ClassVar[str] = ""
    formula: ClassVar[tuple[list[str], str, str] | None] = None

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        """One of a size, everything else at random."""
        value = float(rng.choice([-1.0, 1.0]) * size) if cls.either_sign else size
        return cls(**place, **{cls.size: value}, **cls.others(ground, place, rng))

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        """Parameters besides place and size, drawn."""
        return {name: float(rng.uniform(*between)) for name, between in cls.draws.items()}

    def known(self) -> dict[str, float]:
        """Parameters of the answer whose true value the form has, by the catalogue's names."""
        return {self.size: getattr(self, self.size)} if self.size_is_known else {}

    def law(self) -> dict[str, Any] | None:
        """What nobody has listed: ``place``, ``of`` (what is wrong there), ``variables``, ``formula``, ``amplitude``,
        ``unit``, and ``along`` where there is a direction; None for a form of a listed cause."""
        if self.formula is None:
            return None
        variables, formula, unit = self.formula
        place = {name: getattr(self, name) for name in self.place_names()}
        along = self.along()
        law = {"place": place, "of": self.of} | ({} if along is None else {"along": along})
        law |= {"variables": variables, "formula": formula.format(**vars(self))}
        return law | {"amplitude": getattr(self, self.size), "unit": unit}

    def along(self) -> list[float] | None:
        """Direction of an unlisted law that has one."""
        return None

    def xyz(self, name: str) -> np.ndarray:
        """Three parameters that are a vector [m], shape (3,)."""
        return np.array([getattr(self, f"{name}_{axis}_m") for axis in "xyz"])

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        """Who acts in a trial."""
        return ()

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """Sensors that misread in it."""
        return ()

    def _edit(self, scene: TeamScene) -> TeamScene:
        return scene


def direction(rng: np.random.Generator) -> np.ndarray:
    """A unit vector, shape (3,)."""
    draw = rng.standard_normal(3)
    return draw / np.linalg.norm(draw)


def near(point: np.ndarray, reach_m: float, rng: np.random.Generator) -> np.ndarray:
    """A point within a ball [m], shape (3,)."""
    return point + reach_m * np.cbrt(rng.uniform()) * direction(rng)


def vector(name: str, unit: str, values: np.ndarray) -> dict[str, float]:
    """Three parameters of a vector."""
    return {f"{name}_{axis}_{unit}": float(value) for axis, value in zip("xyz", values, strict=True)}


class Lugre:
    """Bristles that bend: z' = v - sigma_0 |v| z / g(v), torque sigma_0 z + sigma_1 z' + sigma_2 v.

    g(v) = F_c + (F_s - F_c) exp(-(v / v_s)^2). Canudas de Wit, Olsson, Astrom, Lischinsky, "A new model for control of
    systems with friction", IEEE TAC 1995.

    Args:
        coulomb: F_c [N m].
        static: F_s [N m], at least F_c.
        stribeck_rate: v_s [rad/s].
        bristle: sigma_0 [N m/rad].
        bristle_damping: sigma_1 [N m s/rad].
        viscous: sigma_2 [N m s/rad].
    """

    def __init__(
        self, coulomb: float, static: float, stribeck_rate: float, bristle: float, bristle_damping: float,
        viscous: float,
    ) -> None:  # fmt: skip
        self.coulomb, self.static, self.stribeck_rate = coulomb, static, stribeck_rate
        self.bristle, self.bristle_damping, self.viscous = bristle, bristle_damping, viscous
        self.z = 0.0

    def steady(self, rate: float) -> float:
        """Torque after a long time at one rate, against the motion [N m]."""
        return math.copysign(self._level(rate), rate) + self.viscous * rate

    def step(self, rate: float, dt: float) -> float:
        """Torque against the motion at the end of a step [N m]."""
        if rate:
            end = math.copysign(self._level(rate) / self.bristle, rate)
            self.z = end + (self.z - end) * math.exp(-self.bristle * abs(rate) * dt / self._level(rate))
        bending = rate - self.bristle * abs(rate) * self.z / self._level(rate)
        return self.bristle * self.z + self.bristle_damping * bending + self.viscous * rate

    def _level(self, rate: float) -> float:
        return self.coulomb + (self.static - self.coulomb) * math.exp(-((rate / self.stribeck_rate) ** 2))


class Dahl:
    """Torque that follows the way: dF/dx = sigma (1 - F / F_c sign v). Dahl, "A solid friction model", 1968.

    Args:
        coulomb: F_c [N m].
        stiffness: sigma [N m/rad].
        viscous: added to it [N m s/rad].
    """

    def __init__(self, coulomb: float, stiffness: float, viscous: float) -> None:
        self.coulomb, self.stiffness, self.viscous = coulomb, stiffness, viscous
        self.force = 0.0

    def step(self, rate: float, dt: float) -> float:
        """Torque against the motion at the end of a step [N m]."""
        if rate:
            end = math.copysign(self.coulomb, rate)
            self.force = end + (self.force - end) * math.exp(-self.stiffness * abs(rate) * dt / self.coulomb)
        return self.force + self.viscous * rate


SUBSTEPS = 4


class BoucWen:
    """z' = v / d (1 - |z|^n (beta sign(v z) + 1 - beta)), |z| <= 1, torque F z.

    Wen, "Method for random vibration of hysteretic systems", J. Eng. Mech. 1976, normalised as in Ismail, Ikhouane,
    Rodellar, "The hysteresis Bouc-Wen model, a survey", 2009. With beta = 1/2 and n = 1 unloading is straight.

    Args:
        force: F [N m].
        yield_rad: d [rad].
        beta: shape of unloading, 1/2 to 1.
        exponent: n, at least 1.
    """

    def __init__(self, force: float, yield_rad: float, beta: float, exponent: float) -> None:
        self.force, self.yield_rad, self.beta, self.exponent = force, yield_rad, beta, exponent
        self.z = 0.0

    def step(self, rate: float, dt: float) -> float:
        """Torque along the motion's resistance at the end of a step [N m]."""
        way = rate * dt / (SUBSTEPS * self.yield_rad)
        for _ in range(SUBSTEPS):  # midpoint rule
            middle = self.z + 0.5 * way * self._slope(way, self.z)
            self.z = min(max(self.z + way * self._slope(way, middle), -1.0), 1.0)
        return self.force * self.z

    def _slope(self, way: float, z: float) -> float:
        loading = self.beta * (math.copysign(1.0, way * z) if way * z else 0.0) + 1.0 - self.beta
        return 1.0 - abs(z) ** self.exponent * loading


class Play:
    """Follows its input once that has crossed a gap of twice ``half_width``."""

    def __init__(self, half_width: float) -> None:
        self.half_width = half_width
        self.at: float | None = None

    def step(self, value: float) -> float:
        """What has followed."""
        at = value if self.at is None else self.at
        self.at = min(max(at, value - self.half_width), value + self.half_width)
        return self.at


class SecondOrderLag:
    """y'' + 2 zeta omega y' + omega^2 y = omega^2 u, exact for inputs that are straight between steps.

    Slow signals come late by 2 zeta / omega.

    Args:
        frequency_hz: omega / 2 pi.
        damping_ratio: zeta.
        dt: step [s].
    """

    def __init__(self, frequency_hz: float, damping_ratio: float, dt: float) -> None:
        omega = 2.0 * np.pi * frequency_hz
        A = np.array([[0.0, 1.0], [-(omega**2), -2.0 * damping_ratio * omega]])
        system = (A, np.array([[0.0], [omega**2]]), np.array([[1.0, 0.0]]), np.zeros((1, 1)))
        a, b, c, d, _ = cont2discrete(system, dt, method="foh")
        (self._a, self._b), (self._c, self._d) = a.tolist()
        self._e, self._f = b.ravel().tolist()
        self._g, self._h = c.ravel().tolist()
        self._direct = float(d[0, 0])
        # At rest: x = A x + B u, y = C x + D u = u.
        self._rest = np.linalg.solve(np.eye(2) - a, b).ravel().tolist()
        self._x: tuple[float, float] | None = None

    def step(self, value: float) -> float:
        """What comes out; it starts at rest."""
        x, y = (self._rest[0] * value, self._rest[1] * value) if self._x is None else self._x
        out = self._g * x + self._h * y + self._direct * value
        self._x = (
            self._a * x + self._b * y + self._e * value,
            self._c * x + self._d * y + self._f * value,
        )
        return out


Kind = Literal["driven", "spring", "gimbal"]
Torque = Callable[[float, float, float, float], float]
"""Torque on a joint [N m] at an angle [rad], a rate [rad/s] and a time [s], after a step [s]."""
Wrench = Callable[[float, np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Force [N] and moment about the centre of mass [N m] in the world, from the time [s], the centre of mass [m], its
velocity [m/s] and the angular velocity [rad/s]."""


class JointTorque:
    """A torque in one joint: past the spring of a driven one, inside a spring, or of a gimbal axis.

    Args:
        kind, robot, joint: where; robot and joint from 1.
        torque: what it is.
    """

    def __init__(self, kind: Kind, robot: int, joint: int, torque: Torque) -> None:
        self._kind, self._at, self._torque = kind, (robot - 1, joint - 1), torque

    def start(self, stage: Stage) -> None:
        """Find the joint."""
        index, at = stage.index, self._at
        positions = {
            "driven": (index.motor_qpos[at], index.spring_qpos[at]),
            "spring": (index.spring_qpos[at],),
            "gimbal": (index.gimbal_qpos[at],),
        }[self._kind]
        dofs = {
            "driven": (index.motor_dof[at], index.spring_dof[at]),
            "spring": (index.spring_dof[at],),
            "gimbal": (index.gimbal_dof[at],),
        }[self._kind]
        self._positions, self._dofs = [int(k) for k in positions], [int(k) for k in dofs]
        self._data, self._dt = stage.data, 1.0 / stage.rate_hz

    def act(self, tick: int) -> None:
        """Add the torque, the same in both parts of a driven joint."""
        data = self._data
        angle = sum(float(data.qpos[k]) for k in self._positions)
        rate = sum(float(data.qvel[k]) for k in self._dofs)
        torque = self._torque(angle, rate, tick * self._dt, self._dt)
        for k in self._dofs:
            data.qfrc_applied[k] += torque


class PayloadWrench:
    """A wrench on the payload."""

    def __init__(self, wrench: Wrench) -> None:
        self._wrench = wrench

    def start(self, stage: Stage) -> None:
        """Find the payload."""
        self._data, self._model = stage.data, stage.model
        self._body, self._dt = stage.index.payload_body, 1.0 / stage.rate_hz
        self._J = np.zeros((6, stage.model.nv))

    def act(self, tick: int) -> None:
        """Add the wrench; the payload's pose is that of the step before, its rates are those of this instant.

        A position moves on by the rate that it has after a step, so that of an instant is half a step ahead. Rates of
        the step before would be 1.5 ms late: of 37 N s/m an inertia of -0.055 kg that has no weight.
        """
        data, body = self._data, self._body
        mujoco.mj_jacBodyCom(self._model, data, self._J[:3], self._J[3:], body)
        rates = self._J @ (data.qvel + 0.5 * self._model.opt.timestep * data.qacc)
        force, moment = self._wrench(tick * self._dt, data.xipos[body], rates[:3], rates[3:])
        data.xfrc_applied[body, :3] += force
        data.xfrc_applied[body, 3:] += moment


class PointForce:
    """A force on a point that is fixed to the payload.

    Args:
        force: at a time [s], in the axes of robot 1's {b} [N], shape (3,).
        point: in {1} [m], shape (3,).
    """

    def __init__(self, force: Callable[[float], np.ndarray], point: np.ndarray) -> None:
        self._force, self._point = force, point

    def start(self, stage: Stage) -> None:
        """Find the payload, and where robot 1 stands."""
        mount = stage.model.body_parentid[stage.model.body("omnid1/chassis").id]
        self._R = stage.data.xmat[mount].reshape(3, 3).copy()
        self._data, self._body, self._dt = stage.data, stage.index.payload_body, 1.0 / stage.rate_hz

    def act(self, tick: int) -> None:
        """Add it."""
        force = self._force(tick * self._dt)
        if force.any():
            data, body = self._data, self._body
            force = self._R @ force
            arm = data.xpos[body] + data.xmat[body].reshape(3, 3) @ self._point - data.xipos[body]
            data.xfrc_applied[body, :3] += force
            data.xfrc_applied[body, 3:] += _cross(arm, force)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """np.cross is slow for one pair."""
    (x, y, z), (u, v, w) = a, b
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])

"""Effects on joints, readings and payload."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from independent.bodies import AsBuilt, Payload
from independent.numerics import FINE_HZ, Array, bristles, derivative, lagged, parallel_dahl, turned


@dataclass(frozen=True, eq=False)
class Scene:
    """One trial as the effects see it; W axes, on the fine grid.

    Attributes:
        trial: number, from 1.
        time: 0 where the recording starts [s], shape (Q,).
        payload: the rigid body.
        R_W1, p_W1: its pose, shapes (Q, 3, 3) and (Q, 3).
        velocity, acceleration: of its centre of mass, shape (Q, 3).
        omega, alpha: its angular velocity and acceleration, shape (Q, 3).
        R_Wb, p_Wb: level frames {b} of the robots, shapes (N, 3, 3) and (N, 3).
        gravity: shape (3,).
    """

    trial: int
    time: Array
    payload: Payload
    R_W1: Array
    p_W1: Array
    velocity: Array
    acceleration: Array
    omega: Array
    alpha: Array
    R_Wb: Array
    p_Wb: Array
    gravity: Array

    def place(self, point: Array) -> Array:
        """A point of {1} in W [m], shape (Q, 3)."""
        return self.p_W1 + turned(self.R_W1, point)

    def motion(self, point: Array) -> tuple[Array, Array]:
        """Velocity and acceleration of a point of {1} in W, shape (Q, 3) each."""
        arm = turned(self.R_W1, point - self.payload.p_1c)
        turning = np.cross(self.omega, arm)
        return self.velocity + turning, (
            self.acceleration + np.cross(self.alpha, arm) + np.cross(self.omega, turning)
        )

    def at(self, point: Array, force: Array) -> tuple[Array, Array]:
        """A force at a point of {1} as force and moment about the centre of mass, W axes."""
        return force, np.cross(turned(self.R_W1, point - self.payload.p_1c), force)


class Effect:
    """Something hidden. Subclasses override what they act on; nothing else happens."""

    def build(self, robots: AsBuilt) -> None:
        """Change numbers of the robots in place."""

    def wrench(self, scene: Scene) -> tuple[Array, Array] | None:
        """Force and moment about the centre of mass that act on the payload, W axes [N, N m], shape (Q, 3) each."""
        return None

    def driven_torque(self, phi: Array) -> tuple[int, int, Array] | None:
        """Robot, joint (from 0) and torque that resists there [N m], shape (Q,), of phi (Q, N, 3)."""
        return None

    def gimbal_torque(self, theta: Array) -> tuple[int, int, Array] | None:
        """The same about a gimbal axis, of theta (Q, N, 3)."""
        return None

    def grasp_shift(self, robot: int, force: Array) -> Array | float:
        """How far the wrist of a robot (from 0) is from its grasp, axes of {i} [m], of its force there (Q, 3)."""
        return 0.0

    def spring(self, torque: Array, stiffness: float) -> tuple[int, int, Array] | None:
        """Robot, joint and what the spring's reading is for torques (Q, N, 3) [N m], shape (Q,)."""
        return None

    def sensed(self, torque: Array) -> tuple[int, Array] | None:
        """Robot and its torque readings (Q, 3) behind a sensor's dynamics, of readings (Q, N, 3)."""
        return None


@dataclass(frozen=True)
class Hidden:
    """An effect and how it is told.

    Attributes:
        name: as asked for.
        cause: of the catalogue.
        other_form: whether its law is not the catalogue's.
        effect: what acts.
        robot, joint: place, from 1, or None.
        known: true values of the cause's parameters.
        parameters: everything else that was drawn.
    """

    name: str
    cause: str
    other_form: bool
    effect: Effect
    robot: int | None
    joint: int | None
    known: dict[str, Any]
    parameters: dict[str, Any]

    def to_dict(self, size: float) -> dict[str, Any]:
        """As the truth of a set tells it."""
        answer = {"cause": self.cause, "robot": self.robot, "joint": self.joint, "known": self.known}
        return {
            "cause": self.name, "form": self.other_form, "answer": answer, "law": None,
            "parameters": self.known | self.parameters, "size": size,
        }  # fmt: skip


@dataclass(frozen=True)
class Numbers(Effect):
    """Numbers of ``AsBuilt`` that are set: what is drawn at random at that place is replaced, so the truth is exact.

    Attributes:
        values: by quantity, robot and place (from 0).
    """

    values: dict[tuple[str, int, int], float]

    def build(self, robots: AsBuilt) -> None:
        """Set them."""
        for (quantity, robot, place), value in self.values.items():
            robots[quantity][robot, place] = value


@dataclass(frozen=True)
class Friction(Effect):
    """Friction in a driven joint or about a gimbal axis.

    Attributes:
        robot, joint: place, from 0.
        coulomb_Nm: level while sliding fast.
        law: ``tanh`` of the speed over ``scale``; ``dahl`` with the presliding ``scale``; ``stribeck``: LuGre, whose
            level is higher by ``extra`` at rest and falls within 0.02 rad/s.
        scale: [rad/s] or [rad].
        extra: of the level at rest over the one while sliding.
        gimbal: which of the two joints.
    """

    robot: int
    joint: int
    coulomb_Nm: float
    law: str
    scale: float
    extra: float = 0.0
    gimbal: bool = False

    def driven_torque(self, phi: Array) -> tuple[int, int, Array] | None:
        """Friction of the driven joint."""
        return None if self.gimbal else (self.robot, self.joint, self.of(phi[:, self.robot, self.joint]))

    def gimbal_torque(self, theta: Array) -> tuple[int, int, Array] | None:
        """Friction of the gimbal axis."""
        return (self.robot, self.joint, self.of(theta[:, self.robot, self.joint])) if self.gimbal else None

    def of(self, angle: Array) -> Array:
        """Torque that resists [N m], of an angle on the fine grid, shape (Q,)."""
        rate = derivative(angle)
        if self.law == "tanh":
            return self.coulomb_Nm * np.tanh(rate / self.scale)
        level = self.coulomb_Nm * (1 + self.extra * np.exp(-((rate / 0.02) ** 2)))
        return bristles(angle, level, self.scale)


@dataclass(frozen=True)
class ProgressiveSpring(Effect):
    """A spring whose stiffness grows in proportion to its deflection: k d (1 + a |d|).

    Attributes:
        robot, joint: place, from 0.
        per_rad: a [1/rad].
    """

    robot: int
    joint: int
    per_rad: float

    def spring(self, torque: Array, stiffness: float) -> tuple[int, int, Array] | None:
        """Design stiffness times the deflection at the torque."""
        x = torque[:, self.robot, self.joint]
        # a d^2 + d - |torque| / k = 0, written so that it does not cancel.
        d = 2 * np.abs(x) / stiffness / (1 + np.sqrt(1 + 4 * self.per_rad * np.abs(x) / stiffness))
        return self.robot, self.joint, np.sign(x) * d * stiffness


@dataclass(frozen=True)
class DahlSpring(Effect):
    """A slider of Dahl's kind beside a spring: hysteresis with rounded corners.

    Attributes:
        robot, joint: place, from 0.
        friction_Nm: largest torque of the slider.
        width_Nm: change of the reading over which it builds up.
    """

    robot: int
    joint: int
    friction_Nm: float
    width_Nm: float

    def spring(self, torque: Array, stiffness: float) -> tuple[int, int, Array] | None:
        """The spring's own part of the torque."""
        read = parallel_dahl(torque[:, self.robot, self.joint], self.friction_Nm, self.width_Nm)
        return self.robot, self.joint, read


@dataclass(frozen=True)
class SecondOrderLag(Effect):
    """Torque sensors of one robot behind a critically damped filter, as late at low frequency as ``time_constant_s``.

    Attributes:
        robot: from 0.
        time_constant_s: sum of both poles' [s].
    """

    robot: int
    time_constant_s: float

    def sensed(self, torque: Array) -> tuple[int, Array] | None:
        """Two lags of half the time each."""
        half = self.time_constant_s / 2
        return self.robot, lagged(lagged(torque[:, self.robot], half), half)


@dataclass(frozen=True)
class RelaxingGrasp(Effect):
    """A grasp that follows its force with a first-order lag.

    Attributes:
        robot: from 0.
        compliance_m_per_N: once settled, along each axis of {i}.
        relaxation_s: time constant; 0: at once.
    """

    robot: int
    compliance_m_per_N: tuple[float, float, float]
    relaxation_s: float = 0.0

    def grasp_shift(self, robot: int, force: Array) -> Array | float:
        """Compliance times the force that has been there for a while."""
        if robot != self.robot:
            return 0.0
        return np.asarray(self.compliance_m_per_N) * lagged(force, self.relaxation_s)


@dataclass(frozen=True)
class Wander(Effect):
    """Torque zero that drifts slowly instead of standing still: half of it comes within some seconds of each trial.

    Attributes:
        robot, joint: place, from 0.
        bias_Nm: where it settles.
        settling_s: time constant.
    """

    robot: int
    joint: int
    bias_Nm: float
    settling_s: float

    def sensed(self, torque: Array) -> tuple[int, Array] | None:
        """The readings with the zero's drift."""
        out = torque[:, self.robot].copy()
        elapsed = np.arange(len(out)) / FINE_HZ
        out[:, self.joint] += self.bias_Nm * (1 - 0.5 * np.exp(-elapsed / self.settling_s))
        return self.robot, out


@dataclass(frozen=True)
class Tether(Effect):
    """A spring or a cable from a point of the payload to a point fixed in a robot's level {b}.

    Attributes:
        base: robot whose {b} holds the anchor, from 0.
        point: of {1} [m]; None: that robot's grasp.
        anchor: in {b} [m].
        stiffness_N_per_m: of what is longer than ``length_m``.
        length_m: below it a cable is slack; 0: a spring.
    """

    base: int
    point: tuple[float, float, float] | None
    anchor: tuple[float, float, float]
    stiffness_N_per_m: float
    length_m: float = 0.0

    def wrench(self, scene: Scene) -> tuple[Array, Array]:
        """Toward the anchor."""
        point = scene.payload.p_1i[self.base] if self.point is None else np.asarray(self.point)
        fixed = scene.p_Wb[self.base] + scene.R_Wb[self.base] @ np.asarray(self.anchor)
        way = fixed - scene.place(point)
        length = np.linalg.norm(way, axis=1, keepdims=True)
        share = np.maximum(1 - self.length_m / np.maximum(length, 1e-9), 0.0) if self.length_m else 1.0
        return scene.at(point, self.stiffness_N_per_m * share * way)


@dataclass(frozen=True)
class Push(Effect):
    """Someone pushes in one trial.

    Attributes:
        trial: number, from 1.
        start_s, duration_s: when [s].
        force: in robot 1's {b} [N].
        point: of {1} [m].
        shape: ``square``, ``half_sine`` or ``trapezoid``, whose ramps take a quarter each.
    """

    trial: int
    start_s: float
    duration_s: float
    force: tuple[float, float, float]
    point: tuple[float, float, float]
    shape: str = "square"

    def wrench(self, scene: Scene) -> tuple[Array, Array] | None:
        """The push over time."""
        if scene.trial != self.trial:
            return None
        x = (scene.time - self.start_s) / self.duration_s
        inside = (x >= 0) & (x <= 1)
        profile = {
            "square": 1.0,
            "half_sine": np.sin(np.pi * x),
            "trapezoid": np.clip(4 * np.minimum(x, 1 - x), 0, 1),
        }[self.shape]
        force = np.outer(np.where(inside, profile, 0.0), scene.R_Wb[0] @ np.asarray(self.force))
        return scene.at(np.asarray(self.point), force)


@dataclass(frozen=True)
class Drag(Effect):
    """Resistance to the payload's motion.

    Attributes:
        linear: at the centre of mass [N s/m].
        turning: against its rotation [N m s].
        quadratic: with the square of the speed [N s^2/m^2].
    """

    linear: float
    turning: float = 0.0
    quadratic: float = 0.0

    def wrench(self, scene: Scene) -> tuple[Array, Array]:
        """Against velocity and angular velocity."""
        speed = np.linalg.norm(scene.velocity, axis=1, keepdims=True)
        force = -(self.linear + self.quadratic * speed) * scene.velocity
        return force, -self.turning * scene.omega


@dataclass(frozen=True)
class AddedMass(Effect):
    """A point mass at the payload, in some trials, growing, or leaking.

    Attributes:
        point: of {1} [m].
        mass_kg: at the start of trials ``first`` to ``last``.
        rate_kgps: growth from the start of each of these trials; what leaks leaves at the payload's own speed.
        first, last: trials, from 1.
        settling_s: time constant after which the growth has stopped; 0: it never stops.
    """

    point: tuple[float, float, float]
    mass_kg: float = 0.0
    rate_kgps: float = 0.0
    first: int = 1
    last: int = 99
    settling_s: float = 0.0

    def wrench(self, scene: Scene) -> tuple[Array, Array] | None:
        """Weight and inertia of the mass, on the payload."""
        if not self.first <= scene.trial <= self.last:
            return None
        elapsed = np.maximum(scene.time, 0.0)
        if self.settling_s:
            elapsed = self.settling_s * (1 - np.exp(-elapsed / self.settling_s))
        mass = self.mass_kg + self.rate_kgps * elapsed
        _, acceleration = scene.motion(np.asarray(self.point))
        return scene.at(np.asarray(self.point), mass[:, None] * (scene.gravity - acceleration))


@dataclass(frozen=True)
class Pendulum(Effect):
    """A spherical pendulum under a point of the payload, full swing, damped against the payload.

    Attributes:
        point: where it hangs, of {1} [m].
        mass_kg: of the bob, on top of the payload's mass.
        length_m: of the massless rod.
        damping_ratio: of small swings.
    """

    point: tuple[float, float, float]
    mass_kg: float
    length_m: float
    damping_ratio: float

    def wrench(self, scene: Scene) -> tuple[Array, Array]:
        """What the rod's pull and the hinge's damping put on the payload, by the bob's own equation of motion."""
        pivot = np.asarray(self.point)
        _, acceleration = scene.motion(pivot)
        felt = scene.gravity - acceleration
        n, n_dot, n_two_dots = self.swing(felt, scene)
        # The rod passes on the force that moves the bob, and the damper's moment.
        bob = self.mass_kg * (felt - self.length_m * n_two_dots)
        force, moment = scene.at(pivot, bob)
        relative = n_dot - np.cross(scene.omega, n)
        damper = self.mass_kg * self.length_m**2 * self.damping_rate * np.cross(n, relative)
        return force, moment + damper

    @property
    def damping_rate(self) -> float:
        """Damping over inertia [1/s]."""
        return 2 * self.damping_ratio * float(np.sqrt(9.81 / self.length_m))

    def swing(self, felt: Array, scene: Scene) -> tuple[Array, Array, Array]:
        """Direction of the rod and its two derivatives in W, shape (Q, 3) each; Runge-Kutta over pairs of samples.

        Args:
            felt: gravity less the pivot's acceleration in W [m/s^2], shape (Q, 3).
            scene: the trial.
        """
        step = 2 * float(scene.time[1] - scene.time[0])
        state = np.concatenate([[0.0, 0.0, -1.0], np.zeros(3)])
        states, given = [state], list(zip(felt, scene.omega, strict=True))
        for k in range(0, len(felt) - 2, 2):
            a = self.rate_of(state, *given[k])
            b = self.rate_of(state + step / 2 * a, *given[k + 1])
            c = self.rate_of(state + step / 2 * b, *given[k + 1])
            d = self.rate_of(state + step * c, *given[k + 2])
            state = state + step / 6 * (a + 2 * b + 2 * c + d)
            state[:3] /= np.sqrt(state[:3] @ state[:3])
            state[3:] -= (state[:3] @ state[3:]) * state[:3]
            states.append(state)
        coarse = scene.time[::2][: len(states)]
        at = np.asarray(CubicSpline(coarse, np.array(states))(np.minimum(scene.time, coarse[-1])))
        rates = np.array([self.rate_of(x, *g) for x, g in zip(at, given, strict=True)])
        return at[:, :3], at[:, 3:], rates[:, 3:]

    def rate_of(self, state: Array, felt: Array, omega: Array) -> Array:
        """Time derivative of direction and its rate, shape (6,)."""
        nx, ny, nz, vx, vy, vz = state.tolist()
        fx, fy, fz = felt.tolist()
        ox, oy, oz = omega.tolist()
        damp = self.damping_rate
        # Acceleration across the rod, and the pull toward the pivot that keeps its length.
        ax = fx / self.length_m - damp * (vx - (oy * nz - oz * ny))
        ay = fy / self.length_m - damp * (vy - (oz * nx - ox * nz))
        az = fz / self.length_m - damp * (vz - (ox * ny - oy * nx))
        along = ax * nx + ay * ny + az * nz + vx * vx + vy * vy + vz * vz
        return np.array([vx, vy, vz, ax - along * nx, ay - along * ny, az - along * nz])

"""What pulls at the payload or hangs from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from independent.effects.effect import Effect, Scene
from independent.numerics import Array


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

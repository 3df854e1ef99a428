"""Friction with a state: LuGre and Dahl, each step exact for a rate that is constant during it."""

from __future__ import annotations

import math


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

"""Hysteresis operators: Bouc-Wen, and play."""

from __future__ import annotations

import math

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

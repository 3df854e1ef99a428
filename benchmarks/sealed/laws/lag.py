"""A lag of second order."""

from __future__ import annotations

import numpy as np
from scipy.signal import cont2discrete


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

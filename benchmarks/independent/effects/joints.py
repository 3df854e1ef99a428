"""Other forms of friction, springs and sensors in single joints than the catalogue's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from independent.effects.effect import Effect
from independent.numerics import FINE_HZ, Array, bristles, derivative, lagged, parallel_dahl


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
        """Of the driven joint."""
        return None if self.gimbal else (self.robot, self.joint, self.of(phi[:, self.robot, self.joint]))

    def gimbal_torque(self, theta: Array) -> tuple[int, int, Array] | None:
        """Of the gimbal axis."""
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

"""What MJCF cannot say of a joint: torques by the state, one joint at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from estimator.arrays import Array
from mocobot_sim.serial.state import direction


@dataclass(frozen=True)
class RobotEffect:
    """One effect.

    Attributes:
        cause: such as ``stribeck``.
        joint: which joint, from 1; None of the whole robot.
        partner: the other joint of a coupled drive.
        parameters: numbers, by name with the unit as suffix.
    """

    cause: str
    joint: int | None
    partner: int | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)

    def number(self, stem: str) -> float:
        """The number whose name begins so, whatever its unit.

        Raises:
            KeyError: there is none, or more than one.
        """
        (name,) = (n for n in self.parameters if n == stem or n.startswith(f"{stem}_"))
        return float(self.parameters[name])


def resistance(effect: RobotEffect, q: float, v: float, load: float) -> float:
    """Torque that an effect takes from its joint's drive, beyond what the model does [N m or N].

    Args:
        effect: one that is a function of its own joint's state.
        q: joint position [rad or m].
        v: speed.
        load: torque that the gear passes on.

    Raises:
        KeyError: the effect is none of these.
    """
    return LAWS[effect.cause](effect, q, v, load)


def resistances(effects: list[RobotEffect], q: Array, v: Array, load: Array) -> Array:
    """The same of all effects, at all joints, shape (J,)."""
    out = np.zeros(len(q))
    for effect in effects:
        if effect.cause in LAWS and effect.joint is not None:
            j = effect.joint - 1
            out[j] += resistance(effect, float(q[j]), float(v[j]), float(load[j]))
    return out


def _friction(e: RobotEffect, q: float, v: float, load: float) -> float:
    return e.number("coulomb") * direction(v) + e.number("viscous") * v


def _asymmetric_coulomb(e: RobotEffect, q: float, v: float, load: float) -> float:
    return e.number("asymmetry") * abs(direction(v))


def _asymmetric_viscous(e: RobotEffect, q: float, v: float, load: float) -> float:
    return e.number("asymmetry") * abs(v)


def _stribeck(e: RobotEffect, q: float, v: float, load: float) -> float:
    return e.number("excess") * direction(v) * math.exp(-abs(v) / e.number("fade"))


def _sublinear(e: RobotEffect, q: float, v: float, load: float) -> float:
    # A power of the speed less its own best straight line between 0 and twice the typical speed: with moments
    # a = 2^(n+1)/(n+1) and b = 2^(n+2)/(n+2), that line is 2 a - 3 b / 2 + (3 b / 2 - 3 a / 2) u.
    n, u = e.number("exponent"), abs(v) / e.number("typical")
    a, b = 2.0 ** (n + 1.0) / (n + 1.0), 2.0 ** (n + 2.0) / (n + 2.0)
    return e.number("bend") * direction(v) * (u**n - (2.0 * a - 1.5 * b) - (1.5 * b - 1.5 * a) * u)


def _load_friction(e: RobotEffect, q: float, v: float, load: float) -> float:
    return e.number("share") * direction(v) * (abs(load) - e.number("load"))


def _ripple(e: RobotEffect, q: float, v: float, load: float) -> float:
    angle = e.number("turns") * q
    return e.number("cosine") * math.cos(angle) + e.number("sine") * math.sin(angle)


def _counterbalance(e: RobotEffect, q: float, v: float, load: float) -> float:
    return e.number("cosine") * math.cos(q) + e.number("sine") * math.sin(q)


def _spring(e: RobotEffect, q: float, v: float, load: float) -> float:
    return e.number("stiffness") * (q - e.number("neutral"))


LAWS: dict[str, Callable[[RobotEffect, float, float, float], float]] = {
    "friction": _friction,
    "asymmetric_coulomb": _asymmetric_coulomb,
    "asymmetric_viscous": _asymmetric_viscous,
    "stribeck": _stribeck,
    "sublinear_friction": _sublinear,
    "load_friction": _load_friction,
    "ripple": _ripple,
    "counterbalance": _counterbalance,
    "spring": _spring,
}
"""By cause; a slide's ripple counts waves per metre as ``turns`` over 2 pi."""

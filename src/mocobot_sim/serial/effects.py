"""What MJCF cannot say of a joint: torques by the state, one joint at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy.special import hyp2f1

from estimator.arrays import Array
from mocobot_sim.serial.law import direction


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


def resistances(effects: list[RobotEffect], q: Array, v: Array, damping: Array) -> Array:
    """Torques that effects take from their joints' drives beyond what the model does, shape (J,) [N m or N].

    What rubs never drives: fitted viscous friction that is a little below zero, the model's own with it, is none.

    Args:
        effects: any; those of ``SMOOTH`` count.
        q: joint positions [rad or m], shape (J,).
        v: speeds, shape (J,).
        damping: the model's own [N m s/rad or N s/m], shape (J,).
    """
    out, rubbing = np.zeros(len(q)), np.zeros(len(q))
    for effect in effects:
        if effect.cause in SMOOTH and effect.joint is not None:
            j = effect.joint - 1
            into = rubbing if effect.cause in VISCOUS else out
            into[j] += SMOOTH[effect.cause](effect, float(q[j]), float(v[j]))
    return out + np.where((rubbing + damping * v) * v < 0.0, -damping * v, rubbing)


def dry_levels(effects: list[RobotEffect], v: Array, load: Array, time: float) -> Array:
    """Dry friction beyond the model's at every joint, shape (J,) [N m or N]; it may be less than that.

    Args:
        effects: any; those of ``DRY`` count.
        v: speeds, shape (J,).
        load: torques that the gears pass on, shape (J,).
        time: since the robot was switched on, as a log of it would have it [s].
    """
    out = np.zeros(len(v))
    for effect in effects:
        if effect.cause in DRY and effect.joint is not None:
            j = effect.joint - 1
            out[j] += DRY[effect.cause](effect, float(v[j]), float(load[j]), time)
    return out


def _coulomb(e: RobotEffect, v: float, load: float, time: float) -> float:
    return e.number("coulomb")


def _viscous(e: RobotEffect, q: float, v: float) -> float:
    return e.number("viscous") * v


def _asymmetric_coulomb(e: RobotEffect, v: float, load: float, time: float) -> float:
    return e.number("asymmetry") * direction(v)


def _asymmetric_viscous(e: RobotEffect, q: float, v: float) -> float:
    return e.number("asymmetry") * abs(v)


def _stribeck(e: RobotEffect, v: float, load: float, time: float) -> float:
    return e.number("excess") * math.exp(-abs(v) / e.number("fade"))


def _sublinear(e: RobotEffect, v: float, load: float, time: float) -> float:
    # A power of the speed less its own best straight line between 0 and twice the typical speed: with moments
    # a = 2^(n+1)/(n+1) and b = 2^(n+2)/(n+2), that line is 2 a - 3 b / 2 + (3 b / 2 - 3 a / 2) u.
    # Below the speed w it is viscous: u (u^2 + w^2)^((n - 1) / 2).
    n, typical = e.number("exponent"), e.number("typical")
    u, w = abs(v) / typical, e.number("thins") / typical
    a, b = _moments(n, w)
    power = u * (u * u + w * w) ** (0.5 * (n - 1.0)) if u else 0.0
    return e.number("bend") * (power - (2.0 * a - 1.5 * b) - (1.5 * b - 1.5 * a) * u)


@lru_cache
def _moments(n: float, w: float) -> tuple[float, float]:
    """Integrals from 0 to 2 of u^k (u^2 + w^2)^((n - 1) / 2), k = 1 and 2 (Gradshteyn and Ryzhik, 3.194.1)."""
    if not w:
        return 2.0 ** (n + 1.0) / (n + 1.0), 2.0 ** (n + 2.0) / (n + 2.0)
    first = ((4.0 + w * w) ** (0.5 * (n + 1.0)) - w ** (n + 1.0)) / (n + 1.0)
    return first, 8.0 / 3.0 * w ** (n - 1.0) * float(hyp2f1(0.5 * (1.0 - n), 1.5, 2.5, -4.0 / (w * w)))


def _load_friction(e: RobotEffect, v: float, load: float, time: float) -> float:
    return e.number("share") * (abs(load) - e.number("load"))


def _warming(e: RobotEffect, v: float, load: float, time: float) -> float:
    # Counted from its mean between 0 and ``until``, which is as much friction as there is without it.
    over, until = e.number("over"), e.number("until")
    mean = (1.0 - math.exp(-until / over)) * over / until
    power = (abs(v) / e.number("typical")) ** e.number("exponent")
    return e.number("more") * power * (math.exp(-time / over) - mean)


def _ripple(e: RobotEffect, q: float, v: float) -> float:
    angle = e.number("turns") * q
    return e.number("cosine") * math.cos(angle) + e.number("sine") * math.sin(angle)


def _counterbalance(e: RobotEffect, q: float, v: float) -> float:
    return e.number("cosine") * math.cos(q) + e.number("sine") * math.sin(q)


def _spring(e: RobotEffect, q: float, v: float) -> float:
    return e.number("stiffness") * (q - e.number("neutral"))


SMOOTH: dict[str, Callable[[RobotEffect, float, float], float]] = {
    "friction": _viscous,
    "asymmetric_viscous": _asymmetric_viscous,
    "ripple": _ripple,
    "counterbalance": _counterbalance,
    "spring": _spring,
}
"""Torques by position and speed, by cause; a slide's ripple counts waves per metre as ``turns`` over 2 pi."""

DRY: dict[str, Callable[[RobotEffect, float, float, float], float]] = {
    "friction": _coulomb,
    "asymmetric_coulomb": _asymmetric_coulomb,
    "stribeck": _stribeck,
    "sublinear_friction": _sublinear,
    "load_friction": _load_friction,
    "warming": _warming,
}
"""Dry friction by speed, load and time, by cause: against the motion, and at rest as much as keeps the joint there."""

VISCOUS = frozenset({"friction", "asymmetric_viscous"})
"""Of ``SMOOTH``, those that rub."""

LAWS = frozenset({*SMOOTH, *DRY})
"""Causes that are torques by the state of their own joint."""

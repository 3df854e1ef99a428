"""What MJCF cannot say of a joint: torques by the state, one joint at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from estimator.arrays import Array
from mocobot_sim.serial.law import CREEP, direction


@dataclass(frozen=True)
class RobotEffect:
    """One effect.

    Attributes:
        cause: such as ``stribeck``.
        joint: which joint, from 1; None of a body that no joint moves, and of the whole robot.
        partner: the other joint of a coupled drive, from 1.
        parameters: numbers, by name with the unit as suffix.
        body: name of the body that it is about, where it is about one; empty: the one that the joint moves.
    """

    cause: str
    joint: int | None
    partner: int | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    body: str = ""

    def number(self, *stems: str) -> float:
        """The number that is named so, or whose name begins so, whatever its unit.

        Raises:
            ValueError: there is none, or more than one.
        """
        begins = tuple(f"{stem}_" for stem in stems)
        (name,) = (n for n in self.parameters if n in stems or n.startswith(begins))
        return float(self.parameters[name])


def resistances(effects: Sequence[RobotEffect], q: Array, v: Array, damping: Array, dry: Array) -> Array:
    """Torques that effects take from their joints' drives beyond what the model does, shape (J,) [N m or N].

    What rubs never drives: fitted friction that is a little below zero, the model's own with it, is none.

    Args:
        effects: any; those of ``SMOOTH`` count.
        q: joint positions [rad or m], shape (J,).
        v: speeds, shape (J,).
        damping: the model's own [N m s/rad or N s/m], shape (J,).
        dry: dry friction, the model's own with it; what is below zero takes from the viscous friction, shape (J,).
    """
    out = np.zeros(len(q))
    rubbing = np.minimum(dry, 0.0) * np.tanh(v / CREEP)
    for effect in effects:
        if effect.cause in SMOOTH and effect.joint is not None:
            j = effect.joint - 1
            into = rubbing if effect.cause in VISCOUS else out
            into[j] += SMOOTH[effect.cause](effect, float(q[j]), float(v[j]))
    return out + np.where((rubbing + damping * v) * v < 0.0, -damping * v, rubbing)


def dry_levels(effects: Sequence[RobotEffect], v: Array, load: Array, time: float) -> Array:
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
    return e.number("bend") * math.log1p(abs(v) / e.number("thins"))


def _load_friction(e: RobotEffect, v: float, load: float, time: float) -> float:
    return e.number("share") * abs(load)


def _warming(e: RobotEffect, v: float, load: float, time: float) -> float:
    more = e.number("more_Nm", "more_N") + e.number("more_Nms", "more_Ns") * abs(v)
    return more * math.exp(-time / e.number("over"))


def _ripple(e: RobotEffect, q: float, v: float) -> float:
    angle = e.number("turns") * q
    return e.number("cosine") * math.cos(angle) + e.number("sine") * math.sin(angle)


def _counterbalance(e: RobotEffect, q: float, v: float) -> float:
    return e.number("cosine") * math.cos(q) + e.number("sine") * math.sin(q)


def _spring(e: RobotEffect, q: float, v: float) -> float:
    return e.number("stiffness") * (q - e.number("middle")) + e.number("offset")


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

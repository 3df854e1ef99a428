"""Effects of a serial robot, and how those act that MJCF cannot say: torques by the state, one joint at a time."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from estimator.arrays import Array
from estimator.strict import Fields
from mocobot_sim.functions import FUNCTIONS, Inside, Step, check_law

CREEP = 1e-3
"""Speed over which dry friction changes its direction here [rad/s or m/s]: slow beside what joints do."""


@dataclass(frozen=True)
class RobotEffect:
    """One effect."""

    cause: str  # such as ``stribeck``
    joint: int | None  # which joint, from 1; None of a body that no joint moves, and of the whole robot
    partner: int | None = None  # the other joint of a coupled drive, from 1
    parameters: Mapping[str, float] = field(default_factory=dict)  # numbers, by name with the unit as suffix
    # name of the body that it is about, where it is about one; empty: the one that the joint moves
    body: str = ""

    def number(self, *stems: str) -> float:
        """The number that is named so, or whose name begins so, whatever its unit.

        Raises:
            ValueError: there is none, or more than one.
        """
        begins = tuple(f"{stem}_" for stem in stems)
        (name,) = (n for n in self.parameters if n in stems or n.startswith(begins))
        return float(self.parameters[name])


@dataclass(frozen=True, eq=False)
class State:
    """State of all joints at one step."""

    time_s: float  # since the start
    period_s: float  # of a step
    q: Array  # positions and rates, shape (J,)
    dq: Array  # positions and rates, shape (J,)
    ddq: Array  # accelerations of the step before, shape (J,)
    load: Array  # torques that the masses behind the joints ask for, shape (J,)
    torque: Array  # that the drives give, shape (J,)

    def signal(self, name: str) -> float:
        """A signal by its name: ``time``, ``q_3``, ``direction_3`` and so on."""
        if name == "time":
            return self.time_s
        kind, _, number = name.rpartition("_")
        j = int(number) - 1
        return direction(float(self.dq[j])) if kind == "direction" else float(getattr(self, kind)[j])


def direction(speed: float) -> float:
    """Direction of a motion in [-1, 1]."""
    return math.tanh(speed / CREEP)


TEXTS, NUMBERS = ("target", "function", "of", "times"), ("amplitude", "number", "second", "phase_rad")
TARGET, TARGETS = re.compile(r"(torque|position)_[1-9][0-9]*"), "torque_3, position_3"
SIGNAL = re.compile(r"time|(q|dq|ddq|direction|load|torque)_[1-9][0-9]*")
SIGNALS = "time, q_3, dq_3, ddq_3, direction_3, load_3, torque_3"


@dataclass(frozen=True)
class JointLaw:
    """``amplitude`` times a function of a signal, and times another signal where one is named, at a joint from 1."""

    # ``torque_3``, what the torque of joint 3 holds besides, or ``position_3``, what its reading is off by, which is
    # an error of the log and not simulated
    target: str
    function: str  # as in ``mocobot_sim.functions.FUNCTIONS``
    # signals, all in SI: ``time``, ``q_3``, ``dq_3``, ``ddq_3``, ``direction_3``, ``load_3`` and ``torque_3``;
    # ``times`` is empty where there is none
    of: str
    amplitude: float  # in the target's unit over those of the signals
    # what the function has inside (docs/effects.md)
    number: float = 0.0
    second: float = 0.0
    phase_rad: float = 0.0
    times: str = ""

    def __post_init__(self) -> None:
        """Check names and numbers.

        Raises:
            InputError: a name is not known, or a number is not allowed with this function.
        """
        check_law(self, TARGET.fullmatch, TARGETS, SIGNAL.fullmatch, SIGNALS)

    @property
    def joint(self) -> int:
        """At which joint, from 1."""
        return int(self.target.rpartition("_")[2])

    @property
    def acts(self) -> bool:
        """Whether it is a torque, and no error of a reading."""
        return self.target.startswith("torque")

    def to_dict(self) -> dict[str, str | float]:
        """Plain JSON values."""
        return asdict(self)

    @classmethod
    def of_dict(cls, values: Mapping[str, Any], where: str) -> JointLaw:
        """From plain JSON values.

        Raises:
            InputError: they are no formula.
        """
        entry = Fields(values, (*TEXTS, *NUMBERS), where)
        given: dict[str, Any] = {key: entry.number(key) for key in NUMBERS}
        given |= {key: str(entry.values[key]) for key in TEXTS}
        return cls(**given)


class ActingLaw:
    """A law in one run: it may remember what was, such as a play.

    Attributes:
        law: which.
    """

    def __init__(self, law: JointLaw) -> None:
        self.law = law
        self._function: Step | None = None

    def torque(self, state: State) -> float:
        """What it takes from the drive of its joint now [N m or N]; to be asked once a step."""
        law = self.law
        if self._function is None:
            inside = Inside(law.number, law.second, law.phase_rad, state.period_s)
            self._function = FUNCTIONS[law.function](inside)
        out = law.amplitude * self._function(state.signal(law.of))
        return out * state.signal(law.times) if law.times else out


def resistances(effects: Sequence[RobotEffect], q: Array, v: Array, damping: Array, dry: Array) -> Array:
    """Torques that ``SMOOTH`` effects take from the drives beyond what the model does, shape (J,) [N m or N].

    What rubs never drives: fitted friction that is a little below zero, the model's own with it, is none.

    Args:
        effects: any.
        q, v: joint positions and speeds, shape (J,).
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
    """Dry friction of ``DRY`` effects beyond the model's, which may be negative, shape (J,) [N m or N].

    ``load`` are the torques that the gears pass on, ``time`` since the robot was switched on, as a log has it [s].
    """
    out = np.zeros(len(v))
    for effect in effects:
        if effect.cause in DRY and effect.joint is not None:
            j = effect.joint - 1
            out[j] += DRY[effect.cause](effect, float(v[j]), float(load[j]), time)
    return out


def _warming(e: RobotEffect, v: float, load: float, time: float) -> float:
    more = e.number("more_Nm", "more_N") + e.number("more_Nms", "more_Ns") * abs(v)
    return more * math.exp(-time / e.number("over"))


def _wave(e: RobotEffect, angle: float) -> float:
    return e.number("cosine") * math.cos(angle) + e.number("sine") * math.sin(angle)


SMOOTH: dict[str, Callable[[RobotEffect, float, float], float]] = {
    "friction": lambda e, q, v: e.number("viscous") * v,
    "asymmetric_viscous": lambda e, q, v: e.number("asymmetry") * abs(v),
    "ripple": lambda e, q, v: _wave(e, e.number("turns") * q),
    "counterbalance": lambda e, q, v: _wave(e, q),
    "spring": lambda e, q, v: e.number("stiffness") * (q - e.number("middle")) + e.number("offset"),
}
"""Torques by position and speed, by cause; a slide's ripple counts waves per metre as ``turns`` over 2 pi."""

DRY: dict[str, Callable[[RobotEffect, float, float, float], float]] = {
    "friction": lambda e, v, load, time: e.number("coulomb"),
    "asymmetric_coulomb": lambda e, v, load, time: e.number("asymmetry") * direction(v),
    "stribeck": lambda e, v, load, time: e.number("excess") * math.exp(-abs(v) / e.number("fade")),
    "sublinear_friction": lambda e, v, load, time: e.number("bend") * math.log1p(abs(v) / e.number("thins")),
    "load_friction": lambda e, v, load, time: e.number("share") * abs(load),
    "warming": _warming,
}
"""Dry friction by speed, load and time, by cause: against the motion, and at rest as much as keeps the joint there."""

VISCOUS = frozenset({"friction", "asymmetric_viscous"})
"""Of ``SMOOTH``, those that rub."""

LAWS = frozenset({*SMOOTH, *DRY})
"""Causes that are torques by the state of their own joint."""

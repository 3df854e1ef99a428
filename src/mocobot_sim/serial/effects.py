"""Effects on a serial robot, and joint torques of the effects that MJCF cannot express."""

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
"""Speed scale over which dry friction changes its sign [rad/s or m/s]. Chosen: slow compared to joint speeds."""


@dataclass(frozen=True)
class RobotEffect:
    """One effect on a serial robot."""

    cause: str  # name of the cause, such as ``stribeck``
    joint: int | None  # number of the joint, from 1; None for a body without joint and for the whole robot
    partner: int | None = None  # other joint of a coupled drive, from 1
    parameters: Mapping[str, float] = field(default_factory=dict)  # values by name; suffixes give the units
    # name of the affected body; empty for the body that the joint moves
    body: str = ""

    def number(self, *stems: str) -> float:
        """Value of the parameter with one of the given names, with or without unit suffix.

        Raises:
            ValueError: there is no such parameter, or more than one.
        """
        begins = tuple(f"{stem}_" for stem in stems)
        (name,) = (n for n in self.parameters if n in stems or n.startswith(begins))
        return float(self.parameters[name])


@dataclass(frozen=True, eq=False)
class State:
    """State of all joints at one time step."""

    time_s: float  # time
    period_s: float  # time step
    q: Array  # positions, shape (J,)
    dq: Array  # velocities, shape (J,)
    ddq: Array  # accelerations of the previous step, shape (J,)
    load: Array  # torques that the gears transmit to the links, shape (J,)
    torque: Array  # motor torques, shape (J,)

    def signal(self, name: str) -> float:
        """Value of a signal by its name, such as ``time``, ``q_3`` or ``direction_3``."""
        if name == "time":
            return self.time_s
        kind, _, number = name.rpartition("_")
        j = int(number) - 1
        return direction(float(self.dq[j])) if kind == "direction" else float(getattr(self, kind)[j])


def direction(speed: float) -> float:
    """Smoothed sign of a speed, in [-1, 1]."""
    return math.tanh(speed / CREEP)


TEXTS, NUMBERS = ("target", "function", "of", "times"), ("amplitude", "number", "second", "phase_rad")
TARGET, TARGETS = re.compile(r"(torque|position)_[1-9][0-9]*"), "torque_3, position_3"
SIGNAL = re.compile(r"time|(q|dq|ddq|direction|load|torque)_[1-9][0-9]*")
SIGNALS = "time, q_3, dq_3, ddq_3, direction_3, load_3, torque_3"


@dataclass(frozen=True)
class JointLaw:
    """A formula at a joint: ``amplitude`` times a function of the signal ``of``, optionally times a second signal."""

    # ``torque_3`` adds a resisting torque at joint 3; ``position_3`` is an error of the reading, which is an error of
    # the log and not simulated
    target: str
    function: str  # key of ``mocobot_sim.functions.FUNCTIONS``
    # signals in SI units: ``time``, ``q_3``, ``dq_3``, ``ddq_3``, ``direction_3``, ``load_3`` or ``torque_3``;
    # ``times`` is empty for no second signal
    of: str
    amplitude: float  # in the unit of the target over those of the signals
    # parameters of the function (docs/effects.md)
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
        """Number of the joint, from 1."""
        return int(self.target.rpartition("_")[2])

    @property
    def acts(self) -> bool:
        """Whether the target is a torque instead of a reading."""
        return self.target.startswith("torque")

    def to_dict(self) -> dict[str, str | float]:
        """Convert to JSON values."""
        return asdict(self)

    @classmethod
    def of_dict(cls, values: Mapping[str, Any], where: str) -> JointLaw:
        """Make a law from the output of ``to_dict``; ``where`` is the context for error messages.

        Raises:
            InputError: a key is missing or unknown, or a value is not allowed.
        """
        entry = Fields(values, (*TEXTS, *NUMBERS), where)
        given: dict[str, Any] = {key: entry.number(key) for key in NUMBERS}
        given |= {key: str(entry.values[key]) for key in TEXTS}
        return cls(**given)


class ActingLaw:
    """A law in one run, with its state, such as that of a backlash.

    Attributes:
        law: the law.
    """

    def __init__(self, law: JointLaw) -> None:
        self.law = law
        self._function: Step | None = None

    def torque(self, state: State) -> float:
        """Resisting torque at the joint [N m or N]; call it once per time step."""
        law = self.law
        if self._function is None:
            inside = Inside(law.number, law.second, law.phase_rad, state.period_s)
            self._function = FUNCTIONS[law.function](inside)
        out = law.amplitude * self._function(state.signal(law.of))
        return out * state.signal(law.times) if law.times else out


def resistances(effects: Sequence[RobotEffect], q: Array, v: Array, damping: Array, dry: Array) -> Array:
    """Resisting torques of the ``SMOOTH`` effects beyond those of the model [N m or N], shape (J,).

    Total friction never drives a joint: if fitted parameters make it negative, it is set to zero.

    Args:
        effects: effects of any cause.
        q, v: joint positions and velocities, shape (J,).
        damping: viscous friction coefficients of the model [N m s/rad or N s/m], shape (J,).
        dry: total dry friction, that of the model included, shape (J,); negative values reduce the viscous friction.
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
    """Dry friction of the ``DRY`` effects beyond that of the model [N m or N], shape (J,); may be negative.

    Args:
        effects: effects of any cause.
        v: joint velocities, shape (J,).
        load: torques that the gears transmit, shape (J,).
        time: time since the robot was switched on, as in the log [s].
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
"""Resisting torque as a function of position and velocity, by cause. For slides, the waves per metre of a ripple are
``turns`` over 2 pi."""

DRY: dict[str, Callable[[RobotEffect, float, float, float], float]] = {
    "friction": lambda e, v, load, time: e.number("coulomb"),
    "asymmetric_coulomb": lambda e, v, load, time: e.number("asymmetry") * direction(v),
    "stribeck": lambda e, v, load, time: e.number("excess") * math.exp(-abs(v) / e.number("fade")),
    "sublinear_friction": lambda e, v, load, time: e.number("bend") * math.log1p(abs(v) / e.number("thins")),
    "load_friction": lambda e, v, load, time: e.number("share") * abs(load),
    "warming": _warming,
}
"""Magnitude of dry friction as a function of velocity, load and time, by cause. It opposes motion, and at rest it is
the limit of stiction."""

VISCOUS = frozenset({"friction", "asymmetric_viscous"})
"""Causes in ``SMOOTH`` that are friction."""

LAWS = frozenset({*SMOOTH, *DRY})
"""Causes that ``step`` simulates as torques that depend on the state of their own joint."""

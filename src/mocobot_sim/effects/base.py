"""Base class of all effects: checked parameters, a place, and how an effect enters a scene.

This module does not load MuJoCo, so that parameters can be checked quickly.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.trial.actors import Actor, Reader

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene

PLACE = ("robot", "joint")
JOINTS = 3
WHOLE = {"robot": 1, "joint": 1, "trial": 1, "last_trial": 0, "draw": 0}
"""Parameters that are whole numbers, each with its smallest allowed value."""

# Solver tolerances: MuJoCo's default, and that for scenes with dry friction, limits or soft rows. Chosen.
_DEFAULT_TOLERANCE, _WITH_KINKS = 1e-8, 1e-12


def precise(scene: TeamScene, tolerance: float = _WITH_KINKS) -> None:
    """Tighten the tolerance of the constraint solver of a scene.

    The solver stops when its improvement, scaled by the mean inertia, is below the tolerance. With dry friction, limits
    or soft rows, MuJoCo's default of 1e-8 sometimes stops too early. Rods then open by tens of micrometres; with 1e-12
    they open by less than one.
    """
    option = scene.root.option
    option.tolerance = min(_DEFAULT_TOLERANCE if option.tolerance is None else option.tolerance, tolerance)


@dataclass(frozen=True)
class Effect:
    """One cause at one place; all fields except ``robot`` and ``joint`` are its parameters.

    Attributes:
        cause: name of the cause: the class name in lower case with underscores.
        ranges: allowed range (low, high) by parameter, both ends included; other parameters may be any finite number.
        inherent: smallest value by parameter that the simulation reproduces; below it the masses of the simulated
            bodies determine the behaviour.
        texts: parameters that are names instead of numbers.
        repeats: whether several of these effects may act at one place.
        on_payload: whether the effect needs a payload.
        as_built: attribute of the robot's ``AsBuilt`` to which each parameter is added, at the effect's joint.
        sensors: attribute of ``SensorEffects`` to which each parameter is added, for the effect's robot.
    """

    cause: ClassVar[str]
    ranges: ClassVar[dict[str, tuple[float, float]]] = {}
    inherent: ClassVar[dict[str, float]] = {}
    texts: ClassVar[tuple[str, ...]] = ()
    repeats: ClassVar[bool] = False
    on_payload: ClassVar[bool] = False
    as_built: ClassVar[dict[str, str]] = {}
    sensors: ClassVar[dict[str, str]] = {}

    def __init_subclass__(cls) -> None:
        cls.cause = re.sub(r"\B(?=[A-Z])", "_", cls.__name__).lower()

    def __post_init__(self) -> None:
        """Check every number.

        Raises:
            InputError: a value is not a number or is out of range.
        """
        for entry in fields(self):
            value = getattr(self, entry.name)
            if entry.name in self.texts:
                if not isinstance(value, str):
                    raise InputError(f"{self.cause}: {entry.name} is {value!r:.60}; it must be text")
                continue
            if entry.name in WHOLE:
                least = WHOLE[entry.name]
                allowed = "1, 2 or 3" if entry.name == "joint" else f"a whole number of at least {least}"
                good = type(value) is int and value >= least and (entry.name != "joint" or value <= JOINTS)
            else:
                low, high = self.ranges.get(entry.name, (-sys.float_info.max, sys.float_info.max))
                allowed = "a finite number"
                if entry.name in self.ranges:
                    allowed += f" of at least {low:g}" + (f" and at most {high:g}" if high < math.inf else "")
                number = isinstance(value, int | float) and not isinstance(value, bool)
                good = number and low <= value <= high and math.isfinite(value)
            if not good:
                raise InputError(f"{self.cause}: {entry.name} is {value!r}; it must be {allowed}")

    @classmethod
    def place_names(cls) -> tuple[str, ...]:
        """Which of the fields ``robot`` and ``joint`` this cause has."""
        return tuple(entry.name for entry in fields(cls) if entry.name in PLACE)

    @classmethod
    def parameter_names(cls) -> tuple[str, ...]:
        """Names of the parameters; suffixes give their units."""
        return tuple(entry.name for entry in fields(cls) if entry.name not in PLACE)

    def apply(self, scene: TeamScene) -> TeamScene:
        """Return the scene with this effect added; the scene's PyMJCF tree is edited in place.

        Call ``TeamScene.tuned`` after the last effect: the parameters of soft rows depend on the final inertias.

        Raises:
            InputError: the scene has no such robot or no payload, or cannot be edited.
        """
        if scene.root is None:
            raise InputError(f"{self.cause}: a scene read from an extended model takes no further effects")
        if self.on_payload and not scene.carries:
            raise InputError(f"{self.cause}: acts on a payload; robots of a free trial hold nothing")
        robot = getattr(self, "robot", 1)
        if robot > scene.robots:
            raise InputError(f"{self.cause}: robot is {robot}; the team has robots 1 .. {scene.robots}")
        return self._edit(self._recorded(scene, robot))

    def _recorded(self, scene: TeamScene, robot: int) -> TeamScene:
        """Return the scene with the parameters listed in ``as_built`` and ``sensors`` added to its records."""
        sensors, unit = scene.sensors, scene.units[robot - 1]
        for parameter, name in self.sensors.items():
            sensors = sensors.added(name, robot, getattr(self, parameter), scene.robots)
        for parameter, name in self.as_built.items():
            values = np.array(getattr(unit, name), dtype=float)
            values[getattr(self, "joint", 1) - 1] += getattr(self, parameter)
            unit = replace(unit, **{name: values})
        units = (*scene.units[: robot - 1], unit, *scene.units[robot:])
        return replace(scene, sensors=sensors, units=units)

    def _edit(self, scene: TeamScene) -> TeamScene:
        """Edit the MJCF; overridden by effects that change it."""
        return scene

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        """Make the actors of one trial, for effects that MJCF cannot express; trials count from 1, None means any."""
        return ()

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """Make the readers of one trial, which change the readings of sensors; trials count from 1, None means any."""
        return ()

    def carried(self) -> Array:
        """Inertial parameters (m, m c, J about {1}) that the effect adds to an estimate of the payload, shape (10,)."""
        return np.zeros(10)

    def base_shift(self) -> Array:
        """Displacement of the robot's {b} due to the effect, in the axes of the undisplaced {b} [m], shape (3,)."""
        return np.zeros(3)

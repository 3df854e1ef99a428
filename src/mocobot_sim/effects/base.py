"""What all effects have in common: checked numbers, a place, and how they enter a scene.

What an effect is, takes and allows is known without MuJoCo: it edits the scene that it is given, and loads nothing of
what made it. So a wrong number is refused at once.
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
WHOLE = {"robot": 1, "joint": 1, "trial": 1, "last_trial": 0}
"""Whole numbers, and the least that each may be."""

_DEFAULT_TOLERANCE, _WITH_KINKS = 1e-8, 1e-12


def precise(scene: TeamScene, tolerance: float = _WITH_KINKS) -> None:
    """Let the constraint solver of a scene stop later.

    By default it stops at 1e-8 of a cost that scales with the mean inertia. Sliding and sticking, limits and soft rows
    then end steps early now and then, and rods open by tens of micrometres; with 1e-12 by less than one.
    """
    option = scene.root.option
    option.tolerance = min(_DEFAULT_TOLERANCE if option.tolerance is None else option.tolerance, tolerance)


@dataclass(frozen=True)
class Effect:
    """One cause at one place; the fields besides ``robot`` and ``joint`` are its parameters.

    Attributes:
        cause: name of the cause: that of the class, in lower case with underscores.
        ranges: allowed range (low, high) of the parameters that may not be any finite number, both ends included.
        inherent: parameters that below so much are not what the simulation has: its bodies' masses decide then.
        texts: parameters that are names, not numbers.
        repeats: whether one place takes several.
        on_payload: whether it needs a payload, or a grasp of one.
        as_built: parameters that add to an attribute of the joint's ``AsBuilt``.
        sensors: parameters that add to an attribute of the robot's ``SensorEffects``.
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
            InputError: a value is not a number or out of its range.
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
        """``robot`` and ``joint``, as far as this cause has them."""
        return tuple(entry.name for entry in fields(cls) if entry.name in PLACE)

    @classmethod
    def parameter_names(cls) -> tuple[str, ...]:
        """Names of the parameters, units in their suffixes."""
        return tuple(entry.name for entry in fields(cls) if entry.name not in PLACE)

    def apply(self, scene: TeamScene) -> TeamScene:
        """Put the effect into a scene and return it; the scene's PyMJCF tree is edited in place.

        Soft rows are not set: ``TeamScene.tuned`` does that for the inertias that all effects leave.

        Raises:
            InputError: the scene has no such robot, or cannot be edited.
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
        """The scene with what ``as_built`` and ``sensors`` name; the MJCF does not change."""
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
        """Edit the MJCF."""
        return scene

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        """Who acts in a trial, new ones for each: what MJCF cannot express. Trials count from 1; None is any."""
        return ()

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """Sensors that misread in a trial, new ones for each."""
        return ()

    def carried(self) -> Array:
        """Inertial parameters (m, m c, J about {1}) that it adds to the payload's in an estimate, shape (10,)."""
        return np.zeros(10)

    def base_shift(self) -> Array:
        """By how much it moves the origin of its robot's {b}, in the axes of {b} without it [m], shape (3,)."""
        return np.zeros(3)

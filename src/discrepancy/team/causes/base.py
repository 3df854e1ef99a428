"""Interface of every cause in the team's catalogue."""

import inspect
import re
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from discrepancy.candidate import Candidate, Parameter, Transient
from discrepancy.numbers import Numbers, number
from discrepancy.team.linear.rows import Patches
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arm.unit import Arms
from estimator.arrays import Array

Shape = Mapping[str, float]
At = Literal["driven joint", "gimbal joint", "robot", "grasp", "payload"]

REACH_M = 1.5
"""Largest distance from the centre of mass to a point of the payload [m]. Chosen: no payload of three is larger."""

GIMBAL_AXES = {1: "z (first)", 2: "y (middle)", 3: "x (last)"}


@dataclass(frozen=True, eq=False)
class Context:
    """Quantities that turn the columns' values into an effect's parameters.

    Attributes:
        p_1c: centre of mass of the payload in {1} [m], shape (3,).
        home_height_m: height of the wrist at home in {b}.
        shape: the candidate's shape.
        trial: number of a transient's trial, from 1, or None.
    """

    p_1c: Array
    home_height_m: float
    shape: Shape
    trial: int | None


class Cause(ABC):
    """A physical cause: the residual that one unit of each of its parameters adds.

    The simulator's effect has the same name. Default tolerances are assumed, for a well-kept, calibrated Omnid with
    16-bit encoders. A lab replaces them with its own (``--tolerances``).

    Attributes:
        name: as on the command line: the class name in lower case with underscores.
        title: in words, with the part in braces, such as ``friction in {driven joint}``. The default is the name
            without underscores.
        family: causes of one family resemble each other.
        parameters: names of the columns' parameters, with units as suffix.
        tolerances: standard deviation of each parameter in a healthy team; empty if the cause is an event.
        scales: typical sizes of the parameters, if there are no tolerances.
        positive: parameters that cannot be negative.
        transient: whether it acts during an interval of one trial only.
        where: the part of the machine, for causes that belong to no robot.
        among: number of equally probable places, if the shape contains the place; 0 if the places are listed.
        separate: experiment that would distinguish it from similar causes.
        at: the part that it acts on. Every robot has its own, except for the payload.
        joints: joints that it can act on, from 1.
        shapes: alternative numbers that change the columns themselves; the first one is in the catalogue.
        determined: shape numbers that the data determine, and the step of their finite differences over the number.
        absolute: those of them whose step is given in their own unit, because the number may be zero.
        refined: shape numbers of a finer search, with the factors on each and the range of its size.
        clipped: parameters of the effect that are set to zero if the fit makes them negative.
        by_clocks: whether it only acts through the robots' clocks, so that it is invisible if the motion aligned them.
        adjusted: whether it is a function of the readings, which are then taken without their noise.
    """

    name: ClassVar[str]
    title: ClassVar[str] = ""
    family: ClassVar[str]
    parameters: ClassVar[tuple[str, ...]]
    tolerances: ClassVar[tuple[float, ...]] = ()
    scales: ClassVar[tuple[float, ...]] = ()
    positive: ClassVar[tuple[str, ...]] = ()
    transient: ClassVar[bool] = False
    where: ClassVar[str] = "payload"
    among: ClassVar[int] = 0
    separate: ClassVar[str] = ""
    at: ClassVar[At] = "driven joint"
    joints: ClassVar[tuple[int, ...]] = (1, 2, 3)
    shapes: ClassVar[tuple[Shape, ...]] = ({},)
    determined: ClassVar[Mapping[str, float]] = {}
    absolute: ClassVar[Collection[str]] = ()
    refined: ClassVar[Mapping[str, tuple[Sequence[float], tuple[float, float]]]] = {}
    clipped: ClassVar[tuple[str, ...]] = ()
    by_clocks: ClassVar[bool] = False
    adjusted: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        cls.name = re.sub(r"\B(?=[A-Z])", "_", cls.__name__).lower()

    def candidate(
        self, given: Mapping[str, float], shape: Shape, robot: int | None = None, joint: int | None = None
    ) -> Candidate:
        """The cause at a place.

        Args:
            given: standard deviation of each parameter in a healthy team; empty for an event.
            shape: numbers inside its columns.
            robot, joint: place, from 1.
        """
        parameters = tuple(
            Parameter(name, given.get(name, 0.0), scale)
            for name, scale in zip(self.parameters, self.tolerances or self.scales, strict=True)
        )
        return Candidate(
            self.name, self.family, robot, joint, parameters, dict(shape), where=self.where, title=self.title,
            among=self.among,
        )  # fmt: skip

    def event(self, given: Mapping[str, float], when: Transient) -> Candidate:
        """A transient cause during an interval."""
        return replace(self.candidate(given, when.shape), transient=when)

    def sentence(self, n: Numbers) -> str:
        """Describe its action, without place and full stop. The default is the first line of the class docstring."""
        said = (inspect.getdoc(self) or self.name).splitlines()[0].rstrip(".")
        each = ", ".join(f"{name} = {number(value, n.se.get(name), '')}" for name, value in n.values.items())
        return f"{said} ({each})"

    @property
    def per(self) -> Literal["joint", "robot", "payload"]:
        """The part that has at most one such cause."""
        if self.at == "payload":
            return "payload"
        return "joint" if self.at.endswith("joint") else "robot"

    @abstractmethod
    def columns(self, trial: TrialLinear, robot: int, joint: int, shape: Shape) -> Array:
        """Columns of one trial, shape (n, C, k): residual per unit of each parameter.

        Args:
            trial: the linearised trial.
            robot, joint: place, indices from 0 (0 if it has none).
            shape: one of ``shapes``.
        """

    def undo(
        self, signals: Signals, trial: TrialLinear, robot: int, joint: int, values: Array, shape: Shape
    ) -> Signals | None:
        """Remove the cause from the signals. Return None if it is not an error of the signals."""
        return None

    def finer(self, shape: Shape) -> Sequence[Shape]:
        """Shapes near a chosen one, for a finer search: those of ``refined``, with one number changed each."""
        near = (
            (name, shape[name] * factor, span)
            for name, (factors, span) in self.refined.items() if name in shape for factor in factors
        )  # fmt: skip
        return [{**shape, name: x} for name, x, (least, most) in near if least <= abs(x) <= most]

    def further(self, shape: Shape) -> Sequence[Shape]:
        """Shapes with additional features, tried once the best simple shape is found."""
        return []

    def grown(self, shape: Shape) -> Sequence[Shape]:
        """The same shape with one more number, still zero, that the data determine. Empty if there is none."""
        return []

    def around(self, values: Array, shape: Shape) -> Shape:
        """The shape whose columns are linearised around given values."""
        return shape

    def alike(self, shape: Shape) -> int:
        """Number of equally probable candidates that differ in shape only; 0 if the places are listed."""
        return self.among

    def slope_step(self, name: str, number: float) -> float:
        """Step of a shape number for finite differences."""
        return self.determined[name] * (1.0 if name in self.absolute else abs(number))

    def unknowns(self, trial: TrialLinear, robot: int, joint: int, shape: Shape) -> Patches:
        """Columns of latent states that a cause adds to one trial, such as the friction torque of a joint at rest."""
        return Patches(trial.residual.shape)

    def place(self, candidate: Candidate) -> str:
        """Robot and joint, and the axis of a gimbal joint."""
        if self.at != "gimbal joint" or candidate.joint is None:
            return candidate.place.capitalize()
        return f"Robot {candidate.robot}, gimbal joint {candidate.joint}, axis {GIMBAL_AXES[candidate.joint]}"

    def physical(self, values: Array, context: Context) -> dict[str, float]:
        """Convert the columns' values to the effect's parameters (names as in the simulator)."""
        return dict(zip(self.parameters, values.tolist(), strict=True))

    def report(
        self, values: Array, covariance: Array, context: Context
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Return the effect's parameters and their standard errors. A shape that is not determined by the data has NaN.

        Args:
            values: of the columns, shape (k,).
            covariance: of the values, then of the shape numbers that the data determine, shape (k + s, k + s) or (k,
                k).
            context: other quantities that the parameters depend on.
        """
        physical = self.physical(values, context)
        se = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        squares = {name: 0.0 for name in physical}
        vectors = np.linalg.eigh(covariance)
        for variance, direction in zip(vectors[0], vectors[1].T, strict=True):
            step = np.sqrt(max(variance, 0.0)) * direction
            if not np.any(np.abs(step) > 1e-12 * se.max(initial=0.0)):
                continue
            ahead, behind = (self._moved(values, context, x * step) for x in (0.1, -0.1))
            for name in physical:
                squares[name] += ((ahead[name] - behind[name]) / 0.2) ** 2
        return physical, {name: float(np.sqrt(v)) if v else float("nan") for name, v in squares.items()}

    def _moved(self, values: Array, context: Context, step: Array) -> dict[str, float]:
        """The effect's parameters after a step in values and shape."""
        k = len(values)
        named = (name for name in self.determined if name in context.shape)
        further = dict(zip(named, step[k:], strict=False))
        shape = {name: x + further.get(name, 0.0) for name, x in context.shape.items()}
        return self.physical(values + step[:k], replace(context, shape=shape))


class ReadingError(Cause):
    """An error of one robot's readings, linear in its parameters; it is removed from the signals."""

    @abstractmethod
    def errors(
        self, signals: Signals, robot: int, joint: int, shape: Shape, arm: Arms
    ) -> Sequence[Mapping[str, Array]]:
        """Error of the robot's ``phi``, ``theta``, ``tau`` per unit of each parameter, shape (Q, 3) or (3,)."""

    def columns(self, trial: TrialLinear, robot: int, joint: int, shape: Shape) -> Array:
        signals = trial.adjusted if self.adjusted else trial.signals
        errors = self.errors(signals, robot, joint, shape, trial.arm(robot))
        return stack([trial.of_signals(robot, **error) for error in errors])

    def undo(
        self, signals: Signals, trial: TrialLinear, robot: int, joint: int, values: Array, shape: Shape
    ) -> Signals:
        errors = self.errors(signals, robot, joint, shape, trial.arm(robot))
        for value, error in zip(values, errors, strict=True):
            scaled = {name: np.broadcast_to(value * x, (len(signals.time), 3)) for name, x in error.items()}
            signals = signals.minus(**{n: one_robot(x, trial.robots, robot) for n, x in scaled.items()})
        return signals


def by_axis(name: str, unit: str, vector: Array) -> dict[str, float]:
    """Parameters ``name_x_unit``, ``name_y_unit`` and ``name_z_unit`` of an effect, from a vector of shape (3,)."""
    return {f"{name}_{axis}_{unit}": float(x) for axis, x in zip("xyz", vector, strict=True)}


def one_joint(values: Array, joint: int) -> Array:
    """Place a signal at one joint of three, shape (Q,) -> (Q, 3)."""
    out = np.zeros((len(values), 3))
    out[:, joint] = values
    return out


def one_robot(values: Array, robots: int, robot: int) -> Array:
    """Place a signal at one robot of N, shape (Q, 3) -> (Q, N, 3)."""
    out = np.zeros((len(values), robots, 3))
    out[:, robot] = values
    return out


def stack(columns: Sequence[Array]) -> Array:
    """Stack columns (n, C) to shape (n, C, k)."""
    return np.stack(columns, axis=-1)

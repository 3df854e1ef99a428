"""What every cause of the team's catalogue offers the diagnosis."""

import inspect
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
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

GIMBAL_AXES = {1: "z (first)", 2: "y (middle)", 3: "x (last)"}


@dataclass(frozen=True, eq=False)
class Context:
    """What turns columns' values into an effect's parameters.

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
    """One physical cause: the trace that one unit of each of its parameters leaves in the residual.

    The simulator's effect has the same name. Tolerances are those of a well-kept Omnid: assumed, like its masses, for a
    calibrated unit with 16-bit encoders; a lab replaces them by its own (``--tolerances``).

    Attributes:
        name: as on the command line: that of the class, in lower case with underscores.
        title: in words, for people; the part it sits at in braces, such as ``friction in {driven joint}``. The name
            without underscores, if a cause does not say.
        family: causes of one family look alike.
        parameters: names of the columns' parameters, units as suffix.
        tolerances: of the parameters, standard deviations that are no news; none where the cause is an event.
        scales: their typical sizes, where there are no tolerances.
        positive: parameters that cannot be negative.
        transient: whether it acts for a while in one trial.
        where: the part of the machine, of what sits at no robot.
        among: of how many it is one, where its shape says at which of many places it sits; 0 where places are listed.
        separate: what experiment would tell it from its look-alikes.
        at: what it can sit at; every robot has its own but for the payload.
        joints: those that it can sit at, from 1.
        shapes: alternatives of what changes the columns themselves; the first is the catalogue's.
        determined: numbers of the shape that the data determine, with what ``slope_step`` makes steps of.
        clipped: the effect's parameters that are zero where the fit has them below.
        by_clocks: whether it shows in the robots' clocks alone, and so not where the motion set them.
            adjusted: whether it is a function of the readings, which are taken without their noise then.
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
            given: standard deviations that are no news, by parameter; an event where there are none.
            shape: numbers inside its columns.
            robot, joint: where, from 1.
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
        """What it does, without place and full stop; the first line of its docstring, if it says nothing else."""
        said = (inspect.getdoc(self) or self.name).splitlines()[0].rstrip(".")
        each = ", ".join(f"{name} = {number(value, n.se.get(name), '')}" for name, value in n.values.items())
        return f"{said} ({each})"

    @property
    def per(self) -> Literal["joint", "robot", "payload"]:
        """What has one of it at most."""
        if self.at == "payload":
            return "payload"
        return "joint" if self.at.endswith("joint") else "robot"

    @abstractmethod
    def columns(self, trial: TrialLinear, robot: int, joint: int, shape: Shape) -> Array:
        """Columns of one trial, shape (n, C, k): residual per unit of each parameter.

        Args:
            trial: the linearised trial.
            robot, joint: place, indices from 0 (0 where it has none).
            shape: one of ``shapes``.
        """

    def undo(
        self, signals: Signals, trial: TrialLinear, robot: int, joint: int, values: Array, shape: Shape
    ) -> Signals | None:
        """The signals as they would be without the cause, or None where it is not an error of the signals."""
        return None

    def finer(self, shape: Shape) -> Sequence[Shape]:
        """Shapes near a chosen one, for a second look."""
        return []

    def further(self, shape: Shape) -> Sequence[Shape]:
        """Shapes that have more to them, to be tried once the best of the plain ones is found."""
        return []

    def grown(self, shape: Shape) -> Sequence[Shape]:
        """The same shape with a number more that the data determine, zero so far; none where that is all."""
        return []

    def around(self, values: Array, shape: Shape) -> Shape:
        """The shape, its columns linear around values."""
        return shape

    def alike(self, shape: Shape) -> int:
        """Number of equally likely ones that differ by their shapes alone; 0 where places are listed."""
        return self.among

    def slope_step(self, name: str, number: float) -> float:
        """By how much a number of the shape is changed for slopes: a share of it."""
        return self.determined[name] * abs(number)

    def unknowns(self, trial: TrialLinear, robot: int, joint: int, shape: Shape) -> Patches:
        """Columns of what the cause leaves open in one trial, such as the friction of a joint at rest."""
        return Patches(trial.residual.shape)

    def place(self, candidate: Candidate) -> str:
        """Robot and joint, of a gimbal its axis, too."""
        if self.at != "gimbal joint" or candidate.joint is None:
            return candidate.place.capitalize()
        return f"Robot {candidate.robot}, gimbal joint {candidate.joint}, axis {GIMBAL_AXES[candidate.joint]}"

    def physical(self, values: Array, context: Context) -> dict[str, float]:
        """The effect's parameters (names as in the simulator) from the columns' values."""
        return dict(zip(self.parameters, values.tolist(), strict=True))

    def report(
        self, values: Array, covariance: Array, context: Context
    ) -> tuple[dict[str, float], dict[str, float]]:
        """The effect's parameters and their standard errors; a shape that was chosen, not determined, has none (NaN).

        Args:
            values: the columns', shape (k,).
            covariance: of the values, then of what is determined of the shape, shape (k + s, k + s) or (k, k).
            context: what else the parameters depend on.
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
        """The effect's parameters a step away, in values and shape."""
        k = len(values)
        named = (name for name in self.determined if name in context.shape)
        further = dict(zip(named, step[k:], strict=False))
        shape = {name: x + further.get(name, 0.0) for name, x in context.shape.items()}
        return self.physical(values + step[:k], replace(context, shape=shape))


class ReadingError(Cause):
    """An error of one robot's readings, linear in the parameters: taken out of the signals, not added to the model."""

    @abstractmethod
    def errors(
        self, signals: Signals, robot: int, joint: int, shape: Shape, arm: Arms
    ) -> Sequence[Mapping[str, Array]]:
        """Per parameter what one unit adds to ``phi``, ``theta``, ``tau`` of the robot, shape (Q, 3) or (3,)."""

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


def one_joint(values: Array, joint: int) -> Array:
    """A signal of one joint among three, shape (Q,) -> (Q, 3)."""
    out = np.zeros((len(values), 3))
    out[:, joint] = values
    return out


def one_robot(values: Array, robots: int, robot: int) -> Array:
    """A signal of one robot among N, shape (Q, 3) -> (Q, N, 3)."""
    out = np.zeros((len(values), robots, 3))
    out[:, robot] = values
    return out


def stack(columns: Sequence[Array]) -> Array:
    """Columns (n, C) side by side, shape (n, C, k)."""
    return np.stack(columns, axis=-1)

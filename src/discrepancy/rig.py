"""What the diagnosis needs to know of a rig: rows, unknowns, causes, and how to resimulate it."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from discrepancy import rules
from estimator.arrays import Array

Numbers = dict[str, float]


@dataclass(frozen=True)
class Parameter:
    """One number of a cause.

    Attributes:
        name: as in the JSON, its unit as suffix.
        tolerance: standard deviation that is normal for such a rig; 0 where the cause is an event, not a tolerance.
        scale: a typical size, in which columns are expressed where the tolerance is 0.
    """

    name: str
    tolerance: float
    scale: float

    @property
    def unit(self) -> float:
        """The size in which the diagnosis counts it."""
        return self.tolerance if self.tolerance > 0 else self.scale


@dataclass(frozen=True)
class Transient:
    """When an event acts.

    Attributes:
        trial: index of its trial, from 0.
        start_s, duration_s: its interval on the trial's clock [s].
    """

    trial: int
    start_s: float
    duration_s: float

    @property
    def shape(self) -> dict[str, float]:
        """The interval as the shape of a candidate."""
        return {"start_s": self.start_s, "duration_s": self.duration_s}


@dataclass(frozen=True)
class Candidate:
    """One cause at one place.

    Attributes:
        cause: name of the cause.
        family: causes of one family look alike.
        robot, joint: where, counted from 1; None where the cause has no such place.
        parameters: its numbers, in the order of its columns.
        shape: further numbers that change the columns themselves, by name.
        transient: when it acts, of an event; None of what lasts.
        where: the place in words, of what sits at no robot and no joint.
        title: the cause in words (``causes.base.Cause``).
        among: of how many of its kind it is one, where the problem does not list them; 0 where it does.
    """

    cause: str
    family: str
    robot: int | None
    joint: int | None
    parameters: tuple[Parameter, ...]
    shape: Mapping[str, float] = field(default_factory=dict)
    transient: Transient | None = None
    where: str = "payload"
    title: str = ""
    among: int = 0

    def acts_in(self, trial: int) -> bool:
        """Whether it can act in a trial (index from 0)."""
        return self.transient is None or self.transient.trial == trial

    def overlaps(self, other: Candidate) -> bool:
        """Whether both are events of one cause that act at the same time."""
        a, b = self.transient, other.transient
        if a is None or b is None or self.cause != other.cause or a.trial != b.trial:
            return False
        return max(a.start_s, b.start_s) < min(a.start_s + a.duration_s, b.start_s + b.duration_s)

    @property
    def units(self) -> Array:
        """Unit of every parameter, shape (k,)."""
        return np.array([p.unit for p in self.parameters])

    @property
    def place(self) -> str:
        """The place in words."""
        words = [f"robot {self.robot}"] if self.robot else []
        words += [f"joint {self.joint}"] if self.joint else []
        return ", ".join(words) or self.where

    @property
    def kind(self) -> str:
        """The cause in words, wherever it sits: ``friction in a driven joint``."""
        return re.sub(r"\{(.*?)\}", r"a \1", self.title) or self.cause.replace("_", " ")

    @property
    def label(self) -> str:
        """The cause at its place, in words: ``friction in joint 1 of robot 2``."""
        if "{" not in self.title:
            return f"{self.kind} ({self.place})" if self.robot else self.kind
        return re.sub(r"\{(.*?)\}", lambda part: self._at(part[1]), self.title)

    def _at(self, part: str) -> str:
        if self.joint:
            return f"{part.removeprefix('driven ')} {self.joint} of robot {self.robot}"
        return f"robot {self.robot}" if part == "robot" else f"the {part} of robot {self.robot}"

    @property
    def key(self) -> tuple[str, int | None, int | None]:
        """Identity: cause and place."""
        return self.cause, self.robot, self.joint


@dataclass(frozen=True, eq=False)
class Rows:
    """One trial's whitened residual and its columns, n rows of C channels.

    Attributes:
        name: the trial.
        residual: shape (n, C); unit variance and independent if nothing is wrong.
        local: columns of the trial's own unknowns, shape (n, C, l).
        shared: columns of the unknowns of all trials, shape (n, C, s).
        causes: one array per candidate, what one unit of each parameter adds, shape (n, C, k).
        time: of every row [s], shape (n,).
        moving: number of leading rows that follow each other at one rate; the rest stand alone. None for all.
        groups: which channels may have noise of one power, a number from 0 for each; None for all.
    """

    name: str
    residual: Array
    local: Array
    shared: Array
    causes: Sequence[Array]
    time: Array
    moving: int | None = None
    groups: Sequence[int] | None = None


@dataclass(frozen=True)
class Channel:
    """One residual channel.

    Attributes:
        name: such as ``grasp 2 rotation x``.
        kind: group that is reported together, such as ``kinematic``.
        robot: whose channel it is, counted from 1, or None.
        unit: physical unit of the unwhitened residual.
    """

    name: str
    kind: str
    robot: int | None
    unit: str


class Rig(ABC):
    """A machine and its simulation, seen by the diagnosis; what a machine may lack has defaults that say so."""

    rigid: ClassVar[tuple[str, ...]] = ()  # causes that are looked for with kinds held, too

    @property
    @abstractmethod
    def trials(self) -> Sequence[str]:
        """Names of the trials."""

    @property
    @abstractmethod
    def channels(self) -> Sequence[Channel]:
        """The residual's channels."""

    @abstractmethod
    def row_rate_hz(self, trial: int) -> float:
        """Rate of a trial's moving rows [Hz]."""

    @abstractmethod
    def quantities(self, trial: int) -> dict[str, Array]:
        """What a misfit may depend on, per row of a trial, shape (n,); one of them is ``speed``."""

    @property
    def local_unknowns(self) -> int:
        """Number of unknowns that every trial has of its own."""
        return 0

    @abstractmethod
    def rows(self, candidates: Sequence[Candidate]) -> Iterable[Rows]:
        """Whitened rows of every trial at the nominal unknowns; they may come one at a time."""

    @abstractmethod
    def columns(self, candidate: Candidate) -> list[Array]:
        """Whitened columns of one candidate (its shape may differ from the catalogue's), one array per trial."""

    @abstractmethod
    def residual(
        self, shared: Array, local: Sequence[Array], active: Sequence[tuple[Candidate, Array]]
    ) -> list[Array]:
        """Exact whitened residual of every trial, with shared and own unknowns moved, causes taken out or modelled."""

    def directions(self, trial: int) -> dict[str, Array]:
        """Orthonormal directions in the whitened channels of what single sources can do, shape (n, C, k)."""
        return {}

    @abstractmethod
    def candidates(self) -> list[Candidate]:
        """Every cause at every place."""

    def unknowns(self, candidate: Candidate) -> list[Array]:
        """Whitened columns of what a cause leaves open in every trial, shape (n, C, k), possibly k = 0."""
        return [columns[..., :0] for columns in self.columns(candidate)]

    def possible(self, candidate: Candidate, values: Array, covariance: Array) -> bool:
        """Whether such values can be: no negative mass, stiffness or friction beyond the errors."""
        return True

    def law_share(self, candidate: Candidate) -> float:
        """Amplitude that the law of a cause leaves of its trace where it is there: a standard deviation."""
        return rules.LAW_SHARE

    def transients(self, remaining: Sequence[Array]) -> list[Candidate]:
        """Causes that act for a while in one trial only, where the whitened residuals (n, C) are worst."""
        return []

    def imitators(self, candidate: Candidate) -> Iterable[list[Array]]:
        """Whitened columns, one array per trial each, of what a candidate must tell more than to be believed."""
        return []

    def refinements(self, candidate: Candidate, *, finer: bool = False) -> list[Candidate]:
        """The same candidate with other shapes, to choose the best from; ``finer`` ones around its own."""
        return []

    def steps(self, candidate: Candidate) -> list[tuple[Candidate, Candidate, float]]:
        """For every number of its shape that the data determine: a little less, a little more, and the difference."""
        return []

    def undecidable(self) -> list[dict[str, Any]]:
        """What recordings of this rig cannot decide, whatever the data: statements with a reason and a remedy."""
        return []

    def relinearised(self, nothing: Any) -> Any:
        """The same rig linear around where a fit (``engine.hypothesis.Hypothesis``) finds it; None where it is near."""
        return None

    @property
    def bench(self) -> Any:
        """What the search for laws needs (``laws.bench.Bench``); None where a rig has no such."""
        return None

    def can_resimulate(self) -> str | None:
        """Why the recordings cannot be resimulated, or None."""
        return None

    def carried(self, candidate: Candidate) -> bool:
        """Whether a simulation has to have a healthy candidate as it is found, as nothing is linear at the design."""
        return False

    @abstractmethod
    def simulation(
        self, trial: int, shared: Array, local: Array, active: Sequence[tuple[Candidate, Array]],
        healthy: Sequence[tuple[Candidate, Array]] = (),
    ) -> Callable[[], dict[str, Array] | None]:  # fmt: skip
        """What resimulates one trial's commands, in any process; ``healthy`` parts are off by so much (``carried``).

        It returns recorded minus simulated response by channel, or None where that cannot be simulated.
        """

    @property
    def resimulated(self) -> Sequence[int]:
        """Trials of which the commands can be simulated again, from where they begin."""
        return range(len(self.trials))

    @abstractmethod
    def response_scale(self, trial: int) -> dict[str, tuple[Array, Array]]:
        """Standard deviation of the noise and of the motion, by channel; shapes broadcast with the response."""

    @abstractmethod
    def effect_parameters(
        self, candidate: Candidate, values: Array, covariance: Array
    ) -> tuple[Numbers, Numbers]:
        """Parameters of the simulator's effect, and their standard errors."""

    @abstractmethod
    def write_extended(self, explanation: Any, folder: Path) -> None:
        """Write the model with the causes in it, for the user to take away."""

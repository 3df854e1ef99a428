"""A cause at a place with its parameters and, for an event, its time interval."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from estimator.arrays import Array


@dataclass(frozen=True)
class Parameter:
    """One parameter of a cause.

    Attributes:
        name: as in the JSON, with the unit as suffix.
        tolerance: standard deviation in a healthy rig; 0 if a healthy rig lacks the cause.
        scale: typical size, the unit of columns with tolerance 0.
    """

    name: str
    tolerance: float
    scale: float

    @property
    def unit(self) -> float:
        """Unit of the parameter in the linear problem."""
        return self.tolerance if self.tolerance > 0 else self.scale


@dataclass(frozen=True)
class Transient:
    """Time interval of an event.

    Attributes:
        trial: index of its trial, from 0.
        start_s, duration_s: interval on the trial's clock [s].
        ramp_s: rise time at the start and fall time at the end [s].
    """

    trial: int
    start_s: float
    duration_s: float
    ramp_s: float = 0.0

    @property
    def shape(self) -> dict[str, float]:
        """The interval as the shape of a candidate."""
        ramp = {"ramp_s": self.ramp_s} if self.ramp_s else {}
        return {"start_s": self.start_s, "duration_s": self.duration_s} | ramp

    def acted(self, time: Array) -> Array:
        """Integral of the event's relative amplitude from the start to given times [s]."""

        def grown(since: Array) -> Array:
            since = np.maximum(since, 0.0)
            if not self.ramp_s:
                return since
            return np.where(since < self.ramp_s, since**2 / (2.0 * self.ramp_s), since - 0.5 * self.ramp_s)

        return grown(time - self.start_s) - grown(time - self.start_s - self.duration_s + self.ramp_s)


@dataclass(frozen=True)
class Candidate:
    """One cause at one place.

    Attributes:
        cause: name of the cause.
        family: causes of one family have similar traces.
        robot, joint: place, counted from 1; None if the cause has no such place.
        parameters: its parameters, in the order of its columns.
        shape: named parameters that its columns depend on nonlinearly. With ``trial`` and ``last_trial`` (from 1,
            0: none) it acts in these trials only.
        transient: time interval of an event; None for a lasting cause.
        where: the place in words, without robot and joint.
        title: the cause in words (``causes.base.Cause``).
        among: number of candidates of its kind if the problem does not list them; 0 if it does.
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

    def in_shape(self, shape: Mapping[str, float]) -> Candidate:
        """Copy with another shape; for an event, with another interval."""
        when = self.transient and replace(self.transient, **shape)
        return replace(self, shape=when.shape if when else dict(shape), transient=when)

    def acts_in(self, trial: int) -> bool:
        """Whether it can act in a trial (index from 0)."""
        if self.transient is not None:
            return self.transient.trial == trial
        last = self.shape.get("last_trial")
        return self.shape.get("trial", 0.0) <= trial + 1 and (not last or trial + 1 <= last)

    @property
    def of_trials(self) -> bool:
        """Whether it acts in some trials only, so that the other trials have no information on it."""
        return self.transient is not None or "trial" in self.shape

    def overlaps(self, other: Candidate) -> bool:
        """Whether both are events of one cause that overlap in time."""
        a, b = self.transient, other.transient
        if not (a and b) or self.cause != other.cause or a.trial != b.trial:
            return False
        return max(a.start_s, b.start_s) < min(a.start_s + a.duration_s, b.start_s + b.duration_s)

    @property
    def tolerant(self) -> list[bool]:
        """Whether each parameter has a tolerance; parameters of events have none."""
        return [parameter.tolerance > 0 and self.transient is None for parameter in self.parameters]

    @property
    def units(self) -> Array:
        """Unit of each parameter, shape (k,)."""
        return np.array([p.unit for p in self.parameters])

    @property
    def place(self) -> str:
        """The place in words."""
        words = [f"robot {self.robot}"] if self.robot else []
        words += [f"joint {self.joint}"] if self.joint else []
        return ", ".join(words) or self.where

    @property
    def kind(self) -> str:
        """The cause in words, without its place: ``friction in a driven joint``."""
        return re.sub(r"\{(.*?)\}", r"a \1", self.title) or self.cause.replace("_", " ")

    @property
    def label(self) -> str:
        """The cause with its place in words: ``friction in joint 1 of robot 2``."""
        if "{" not in self.title:
            return f"{self.kind} ({self.place})" if self.robot else self.kind
        return re.sub(r"\{(.*?)\}", lambda part: self._at(part[1]), self.title)

    def _at(self, part: str) -> str:
        if self.joint:
            joint = f"{part.removeprefix('driven ')} {self.joint}"
            return f"{joint} of robot {self.robot}" if self.robot else joint
        return f"robot {self.robot}" if part == "robot" else f"the {part} of robot {self.robot}"

    @property
    def trace(self) -> tuple[object, ...]:
        """Identity of its effect: cause, place, and shape without the trials."""
        return *self.key, *(
            (name, x) for name, x in self.shape.items() if name not in ("trial", "last_trial")
        )

    @property
    def key(self) -> tuple[str, int | None, int | None]:
        """Identity: cause and place."""
        return self.cause, self.robot, self.joint

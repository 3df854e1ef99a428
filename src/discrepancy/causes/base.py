"""What the causes of every rig have in common: names, sizes, words."""

import inspect
import re
from abc import ABC
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

from discrepancy.candidate import Candidate, Parameter, Transient
from discrepancy.causes.numbers import Numbers, number

Shape = Mapping[str, float]


class Cause(ABC):
    """One physical cause, as the diagnosis and the report know it.

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

    def place(self, candidate: Candidate) -> str:
        """Where it is, as a sentence begins."""
        return candidate.place.capitalize()

    def sentence(self, n: Numbers) -> str:
        """What it does, without place and full stop; the first line of its docstring, if it says nothing else."""
        said = (inspect.getdoc(self) or self.name).splitlines()[0].rstrip(".")
        each = ", ".join(f"{name} = {number(value, n.se.get(name), '')}" for name, value in n.values.items())
        return f"{said} ({each})"

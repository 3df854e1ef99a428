"""What the diagnosis needs to know of a rig: rows, unknowns, causes, and how to resimulate it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.law_doubt import LawDoubt
from discrepancy.least_squares.patches import Patches
from estimator.arrays import Array
from estimator.errors import InputError

Numbers = dict[str, float]


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

    rigid: ClassVar[tuple[str, ...]] = ()  # looked for with kinds held, too; can be in some shapes only
    shaped: ClassVar[
        tuple[str, ...]
    ] = ()  # causes that have a tolerance, and a shape without which they may not show
    reshaped: ClassVar[tuple[str, ...]] = ()  # the same, where what is healthy would have that shape, too
    coarse: ClassVar[tuple[str, ...]] = ()  # causes of which a scan has shapes that are far apart
    plain_first: ClassVar[tuple[str, ...]] = ()  # causes with more to them only where there is any
    more_share: ClassVar[Mapping[str, float]] = {}  # of what plain ones are worth, that more to them must add
    apart: ClassVar[tuple[str, ...]] = ()  # numbers of shapes that leave something else open than others do
    behind: ClassVar[tuple[str, ...]] = ()  # causes with a shape that shows only beside what they leave open
    curved: ClassVar[bool] = False  # whether exact residuals hold what is within its tolerance, too
    layered: ClassVar[bool] = False  # whether the shapes of causes show beside all others only
    missed: float = 0.0  # chi-square per n that columns missed here, from where they were made linear again
    beside: bool = False  # whether that is where unknowns and machines are found beside causes
    rewhitened: bool = False  # whether its noise is another than before that
    normal: ClassVar[bool] = False  # whether a simulation has what is normal as the other trials have it
    whole: ClassVar[bool] = False  # whether one can have every healthy part as it is found

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
    def columns(self, candidate: Candidate) -> Sequence[Array]:
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

    def unknowns(self, candidate: Candidate) -> Sequence[Patches]:
        """Whitened columns of what a cause leaves open in every trial, possibly none."""
        return [Patches(columns.shape[:2]) for columns in self.columns(candidate)]

    def possible(self, candidate: Candidate, values: Array, covariance: Array) -> bool:
        """Whether such values can be: no negative mass, stiffness or friction beyond the errors."""
        return True

    def law_doubt(self, candidate: Candidate) -> LawDoubt:
        """How far the law of a cause may be from that of a real one."""
        return LawDoubt()

    def other_forms(
        self, candidate: Candidate, values: Array, there: Sequence[tuple[Candidate, Array]],
        rival: Candidate | None = None,
    ) -> list[Array] | None:  # fmt: skip
        """Whitened columns (n, C, k) per trial of what causes that are there leave if their laws have other forms.

        Each of one standard deviation; none where that is no matter for a candidate of such values beside them. With a
        rival only those that matter for it, too. None where the rig knows of no other forms.
        """
        return None

    def charged_alike(self, one: Candidate, other: Candidate) -> bool:
        """Whether the same other forms of what is there matter for two, so that their scores compare."""
        return True

    def transients(self, remaining: Sequence[Array]) -> list[Candidate]:
        """Causes that act for a while in one trial only, where the whitened residuals (n, C) are worst."""
        return []

    def imitators(self, candidate: Candidate) -> Iterable[list[Array]]:
        """Whitened columns, one array per trial each, of what a candidate must tell more than to be believed."""
        return []

    def refinements(self, candidate: Candidate, *, finer: bool = False) -> list[Candidate]:
        """The same candidate with other shapes, to choose the best from; ``finer`` ones around its own."""
        return []

    def further(self, candidate: Candidate) -> list[Candidate]:
        """The same candidate in shapes that have more to them, to try once its own is the best of its kind."""
        return []

    def closer(self, candidate: Candidate) -> list[Candidate]:
        """The same in shapes of which a value is larger for the same trace, little by little; none of most causes."""
        return []

    def grown(self, candidate: Candidate) -> list[Candidate]:
        """The same candidate with a number more to its shape, nought so far, where it may have one."""
        return []

    def recentred(self, candidate: Candidate, values: Array) -> Candidate:
        """The same candidate with the columns of such values, where these are no straight lines all the way."""
        return candidate

    def steps(self, candidate: Candidate) -> list[tuple[Candidate, Candidate, float]]:
        """For every number of its shape that the data determine: a little less, a little more, and the difference."""
        return []

    def bent(self, candidate: Candidate, values: Array) -> tuple[Sequence[Array], Sequence[Array]] | None:
        """Columns of what is no multiple of its values: slopes there, and per unit from nought on; None of others."""
        return None

    @property
    def slopes_vary(self) -> bool:
        """Whether slopes are worth making anew where causes are."""
        return False

    def slopes(self, active: Sequence[tuple[Candidate, Array]]) -> Sequence[Sequence[Array] | None]:
        """Columns of causes where all of them have these values; None of those that are what they always are."""
        return [None] * len(active)

    def law_error(self, candidate: Candidate, values: Array) -> Array:
        """What the law's own error puts values and then the numbers that ``steps`` changes off, standard deviations."""
        return np.append(rules.LAW_ERROR_SHARE * np.abs(values), np.zeros(len(self.steps(candidate))))

    def undecidable(self) -> list[dict[str, Any]]:
        """What recordings of this rig cannot decide, whatever the data: statements with a reason and a remedy."""
        return []

    def relinearised(self, found: Any) -> Any:
        """The same rig linear around where a fit (``inference.hypothesis.Hypothesis``) finds it; None where near."""
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

    def write_as_found(self, explanation: Any, folder: Path) -> None:
        """Write the same with every healthy part as it is found, too.

        Raises:
            InputError: the rig has no such model (``whole``).
        """
        raise InputError("a model with every part as it is found is there of a team only")

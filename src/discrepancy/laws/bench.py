"""What a rig offers to the search for laws."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.laws.candidate import LawCandidate
from discrepancy.laws.place import Place
from discrepancy.laws.term import Term
from discrepancy.laws.variable import Variable
from estimator.arrays import Array


class Bench(ABC):
    """Places, signals, and what an error at a place does to the rows.

    Attributes:
        places: all of them.
        variables: all signals, time among them.
        left: share of the trace of a named cause, in amplitude, that its law is expected to leave at most.
    """

    places: Sequence[Place]
    variables: Sequence[Variable]
    left: float = rules.LAW_SHARE

    @abstractmethod
    def rate_hz(self, trial: int) -> float:
        """Of a trial's signals [Hz]."""

    @abstractmethod
    def length(self, trial: int) -> int:
        """Samples Q of a trial."""

    @abstractmethod
    def row_times(self, trial: int) -> Array:
        """Middle of every row since the trial's first sample [s], shape (n,)."""

    @abstractmethod
    def signal(self, trial: int, variable: Variable) -> Array:
        """Values of a signal, shape (Q,)."""

    @abstractmethod
    def at_rows(self, trial: int, errors: Array, *, rates: bool) -> Array:
        """Errors as functions of time, shape (Q, k), at the rows: value (rate, acceleration), shape (n, 1 or 3, k)."""

    @abstractmethod
    def directions(self, trial: int, place: Place) -> Array:
        """What value, rate and acceleration of an error do, shape (n, components, 3 or 1, C), not whitened.

        The last but one is 1 where rates do nothing.
        """

    @abstractmethod
    def white(self, trial: int, columns: Array) -> Array:
        """Whitened columns, shape (n, C, k) -> the same."""

    def beside(self, place: Place, cause: Candidate, *, named: bool) -> bool:
        """Whether what the law of a listed cause leaves, a named or a tolerated one, may show as a law at a place."""
        return False

    def is_form(self, law: LawCandidate, cause: Candidate) -> bool:
        """Whether a law is what a listed cause would be called if it were listed in another form."""
        return False

    def twin(self, place: Place) -> Place | None:
        """Another place whose rows are the same, minus these, or None."""
        return None

    def of_term(self, trial: int, term: Term) -> Array:
        """Values of a formula in a trial, shape (Q, k): one amplitude each."""
        return term.values(lambda variable: self.signal(trial, variable), self.rate_hz(trial))

    def values(self, trial: int, candidate: LawCandidate) -> Array:
        """What one unit of each of a law's amplitudes is, as a function of time, shape (Q, k)."""
        return self.with_offset(candidate.at, candidate.term, self.of_term(trial, candidate.term))

    def with_offset(self, place: Place, term: Term, values: Array) -> Array:
        """A formula's values, shape (Q, k), and a constant beside them where the place wants one."""
        if not place.offset or term.function in ("constant", "spline"):
            return values
        return np.concatenate([values, np.ones((len(values), 1))], axis=1)

    def columns(self, trial: int, candidate: LawCandidate) -> Array:
        """What a law adds to the residual, one column an amplitude, components side by side, shape (n, C, k)."""
        return self.moved(trial, self.directions(trial, candidate.at), self.values(trial, candidate))

    def moved(self, trial: int, directions: Array, errors: Array) -> Array:
        """What errors (Q, k) in each of a place's directions add to the residual, shape (n, C, k components)."""
        return along(directions, self.at_rows(trial, errors, rates=directions.shape[2] == 3))


def along(directions: Array, at_rows: Array) -> Array:
    """What errors at the rows (n, 1 or 3, k) in each of a place's directions add, shape (n, C, k components)."""
    columns = np.einsum("narc,nrk->ncka", directions, at_rows, optimize=True)
    return np.asarray(columns.reshape(*columns.shape[:2], -1))

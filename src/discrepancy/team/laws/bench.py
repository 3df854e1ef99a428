"""A team of Omnids for the search for laws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from discrepancy.candidate import Candidate
from discrepancy.laws.bench import Bench
from discrepancy.laws.candidate import LawCandidate
from discrepancy.laws.place import Place
from discrepancy.laws.variable import Variable
from discrepancy.least_squares.whitening import Whitening
from discrepancy.team.causes.base import one_joint, one_robot
from discrepancy.team.laws.directions import directions_at
from discrepancy.team.laws.misreading import Misreading
from discrepancy.team.laws.places import READINGS, indices_of, is_reading, own_reading, places_of, twin_of
from discrepancy.team.laws.variables import signals_of, variables_of
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arrays import Array

_NUMBERS = {
    "phi_zero", "theta_zero", "link_length", "base_tilt", "sea_bias", "sea_scale", "clock_delay", "torque_skew"
}  # fmt: skip
"""Causes that are numbers of the machine, not laws."""
_RUBBING = {
    "joint_friction": (("tau reading", "driven torque"), "phi"),
    "gimbal_friction": (("gimbal torque",), "theta"),
    "sea_hysteresis": (("tau reading",), "tau"),
}
"""Places where friction is a torque, and the signal whose change it follows."""


class TeamBench(Bench):
    """Places, signals and rows of a team; see ``discrepancy.laws.bench.Bench``.

    Args:
        linear: linearised trials.
        whitening: of every trial.
    """

    def __init__(self, linear: Sequence[TrialLinear], whitening: Sequence[Whitening]) -> None:
        self._linear, self._whitening = linear, whitening
        self._signals: dict[int, dict[str, Array]] = {}
        self.places = places_of(linear[0].robots)
        self.variables = variables_of(linear[0].robots)

    def rate_hz(self, trial: int) -> float:
        return self._linear[trial].signals.rate_hz

    def length(self, trial: int) -> int:
        return len(self._linear[trial].signals.time)

    def row_times(self, trial: int) -> Array:
        linear = self._linear[trial]
        return linear.reduction.time - linear.signals.time[0]

    def signal(self, trial: int, variable: Variable) -> Array:
        if trial not in self._signals:
            self._signals[trial] = signals_of(self._linear[trial])
        return self._signals[trial][variable.name]

    def at_rows(self, trial: int, errors: Array, *, rates: bool) -> Array:
        linear = self._linear[trial]
        if not rates:
            return linear.reduction(errors)[:, None]
        parts = linear.signals.with_rates(errors)
        return np.stack([linear.reduction(part) for part in parts], axis=1)

    def columns(self, trial: int, candidate: LawCandidate) -> Array:
        """What a law adds to the residual, one column an amplitude, components side by side, shape (n, C, k)."""
        if not is_reading(candidate.at):
            return super().columns(trial, candidate)
        return self._of_reading(trial, candidate.at, self.values(trial, candidate))

    def _of_reading(self, trial: int, place: Place, errors: Array) -> Array:
        """What errors (Q, k) of a reading add to the residual, shape (n, C, k)."""
        linear, kind, robot, joint = self._linear[trial], READINGS[place.name], *indices_of(place)
        return np.stack([linear.of_signals(robot, **{kind: one_joint(x, joint)}) for x in errors.T], axis=2)

    def misreading(self, trial: int, candidate: LawCandidate, signals: Signals) -> Misreading:
        """A law of what is read in a trial, out of such readings."""
        place, (robot, joint) = candidate.at, indices_of(candidate.at)
        read = signals.with_rates(getattr(signals, READINGS[place.name])[:, robot, joint])[0]

        def values(true: Array) -> Array:
            seen = {own_reading(place): true}
            term = candidate.term.values(
                lambda v: seen[v.name] if v.name in seen else self.signal(trial, v), self.rate_hz(trial)
            )
            return self.with_offset(place, candidate.term, term)

        return Misreading(read, values)

    def reading_error(
        self, trial: int, candidate: LawCandidate, amplitudes: Array, signals: Signals
    ) -> dict[str, Array] | None:
        """What a law of a reading adds to ``phi``, ``theta`` or ``tau``, shape (Q, N, 3); None of another place.

        Args:
            trial: from 0.
            candidate: the law.
            amplitudes: its values.
            signals: what is read, without noise where that is known.
        """
        place = candidate.at
        if not is_reading(place):
            return None
        seen, (robot, joint) = self.misreading(trial, candidate, signals), indices_of(place)
        error = one_joint(seen.read - seen.true(amplitudes), joint)
        return {READINGS[place.name]: one_robot(error, self._linear[trial].robots, robot)}

    def bent(self, trial: int, candidate: LawCandidate, amplitudes: Array) -> tuple[Array, Array] | None:
        """Columns of a law of the very signal that is read, shape (n, C, k): its slopes, and per unit from nought on.

        None of another law, which is a multiple of its amplitudes.
        """
        place = candidate.at
        if not is_reading(place) or own_reading(place) not in candidate.term.variables:
            return None
        seen = self.misreading(trial, candidate, self._linear[trial].signals)
        each = seen.slopes(amplitudes), seen.values(seen.true(amplitudes))
        return self._of_reading(trial, place, each[0]), self._of_reading(trial, place, each[1])

    def directions(self, trial: int, place: Place) -> Array:
        return directions_at(self._linear[trial], place)

    def white(self, trial: int, columns: Array) -> Array:
        return self._whitening[trial](columns)

    def beside(self, place: Place, cause: Candidate, *, named: bool) -> bool:
        """At the same robot, of tolerated ones at the same joint; and whatever is named shows in the payload, too.

        Numbers of the geometry and of a linear reading have no form that could be another.
        """
        if cause.cause in _NUMBERS:
            return False
        if place.robot is None or cause.robot is None:
            return named
        return place.robot == cause.robot and (named or cause.joint is None or place.joint == cause.joint)

    def is_form(self, law: LawCandidate, cause: Candidate) -> bool:
        """Friction, told by the direction of the motion or by how far it gives way before it slides."""
        places, signal = _RUBBING.get(cause.cause, ((), ""))
        here = f"{signal}_{cause.robot}_{cause.joint}", f"{signal}_rate_{cause.robot}_{cause.joint}"
        forms = {("play", here[0]), ("sign", here[1]), ("linear", here[1])}
        return (
            law.at.name in places
            and law.term.times is None
            and (law.term.function, law.term.of.name) in forms
        )

    def twin(self, place: Place) -> Place | None:
        """Another place whose rows are the same, minus these."""
        return twin_of(place)

"""A serial robot for the search for laws."""

from __future__ import annotations

import numpy as np

from discrepancy.candidate import Candidate
from discrepancy.laws.bench import Bench
from discrepancy.laws.candidate import LawCandidate
from discrepancy.laws.place import Place
from discrepancy.laws.term import Term
from discrepancy.laws.variable import Variable
from discrepancy.rules import serial as rules
from discrepancy.serial.candidate import SerialCandidate
from discrepancy.serial.laws.places import TORQUE, places_of, signals_of, told_of, variables_of
from discrepancy.serial.logs import Part
from discrepancy.serial.mechanics.regressor import torque_of
from discrepancy.serial.serial_rows import SerialRows
from estimator.arrays import Array
from estimator.filtering import differentiate

_NUMBERS = {
    "armature", "back_emf", "gravity_compensation", "gravity_direction", "joint_zero", "link_com", "link_inertia",
    "link_length", "link_mass", "payload",
}  # fmt: skip
"""Causes that are numbers of the machine, not laws."""
_DRY = {("play", "q"), ("sign", "dq"), ("linear", "direction")}
_BENT = {
    (function, signal) for function in ("linear", "cube", "beyond", "spline") for signal in ("load", "torque")
}
_RUBS = ("friction", "stribeck", "sublinear_friction", "load_friction", "warming")
_FORMS = dict.fromkeys(_RUBS, _DRY) | {
    "sublinear_friction": _DRY | {("spline", "dq")},
    "torque_scale": _BENT,
}
"""Functions and signals of a joint's own torque that are a listed cause in another form."""


class SerialBench(Bench):
    """Torques and positions of the joints, of which every block of a log is a trial.

    What has a memory, such as a play, goes on from block to block; time counts from the log's first sample.

    Args:
        rows: of the logs.
    """

    left = rules.FORM_SHARE

    def __init__(self, rows: SerialRows) -> None:
        self._rows = rows
        hints, joints = rows.hints, rows.joints
        told = told_of(
            rows.model.joints, rows.model.slides, joints, hints.slow, hints.travel, rows.spoilt, rules.LEAST_TRAVEL
        )  # fmt: skip
        self.places, self.variables = places_of(told), variables_of(told)
        self._signals: dict[int, dict[str, Array]] = {}
        self._last: dict[int, tuple[Term, Array]] = {}
        self._directions: dict[tuple[int, int], Array] = {}

    def _of(self, trial: int) -> tuple[Part, slice]:
        part, k = self._rows.block_of[trial]
        return part, part.blocks[k]

    def rate_hz(self, trial: int) -> float:
        return self._of(trial)[0].signals.rate_hz

    def length(self, trial: int) -> int:
        block = self._of(trial)[1]
        return block.stop - block.start

    def row_times(self, trial: int) -> Array:
        part, block = self._of(trial)
        return self._rows.row_times(trial) - part.signals.time[block.start]

    def signal(self, trial: int, variable: Variable) -> Array:
        part, block = self._of(trial)
        return self._in_log(part, variable)[block]

    def _in_log(self, part: Part, variable: Variable) -> Array:
        if id(part) not in self._signals:
            self._signals[id(part)] = signals_of(part.signals)
        return self._signals[id(part)][variable.name]

    def of_term(self, trial: int, term: Term) -> Array:
        """Values of a formula in a block, shape (Q, k), of a formula that runs through the whole log."""
        part, block = self._of(trial)
        term_, values = self._last.get(id(part), (None, np.zeros((0, 0))))
        if term_ != term:
            values = term.values(lambda variable: self._in_log(part, variable), part.signals.rate_hz)
            self._last[id(part)] = term, values
        return values[block]

    def at_rows(self, trial: int, errors: Array, *, rates: bool) -> Array:
        part, k = self._rows.block_of[trial]
        kernel = part.reduction.of_block(k, part.blocks[k])
        if not rates:
            return np.asarray(kernel @ errors)[:, None]
        rate = part.signals.rate_hz
        once = differentiate(errors, rate)
        return np.stack([kernel @ x for x in (errors, once, differentiate(once, rate))], axis=1)

    def directions(self, trial: int, place: Place) -> Array:
        assert place.joint is not None
        samples, joint = len(self._rows.row_times(trial)), place.joint - 1
        if place.name == TORQUE:
            return np.tile(np.asarray(self._rows.joints == joint, dtype=float), (samples, 1, 1, 1))
        if (trial, joint) not in self._directions:
            self._directions[trial, joint] = -self._by_position(trial, joint)[:, None]
        return self._directions[trial, joint]

    def _by_position(self, trial: int, joint: int) -> Array:
        """Torques that the model asks for per unit of a position, rate and acceleration, shape (n, 3, C)."""
        part, k = self._rows.block_of[trial]
        s, at = part.signals, part.reduction.samples[k]
        state, out = (s.q[at], s.dq[at], s.ddq[at]), []
        for order, step in enumerate((rules.STEP_RAD, rules.STEP_RATE, rules.STEP_ACCELERATION)):
            ends = []
            for sign in (1.0, -1.0):
                moved = [x.copy() for x in state]
                moved[order][:, joint] += sign * step
                ends.append(torque_of(s.tree, *moved) + s.tree.armature * moved[2])
            out.append((ends[0] - ends[1])[:, self._rows.joints] / (2.0 * step))
        return np.stack(out, axis=1)

    def white(self, trial: int, columns: Array) -> Array:
        return self._rows.whitening[trial](columns)

    def beside(self, place: Place, cause: Candidate, *, named: bool) -> bool:
        """At the same joint; and what is named of the whole arm shows everywhere.

        Numbers of the machine have no form that could be another.
        """
        assert isinstance(cause, SerialCandidate)
        if cause.cause in _NUMBERS:
            return False
        if cause.joint is None:
            return named
        return place.joint in (cause.joint, cause.partner)

    def is_form(self, law: LawCandidate, cause: Candidate) -> bool:
        """Friction told by how far it gives way before it slides; a reading whose scale bends."""
        term, joint = law.term, cause.joint
        return (
            (law.at.name, law.joint) == (TORQUE, joint)
            and term.times is None
            and any(
                (term.function, term.of.name) == (f, f"{s}_{joint}") for f, s in _FORMS.get(cause.cause, ())
            )
        )

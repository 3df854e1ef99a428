"""The axis for the search for laws."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from discrepancy.emps.causes.base import filtered
from discrepancy.emps.causes.sliding import SLOW, direction
from discrepancy.laws.bench import Bench
from discrepancy.laws.place import Place
from discrepancy.laws.term import Term
from discrepancy.laws.variable import TIME, Variable
from estimator.arrays import Array

if TYPE_CHECKING:
    from discrepancy.emps.rig import EmpsRig

FORCE, VOLTAGE = "axis force", "loop voltage"
CHANNELS = (FORCE, VOLTAGE)


def variables_of(travel_m: float) -> list[Variable]:
    """Signals of the axis; position and velocity as the log has them, time on its clock.

    Args:
        travel_m: range of positions.
    """
    slow = SLOW[0]["slow_mps"]
    return [
        TIME,
        Variable("position", "position of the axis", "x", "m", "travel", slow, 2.0 * np.pi / travel_m),
        Variable("velocity", "velocity of the axis", "x'", "m/s", "rate", slow),
        Variable("acceleration", "acceleration of the axis", "x''", "m/s^2", "acceleration"),
        Variable("direction", "direction of motion of the axis", "sign(x')", "1", "direction"),
        Variable("error", "position error", "e", "m", "position"),
    ]


def places_of(variables: list[Variable]) -> list[Place]:
    """What the drive is told beyond what the motion needs, and beyond what the loop's law asks for."""
    moving = tuple(v for v in variables if v.name in ("position", "velocity", "acceleration", "direction"))
    error = tuple(v for v in variables if v.name == "error")
    # The position error is what the loop makes its voltage of, and so the force: that one is no function of it.
    return [
        Place(FORCE, None, None, ("force",), ("",), "N", "force at the axis, told or acting", moving, without=error,
              where="axis"),
        Place(VOLTAGE, None, None, ("voltage",), ("",), "V", "voltage between the loop's law and the drive",
              (*error, *moving), offset=True, where="axis"),
    ]  # fmt: skip


class AxisBench(Bench):
    """Force and voltage of the axis, of which every block of the recording is a trial.

    What has a memory, such as a play, goes on from block to block.

    Args:
        rig: the recording.
    """

    def __init__(self, rig: EmpsRig) -> None:
        self._rig, s = rig, rig.signals
        self.variables = variables_of(float(np.ptp(s.x)))
        self.places = places_of(self.variables)
        self._signals = {
            TIME.name: rig.log.time, "position": s.x, "velocity": s.v, "acceleration": s.a,
            "direction": direction(s, SLOW[0]["slow_mps"]), "error": s.error,
        }  # fmt: skip
        self._last: tuple[Term | None, Array] = (None, np.zeros((0, 0)))

    def rate_hz(self, trial: int) -> float:
        return self._rig.log.rate_hz

    def length(self, trial: int) -> int:
        block = self._rig.blocks[trial]
        return block.stop - block.start

    def row_times(self, trial: int) -> Array:
        time = self._rig.log.time
        return time[self._rig.reduction.samples[trial]] - time[self._rig.blocks[trial].start]

    def signal(self, trial: int, variable: Variable) -> Array:
        return self._signals[variable.name][self._rig.blocks[trial]]

    def of_term(self, trial: int, term: Term) -> Array:
        """Values of a formula in a block, shape (Q, k), of a formula that runs through the whole recording."""
        if self._last[0] != term:
            values = term.values(lambda variable: self._signals[variable.name], self._rig.log.rate_hz)
            self._last = term, filtered(self._rig.signals, values)
        return self._last[1][self._rig.blocks[trial]]

    def at_rows(self, trial: int, errors: Array, *, rates: bool) -> Array:
        return self._rig.reduction.of_block(trial, errors, self._rig.blocks[trial].start)[:, None]

    def directions(self, trial: int, place: Place) -> Array:
        channel = np.array([place.name == name for name in CHANNELS], dtype=float)
        return np.tile(channel, (len(self._rig.reduction.samples[trial]), 1, 1, 1))

    def white(self, trial: int, columns: Array) -> Array:
        return self._rig.whitening[trial](columns)

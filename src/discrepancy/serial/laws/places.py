"""Where at a serial robot something may be wrong that no cause lists, and signals that it may be a function of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from discrepancy.laws.place import Place
from discrepancy.laws.variable import TIME, Kind, Variable
from discrepancy.serial.candidate import told_name
from discrepancy.serial.rows.signals import Signals
from estimator.arrays import Array

TORQUE, POSITION = "joint torque", "joint position"
_SIGNALS: dict[str, tuple[str, str, str, str]] = {
    "q": ("position of {}", "q_{}", "rad", "m"),
    "dq": ("rate of {}", "q_{}'", "rad/s", "m/s"),
    "ddq": ("acceleration of {}", "q_{}''", "rad/s^2", "m/s^2"),
    "direction": ("direction of motion of {}", "sign(q_{}')", "1", "1"),
    "load": ("torque that the masses behind {} ask for", "load_{}", "N m", "N"),
    "torque": ("torque of {}", "tau_{}", "N m", "N"),
}
"""Words, symbol, and units of a joint that turns and of one that slides."""
_KINDS: dict[str, Kind] = {
    "dq": "rate", "ddq": "acceleration", "direction": "direction", "load": "torque", "torque": "torque"
}  # fmt: skip


@dataclass(frozen=True)
class Told:
    """What the logs tell of a joint.

    Attributes:
        number: from 1.
        called: its name in the model.
        slide: whether it slides.
        torque: whether its torque is read.
        moves: whether it moves.
        rates, accelerations: whether these stand out of the noise of its position.
        slow: speed below which its direction fades.
        travel: range of its positions.
    """

    number: int
    called: str
    slide: bool
    torque: bool
    moves: bool
    rates: bool
    accelerations: bool
    slow: float
    travel: float

    @property
    def words(self) -> str:
        """The joint in words: ``joint 3 (elbow)``."""
        return f"joint {self.number}{told_name(self.number, self.called)}"

    @property
    def unit(self) -> str:
        """Of its torque."""
        return "N" if self.slide else "N m"

    def variable(self, name: str) -> Variable:
        """One of its signals."""
        words, symbol, turning, sliding = _SIGNALS[name]
        kind = _KINDS.get(name, "travel" if self.slide else "angle")
        wave = 2.0 * np.pi / self.travel if kind == "travel" else 1.0
        return Variable(
            f"{name}_{self.number}", words.format(self.words), symbol.format(self.number),
            sliding if self.slide else turning, kind, self.slow, wave,
        )  # fmt: skip

    @property
    def signals(self) -> list[Variable]:
        """All of them that are told, the torque that is read at the end."""
        moving = ["q", *["dq", "direction"] * self.rates, *["ddq"] * self.accelerations] if self.moves else []
        return [self.variable(name) for name in (*moving, "load", *["torque"] * self.torque)]


def variables_of(joints: Sequence[Told]) -> list[Variable]:
    """All signals of all joints, and time."""
    return [TIME, *(variable for joint in joints for variable in joint.signals)]


def places_of(joints: Sequence[Told]) -> list[Place]:
    """Every torque that is read, and every position that moves; the rows know no torque from its reading."""
    out, every = [], [variable for joint in joints for variable in joint.signals]
    for joint in joints:
        own = tuple(v for v in joint.signals if not v.name.startswith("torque_"))
        read = tuple(v for v in joint.signals if v.name.startswith("torque_"))
        name = told_name(joint.number, joint.called)
        if joint.torque:
            out.append(
                Place(TORQUE, None, joint.number, (f"torque_{joint.number}",), ("",), joint.unit,
                      "torque of {joint}, read or acting", own, without=read, where="arm", called=name)
            )  # fmt: skip
        if joint.moves and joint.accelerations:
            # Its acceleration counts: what is differentiated already would be noise.
            where = tuple(v for v in own if v.name.startswith("q_"))
            rest = tuple(v for v in every if v not in where)
            out.append(
                Place(POSITION, None, joint.number, (f"position_{joint.number}",), ("",), "m" if joint.slide else "rad",
                      "reading of the position of {joint}", where, without=rest, where="arm", called=name)
            )  # fmt: skip
    return out


def signals_of(signals: Signals) -> dict[str, Array]:
    """Values of all of them in one log, shape (W,) each."""
    values = {
        "q": signals.q,
        "dq": signals.dq,
        "ddq": signals.ddq,
        "direction": signals.direction(signals.slow),
        "load": signals.inverse - signals.tree.armature * signals.ddq,
        "torque": signals.torque,
    }
    out = {f"{name}_{j + 1}": x for name, each in values.items() for j, x in enumerate(each.T)}
    return out | {TIME.name: signals.time - signals.time[0]}


def told_of(
    names: Sequence[str], slides: NDArray[np.bool_], joints: NDArray[np.intp], slow: Array, travel: Array,
    spoilt: frozenset[tuple[str, int | None, int | None]], least_travel: float,
) -> list[Told]:  # fmt: skip
    """What the logs tell of every joint.

    Args:
        names: of all joints.
        slides: which slide, shape (J,).
        joints: those with torques, from 0.
        slow, travel: of every joint, shape (J,).
        spoilt: causes and joints that noise of the positions hides.
        least_travel: below which a joint does not move.
    """
    hidden = lambda cause, j: (cause, None, j + 1) in spoilt  # noqa: E731
    return [
        Told(
            j + 1, name, bool(slides[j]), bool(np.isin(j, joints)), bool(travel[j] > least_travel),
            not hidden("friction", j), not hidden("armature", j), float(slow[j]), float(travel[j]),
        )
        for j, name in enumerate(names)
    ]  # fmt: skip

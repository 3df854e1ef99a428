"""A formula at a place of a machine: an amplitude times a function of a signal, possibly times another signal."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Self

from estimator.errors import InputError
from estimator.strict import Fields
from mocobot_sim.laws.functions import FUNCTIONS, Inside, check_numbers

Signal = Callable[[str], float]
"""What a signal is now, by its name."""
TEXTS, NUMBERS = ("target", "function", "of", "times"), ("amplitude", "number", "second", "phase_rad")


@dataclass(frozen=True)
class Formula:
    """``amplitude`` times a function of a signal, and times another signal where one is named, added to a target.

    Attributes:
        targets, signals: what a machine's names of these look like, and in words for messages.
        target: what it adds to.
        function: as in ``functions.FUNCTIONS``.
        of, times: signals, all in SI; ``times`` is empty where there is none.
        amplitude: in the target's unit over those of the signals.
        number, second, phase_rad: what the function has inside (docs/effects.md).
    """

    targets: ClassVar[tuple[re.Pattern[str], str]]
    signals: ClassVar[tuple[re.Pattern[str], str]]
    target: str
    function: str
    of: str
    amplitude: float
    number: float = 0.0
    second: float = 0.0
    phase_rad: float = 0.0
    times: str = ""

    def __post_init__(self) -> None:
        """Check names and numbers.

        Raises:
            InputError: a name is not known, or a number is not allowed with this function.
        """
        self._known("target", *self.targets)
        self._known("function", re.compile("|".join(FUNCTIONS)), ", ".join(FUNCTIONS))
        self._known("of", *self.signals)
        if self.times:
            self._known("times", *self.signals)
        check_numbers(self.function, self.number, self.second)

    def _known(self, name: str, pattern: re.Pattern[str], words: str) -> None:
        value = getattr(self, name)
        if not pattern.fullmatch(value):
            raise InputError(f"law: {name} is {value!r:.60}; it must be one of {words}")

    def running(self, period_s: float) -> Callable[[Signal], float]:
        """Its values, one at every step of a period; what has a memory begins anew."""
        function = FUNCTIONS[self.function](Inside(self.number, self.second, self.phase_rad, period_s))

        def value(signal: Signal) -> float:
            out = self.amplitude * function(signal(self.of))
            return out * signal(self.times) if self.times else out

        return value

    def to_dict(self) -> dict[str, str | float]:
        """Plain JSON values."""
        return asdict(self)

    @classmethod
    def of_dict(cls, values: Mapping[str, Any], where: str) -> Self:
        """From plain JSON values.

        Raises:
            InputError: they are no formula.
        """
        entry = Fields(values, (*TEXTS, *NUMBERS), where)
        target, function, of, times = (str(entry.values[key]) for key in TEXTS)
        return cls(target, function, of, *(entry.number(key) for key in NUMBERS), times)

"""What an error may be a function of: signals of the machine, each with a name that the simulator knows, too."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

LAW_SLOW_RAD_PER_S = 4e-3
"""Below which a direction of motion fades. Chosen: as in the friction of the catalogue."""

Kind = Literal[
    "time", "angle", "travel", "rate", "acceleration", "torque", "direction", "position", "velocity", "tilt", "vector"
]  # fmt: skip


@dataclass(frozen=True)
class Variable:
    """One signal.

    Attributes:
        name: as in the JSON and in the simulator's effect ``law``, such as ``phi_2_1``.
        words: for people, such as ``angle of driven joint 1 of robot 2``.
        symbol: in a formula.
        unit: of its values.
        kind: decides which functions of it make sense.
        slow: of a rate, below which its direction fades [``unit``].
        wave: of an angle or a travel, by which the phase of its slowest sine grows [rad per ``unit``]: once a turn, or
            once over the whole way.
        parts: of a vector, its components; a law by all of them has no direction that was chosen beforehand.
        turns: of what is felt at the origin, the turn accelerations that change it elsewhere, component by component.
    """

    name: str
    words: str
    symbol: str
    unit: str
    kind: Kind
    slow: float = LAW_SLOW_RAD_PER_S
    wave: float = 1.0
    parts: tuple[Variable, ...] = ()
    turns: tuple[Variable, ...] = ()

    @property
    def each(self) -> tuple[Variable, ...]:
        """Its components, or itself."""
        return (*self.parts, *self.turns) or (self,)

    @property
    def axes(self) -> tuple[str, ...]:
        """Of a vector, what its components' names end with."""
        return tuple(part.name.removeprefix(f"{self.name}_") for part in self.parts)


TIME = Variable("time", "time", "t", "s", "time")
"""Since the trial began."""

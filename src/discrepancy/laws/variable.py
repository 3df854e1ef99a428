"""What an error may be a function of: signals of the machine, each with a name that the simulator knows, too."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal["time", "angle", "rate", "acceleration", "torque", "position", "velocity", "tilt"]


@dataclass(frozen=True)
class Variable:
    """One signal.

    Attributes:
        name: as in the JSON and in the simulator's effect ``law``, such as ``phi_2_1``.
        words: for people, such as ``angle of driven joint 1 of robot 2``.
        symbol: in a formula.
        unit: of its values.
        kind: decides which functions of it make sense.
    """

    name: str
    words: str
    symbol: str
    unit: str
    kind: Kind


TIME = Variable("time", "time", "t", "s", "time")
"""Since the trial began."""

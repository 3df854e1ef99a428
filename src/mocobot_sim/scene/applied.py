"""What a scene has to know of the effects in it: what they are, for the record, and which of them push."""

from typing import ClassVar, Protocol, runtime_checkable

import mujoco
import numpy as np


class Applied(Protocol):
    """One effect: its cause, its place and its parameters are attributes."""

    cause: ClassVar[str]

    @classmethod
    def place_names(cls) -> tuple[str, ...]:
        """``robot`` and ``joint``, as far as it has them."""
        ...

    @classmethod
    def parameter_names(cls) -> tuple[str, ...]:
        """Names of the parameters, units in their suffixes."""
        ...


@runtime_checkable
class Pushing(Protocol):
    """An effect that MJCF cannot express: it acts on the payload during one trial."""

    @property
    def trial(self) -> int:
        """Which trial, from 1."""
        ...

    def act(self, model: mujoco.MjModel, data: mujoco.MjData, body: int, R_Wb1: np.ndarray) -> None:
        """Add to ``data.xfrc_applied`` of the payload's body, if it acts at ``data.time``.

        Args:
            model, data: the trial's.
            body: the payload's body id.
            R_Wb1: axes of robot 1's {b} in the world, shape (3, 3).
        """
        ...

"""What a scene has to know of the effects in it: what they are, for the record, and which of them push."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Protocol, runtime_checkable

import numpy as np

if TYPE_CHECKING:
    import mujoco


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

    def acts(self, time: float) -> bool:
        """Whether it acts at a time [s]."""
        ...

    def act(self, data: mujoco.MjData, body: int, R_Wb1: np.ndarray) -> None:
        """Add to ``data.xfrc_applied`` of the payload's body.

        Args:
            data: the trial's, with kinematics of this instant.
            body: the payload's body id.
            R_Wb1: axes of robot 1's {b} in the world, shape (3, 3).
        """
        ...

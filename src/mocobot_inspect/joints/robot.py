"""What an inspection has to know of a robot: no simulator, only what it asks for."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot as its model describes it.

    Attributes:
        joints: names of its J joints.
        slides: whether each slides, shape (J,); the others turn.
        lower, upper: range of each [rad or m], infinite where there is none, shape (J,).
        torque_limit: most that each joint's drive gives [N m or N], infinite where the model does not say, shape (J,).
        inverse: torques without friction from positions and their first two derivatives, (Q, J) each -> (Q, J).
        regressor: from the same, torques per unit of ten inertial parameters of the last link (mass, first moments,
            Ixx, Iyy, Izz, Ixy, Ixz, Iyz about its frame's origin), shape (Q, J, 10).
        mass_kg: of all that moves.
    """

    joints: tuple[str, ...]
    slides: NDArray[np.bool_]
    lower: Array
    upper: Array
    torque_limit: Array
    inverse: Callable[[Array, Array, Array], Array]
    regressor: Callable[[Array, Array, Array], Array]
    mass_kg: float

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each joint's position."""
        return tuple("m" if slides else "rad" for slides in self.slides)

    def asked(self, q: Array, dq: Array, ddq: Array, payload: Array | None) -> Array:
        """Torques of the model and of ten inertial parameters at its last link, shape (Q, J)."""
        own = self.inverse(q, dq, ddq)
        return own if payload is None else own + self.regressor(q, dq, ddq) @ payload

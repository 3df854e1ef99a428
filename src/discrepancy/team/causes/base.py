"""What every cause of the team's catalogue offers the diagnosis."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from discrepancy.team.linear import TrialLinear
from discrepancy.team.signals import Signals

Array = NDArray[np.float64]
Shape = Mapping[str, float]


class Cause(ABC):
    """One physical cause: the trace that one unit of each of its parameters leaves in the residual.

    Attributes:
        name: as in the verdict; the simulator's effect has the same.
        family: causes of one family look alike.
        parameters: names of the columns' parameters, units as suffix.
        scales: typical sizes, for causes that have no tolerance.
        per: ``joint``, ``robot`` or ``payload``: where it can sit.
        shapes: alternatives of what changes the columns themselves; the first is the catalogue's.
        separate: what experiment would tell it from its look-alikes.
    """

    name: ClassVar[str]
    family: ClassVar[str]
    parameters: ClassVar[tuple[str, ...]]
    scales: ClassVar[tuple[float, ...]] = ()
    per: ClassVar[Literal["joint", "robot", "payload"]] = "joint"
    shapes: ClassVar[tuple[Shape, ...]] = ({},)
    separate: ClassVar[str] = ""

    @abstractmethod
    def columns(self, trial: TrialLinear, robot: int, joint: int, shape: Shape) -> Array:
        """Columns of one trial, shape (n, C, k): residual per unit of each parameter.

        Args:
            trial: the linearised trial.
            robot, joint: place, indices from 0 (0 where it has none).
            shape: one of ``shapes``.
        """

    def undo(
        self, signals: Signals, trial: TrialLinear, robot: int, joint: int, values: Array, shape: Shape
    ) -> Signals | None:
        """The signals as they would be without the cause, or None where it is not an error of the signals."""
        return None

    def unknowns(self, trial: TrialLinear, robot: int, joint: int, shape: Shape) -> list[Array]:
        """Columns (n, C) of what the cause leaves open in one trial, such as the friction of a joint at rest."""
        return []

    def report(self, values: Array, covariance: Array) -> tuple[dict[str, float], dict[str, float]]:
        """Values and standard errors by the effect's parameter names."""
        return (
            dict(zip(self.parameters, values.tolist(), strict=True)),
            dict(zip(self.parameters, np.sqrt(np.diag(covariance)).tolist(), strict=True)),
        )


def one_joint(values: Array, joint: int) -> Array:
    """A signal of one joint among three, shape (Q,) -> (Q, 3)."""
    out = np.zeros((len(values), 3))
    out[:, joint] = values
    return out


def one_robot(values: Array, robots: int, robot: int) -> Array:
    """A signal of one robot among N, shape (Q, 3) -> (Q, N, 3)."""
    out = np.zeros((len(values), robots, 3))
    out[:, robot] = values
    return out


def stack(columns: Sequence[Array]) -> Array:
    """Columns (n, C) side by side, shape (n, C, k)."""
    return np.stack(columns, axis=-1)

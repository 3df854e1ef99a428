"""What a calibration looks for: robots, how and what they carry, and where they stood in every trial."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimator.arm.unit import COUNT, ArmUnit
from estimator.arrays import Array
from estimator.rigid_team.residual import Bases, Shared


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Values of everything.

    Attributes:
        units: the robots side by side, ``x`` of shape (N, ``COUNT``).
        carried: grasps and inertial parameters of every payload.
        bases: where the robots stood in every trial.
    """

    units: ArmUnit
    carried: tuple[Shared, ...]
    bases: tuple[Bases, ...]


@dataclass(frozen=True)
class Layout:
    """Where each unknown lies in one vector: robots, then payloads, then trials.

    Attributes:
        robots: number of robots N.
        payloads: number of payloads, 0 where the robots only move freely.
        trials: number of trials with a payload.
    """

    robots: int
    payloads: int
    trials: int

    @property
    def of_units(self) -> slice:
        """All robots, ``COUNT`` each."""
        return slice(0, self.robots * COUNT)

    @property
    def per_payload(self) -> int:
        """Grasps of robots 2 on, and ten inertial parameters."""
        return 6 * (self.robots - 1) + 10

    @property
    def per_trial(self) -> int:
        """Bases of robots 2 on."""
        return 4 * (self.robots - 1)

    def of_payload(self, payload: int) -> slice:
        """One payload's grasps (d_i, e_i for i >= 2), then (m, m c, J about {1})."""
        start = self.of_units.stop + payload * self.per_payload
        return slice(start, start + self.per_payload)

    def of_inertia(self, payload: int) -> slice:
        """The latter part of it."""
        stop = self.of_payload(payload).stop
        return slice(stop - 10, stop)

    def of_trial(self, trial: int) -> slice:
        """One trial's bases (x, y, z, yaw for i >= 2)."""
        start = self.of_payload(self.payloads).start + trial * self.per_trial
        return slice(start, start + self.per_trial)

    @property
    def size(self) -> int:
        """Number of unknowns, held ones included."""
        return self.of_trial(self.trials).start

    def unit_indices(self, places: NDArray[np.intp]) -> NDArray[np.intp]:
        """Where the same entries of ``ArmUnit.x`` of all robots lie, robot by robot."""
        return (np.arange(self.robots)[:, None] * COUNT + places).ravel()

    def moved(self, at: Unknowns, dx: Array) -> Unknowns:
        """Unknowns changed by a step."""
        carried: Sequence[Shared] = [
            shared.moved(dx[self.of_payload(k)]) for k, shared in enumerate(at.carried)
        ]
        bases = [base.moved(dx[self.of_trial(k)]) for k, base in enumerate(at.bases)]
        units = at.units.moved(dx[self.of_units].reshape(self.robots, COUNT))
        return replace(at, units=units, carried=tuple(carried), bases=tuple(bases))

"""Every block of a changed robot's logs with blocks of the reference's, as one trial.

What a trial left out of a fit says for a cause is judged with the unknowns of all logs fitted to that trial. A block of
a changed robot alone cannot tell what has changed from what was wrong before; with blocks of the reference it can.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from discrepancy.candidate import Candidate
from discrepancy.engine.explanation import Explanation
from discrepancy.rig import Channel, Rig, Rows
from discrepancy.serial.rig import SerialRig
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class PairedRig(Rig):
    """A rig of logs and reference, whose trials are blocks of the logs.

    Attributes:
        inner: the same, block by block.
    """

    inner: SerialRig
    rigid = SerialRig.rigid
    shaped = SerialRig.shaped
    curved = SerialRig.curved
    layered = SerialRig.layered
    normal = SerialRig.normal

    def blocks_of(self, trial: int) -> list[int]:
        """Which blocks are one trial, the log's own first; with fewer blocks of the reference some serve twice."""
        changed, count = self.inner.changed, len(self.inner.trials)
        reference = list(range(changed, count))
        return [trial, *(reference[trial::changed] or [reference[trial % len(reference)]])]

    def merged(self, blocks: Sequence[Array]) -> list[Array]:
        """Rows of every trial from those of the blocks."""
        return [np.concatenate([blocks[k] for k in self.blocks_of(t)]) for t in range(self.inner.changed)]

    @property
    def trials(self) -> Sequence[str]:
        return self.inner.trials[: self.inner.changed]

    @property
    def channels(self) -> Sequence[Channel]:
        return self.inner.channels

    def row_rate_hz(self, trial: int) -> float:
        return self.inner.row_rate_hz(trial)

    def quantities(self, trial: int) -> dict[str, Array]:
        each = [self.inner.quantities(k) for k in self.blocks_of(trial)]
        return {name: np.concatenate([own[name] for own in each]) for name in each[0]}

    def directions(self, trial: int) -> dict[str, Array]:
        each = [self.inner.directions(k) for k in self.blocks_of(trial)]
        return {name: np.concatenate([own[name] for own in each]) for name in each[0]}

    def rows(self, candidates: Sequence[Candidate]) -> list[Rows]:
        blocks = list(self.inner.rows(candidates))
        return [self._together([blocks[k] for k in self.blocks_of(t)]) for t in range(self.inner.changed)]

    def _together(self, blocks: Sequence[Rows]) -> Rows:
        counts = [block.local.shape[2] for block in blocks]
        starts = np.cumsum([0, *counts])
        local = []
        for block, start in zip(blocks, starts[:-1], strict=True):
            wide = np.zeros((*block.residual.shape, starts[-1]))
            wide[..., start : start + block.local.shape[2]] = block.local
            local.append(wide)
        return Rows(
            blocks[0].name,
            np.concatenate([block.residual for block in blocks]),
            np.concatenate(local),
            np.concatenate([block.shared for block in blocks]),
            [np.concatenate(own) for own in zip(*(block.causes for block in blocks), strict=True)],
            np.concatenate([block.time for block in blocks]),
        )

    def columns(self, candidate: Candidate) -> list[Array]:
        return self.merged(self.inner.columns(candidate))

    def residual(
        self, shared: Array, local: Sequence[Array], active: Sequence[tuple[Candidate, Array]]
    ) -> list[Array]:
        return self.merged(self.inner.residual(shared, local, active))

    def candidates(self) -> list[Candidate]:
        return self.inner.candidates()

    def possible(self, candidate: Candidate, values: Array, covariance: Array) -> bool:
        return self.inner.possible(candidate, values, covariance)

    def transients(self, remaining: Sequence[Array]) -> list[Candidate]:
        return self.inner.transients([z[: len(self.inner.row_times(t))] for t, z in enumerate(remaining)])

    def refinements(self, candidate: Candidate, *, finer: bool = False) -> list[Candidate]:
        return self.inner.refinements(candidate, finer=finer)

    def steps(self, candidate: Candidate) -> list[tuple[Candidate, Candidate, float]]:
        return self.inner.steps(candidate)

    def undecidable(self) -> list[dict[str, Any]]:
        return self.inner.undecidable()

    def simulation(
        self, trial: int, shared: Array, local: Array, active: Sequence[tuple[Candidate, Array]],
        healthy: Sequence[tuple[Candidate, Array]] = (),
    ) -> Callable[[], dict[str, Array] | None]:  # fmt: skip
        return self.inner.simulation(trial, shared, local, active)

    def response_scale(self, trial: int) -> dict[str, tuple[Array, Array]]:
        return self.inner.response_scale(trial)

    def effect_parameters(
        self, candidate: Candidate, values: Array, covariance: Array
    ) -> tuple[dict[str, float], dict[str, float]]:
        return self.inner.effect_parameters(candidate, values, covariance)

    def write_extended(self, explanation: Explanation, folder: Path) -> None:
        self.inner.write_extended(explanation, folder)

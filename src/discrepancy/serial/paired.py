"""Every block of a changed robot's logs with blocks of the reference's, as one trial.

What a trial left out of a fit says for a cause is judged with the unknowns of all logs fitted to that trial. A block of
a changed robot alone cannot tell what has changed from what was wrong before; with blocks of the reference it can.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from discrepancy.candidate import Candidate
from discrepancy.engine.explanation import Explanation
from discrepancy.law_doubt import LawDoubt
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

    @cached_property
    def _weights(self) -> Array:
        """Of every block's rows: one that serves several times tells once, shape (blocks,)."""
        served = [k for t in range(self.inner.changed) for k in self.blocks_of(t)]
        times = np.bincount(served, minlength=len(self.inner.trials))
        return np.asarray(1.0 / np.sqrt(np.maximum(times, 1)))

    def merged(self, blocks: Sequence[Array]) -> list[Array]:
        """Rows of every trial from those of the blocks."""
        return [
            np.concatenate([self._weights[k] * blocks[k] for k in self.blocks_of(t)])
            for t in range(self.inner.changed)
        ]

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
        return [self._together(blocks, self.blocks_of(t)) for t in range(self.inner.changed)]

    def _together(self, every: Sequence[Rows], which: Sequence[int]) -> Rows:
        blocks, weights = [every[k] for k in which], self._weights[list(which)]

        def stacked(parts: Sequence[Array]) -> Array:
            return np.concatenate([w * part for w, part in zip(weights, parts, strict=True)])

        counts = [block.local.shape[2] for block in blocks]
        starts = np.cumsum([0, *counts])
        local = []
        for block, start in zip(blocks, starts[:-1], strict=True):
            wide = np.zeros((*block.residual.shape, starts[-1]))
            wide[..., start : start + block.local.shape[2]] = block.local
            local.append(wide)
        return Rows(
            blocks[0].name,
            stacked([block.residual for block in blocks]),
            stacked(local),
            stacked([block.shared for block in blocks]),
            [stacked(own) for own in zip(*(block.causes for block in blocks), strict=True)],
            np.concatenate([block.time for block in blocks]),
            groups=blocks[0].groups,
        )

    def columns(self, candidate: Candidate) -> list[Array]:
        return self.merged(self.inner.columns(candidate))

    def residual(
        self, shared: Array, local: Sequence[Array], active: Sequence[tuple[Candidate, Array]]
    ) -> list[Array]:
        return self.merged(self.inner.residual(shared, local, active))

    @property
    def slopes_vary(self) -> bool:
        return self.inner.slopes_vary

    def slopes(self, active: Sequence[tuple[Candidate, Array]]) -> Sequence[Sequence[Array] | None]:
        return [None if own is None else self.merged(own) for own in self.inner.slopes(active)]

    def candidates(self) -> list[Candidate]:
        return self.inner.candidates()

    def law_doubt(self, candidate: Candidate) -> LawDoubt:
        return self.inner.law_doubt(candidate)

    def other_forms(
        self, candidate: Candidate, values: Array, there: Sequence[tuple[Candidate, Array]],
        rival: Candidate | None = None,
    ) -> list[Array]:  # fmt: skip
        forms = self.inner.other_forms(candidate, values, there, rival)
        return self.merged(forms) if forms else []

    def charged_alike(self, one: Candidate, other: Candidate) -> bool:
        return self.inner.charged_alike(one, other)

    def possible(self, candidate: Candidate, values: Array, covariance: Array) -> bool:
        return self.inner.possible(candidate, values, covariance)

    def transients(self, remaining: Sequence[Array]) -> list[Candidate]:
        return self.inner.transients([z[: len(self.inner.row_times(t))] for t, z in enumerate(remaining)])

    def refinements(self, candidate: Candidate, *, finer: bool = False) -> list[Candidate]:
        return self.inner.refinements(candidate, finer=finer)

    def steps(self, candidate: Candidate) -> list[tuple[Candidate, Candidate, float]]:
        return self.inner.steps(candidate)

    def closer(self, candidate: Candidate) -> list[Candidate]:
        return self.inner.closer(candidate)

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

"""A serial robot as a rig whose causes may be laws that nobody has listed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from functools import cached_property

from discrepancy.candidate import Candidate
from discrepancy.engine.explanation import Found
from discrepancy.laws.candidate import LawCandidate
from discrepancy.laws.lawful import Lawful
from discrepancy.laws.said.pieces import pieces_of
from discrepancy.serial.laws.bench import SerialBench
from discrepancy.serial.rig import SerialRig
from estimator.arrays import Array
from mocobot_sim.serial.extended import Effect
from mocobot_sim.serial.law import JointLaw


class LawfulSerialRig(Lawful, SerialRig):
    """Logs of one robot; its attributes are those of ``SerialRows``."""

    @property
    def bench(self) -> SerialBench:
        return self._bench

    @cached_property
    def _bench(self) -> SerialBench:
        return SerialBench(self)

    def physical(self, candidate: Candidate) -> list[Array]:
        if isinstance(candidate, LawCandidate):
            return [self.bench.columns(t, candidate) for t in range(len(self.trials))]
        return super().physical(candidate)

    def physical_residual(
        self, active: Sequence[tuple[Candidate, Array]], shared: Array | None = None
    ) -> list[Array]:
        laws = [(c, v) for c, v in active if isinstance(c, LawCandidate)]
        out = super().physical_residual(
            [(c, v) for c, v in active if not isinstance(c, LawCandidate)], shared
        )
        for candidate, values in laws:
            out = [r - x @ values for r, x in zip(out, self.physical(candidate), strict=True)]
        return out

    def effects(self, found: Found) -> Sequence[Effect]:
        if isinstance(found.candidate, LawCandidate):
            return [JointLaw(**asdict(piece)) for piece in pieces_of(found.candidate, found.values)]
        return super().effects(found)

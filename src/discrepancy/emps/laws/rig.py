"""The axis as a rig whose causes may be laws that nobody has listed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from discrepancy.candidate import Candidate
from discrepancy.emps.laws.bench import AxisBench
from discrepancy.emps.rig import EmpsRig
from discrepancy.laws.candidate import LawCandidate
from discrepancy.laws.lawful import Lawful
from estimator.arrays import Array


class LawfulEmpsRig(Lawful, EmpsRig):
    """One recording of the axis; its attributes are those of ``EmpsRig``."""

    @property
    def bench(self) -> AxisBench:
        return self._bench

    @cached_property
    def _bench(self) -> AxisBench:
        return AxisBench(self)

    def physical(self, candidate: Candidate) -> list[Array]:
        if isinstance(candidate, LawCandidate):
            return [self.bench.columns(t, candidate) for t in range(len(self.trials))]
        return super().physical(candidate)

    def physical_residual(self, active: Sequence[tuple[Candidate, Array]]) -> list[Array]:
        out = super().physical_residual([(c, v) for c, v in active if not isinstance(c, LawCandidate)])
        for candidate, values in active:
            if isinstance(candidate, LawCandidate):
                out = [r - x @ values for r, x in zip(out, self.physical(candidate), strict=True)]
        return out

"""Which of a scan are looked at: one that stands out of calm noise is, whatever goes before it in its own."""

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.offer.propose import proposals
from discrepancy.inference.scan import events_of
from discrepancy.least_squares.problem import Problem
from fake_rig import FakeRig, cause

MANY = tuple(cause(f"cause {k}") for k in range(3 * rules.LEADERS))
"""More kinds than are looked at."""


class Weak(FakeRig):
    """A burst in one trial, told by six numbers, in the noise of which it is nothing."""

    def columns(self, candidate):
        if not candidate.transient:
            return super().columns(candidate)
        columns = self._burst_columns(0, candidate)
        return [columns if t == 0 else np.zeros_like(columns) for t in range(len(self.trials))]


@pytest.mark.parametrize("others", [0.0, 12.0])
def test_what_stands_out_is_looked_at_however_many_others_go_before_it(others):
    """As many causes that explain more than it does in the noise that it makes had left no room for it."""
    rig = Weak(dict.fromkeys(range(len(MANY)), others), catalogue=MANY, burst=(0, 6.0, 6))
    candidates = rig.candidates()
    base = Hypothesis.of(Problem.of(rig.rows(candidates), candidates), ())
    (event,) = events_of(rig, base.fit)
    assert event.loud
    offered = {offer.candidate.cause for offer in proposals(rig, base).offers}
    assert "push" in offered

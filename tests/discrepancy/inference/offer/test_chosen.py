"""Which of a scan are looked at: what stands out of calm noise is, and what is likely as all scatters, in any case."""

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.candidate import Transient
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.offer.propose import _chosen, _with_kinds_held, proposals
from discrepancy.inference.scan import Scanned, events_of, score_of
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


def test_where_all_kinds_scatter_what_none_of_them_is_is_looked_at():
    """With its kind within its tolerance each goes before a cable; more kinds do than there was room for."""
    kinds = [f"kind {k}" for k in range(3 * rules.LEADERS)]
    places = [cause(kind, robot) for kind in kinds for robot in (1, 2, 3)]
    catalogue = (*places, cause("cable", tolerance=0.0))
    cable = len(catalogue) - 1
    off = dict(enumerate(10.0 * np.random.default_rng(5).choice([-1.2, -0.8, 0.8, 1.2], cable)))
    rig = FakeRig({**off, cable: 0.7}, catalogue=catalogue)
    base = Hypothesis.of(Problem.of(rig.rows(catalogue), catalogue), ())
    before = [one for one in _with_kinds_held(base) if one.score > score_of(base.fit, cable)]
    assert len({one.candidate.cause for one in before}) > 2 * rules.LEADERS
    best = proposals(rig, base).best
    assert best.causes[-1].cause == "cable"
    assert best.score > base.score + rules.NAMED_NATS


@pytest.mark.parametrize("loud", [False, True])
def test_of_events_only_what_stands_out_is_looked_at_in_any_case(loud):
    """With room for others a healthy team whose kinds all scatter had pushes."""
    held = [Scanned(k, candidate, 50.0, held=True) for k, candidate in enumerate(MANY)]
    cable = Scanned(len(held), cause("cable", tolerance=0.0), 10.0)
    push = Scanned(None, cause("push", None, 0.0, 6, transient=Transient(0, 2.0, 0.5)), 20.0, loud=loud)
    chosen = _chosen([*held, push, cable], rules.LEADERS, ())
    assert cable in chosen
    assert (push in chosen) == loud
    assert sum(item.held for item in chosen) <= 2 * rules.LEADERS

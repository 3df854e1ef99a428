"""Prior odds: what they are worth, and that a decision follows from them."""

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.engine.diagnose import diagnose
from discrepancy.inference.search import search
from discrepancy.result.evidence_list import needed_nats
from estimator.errors import InputError
from fake_rig import CATALOGUE, FakeRig, cause, names

EVENTS = (*CATALOGUE, cause("event", tolerance=0.0))
WEAK = {len(CATALOGUE): 0.35}
"""Named by 6.7 nats with odds of 10, so with 5.3 fewer, the log of 200, not at all."""


def test_a_weak_cause_is_named_by_whoever_suspects_one():
    rig = FakeRig(WEAK, catalogue=EVENTS)
    assert diagnose(rig, closed_loop=False).causes == ()
    suspecting = diagnose(rig, closed_loop=False, odds=10.0)
    assert names(suspecting.causes) == ["event"]
    assert any("odds of 10 beforehand" in note for note in suspecting.notes)


@pytest.mark.parametrize("odds", [0.005, 0.5])
def test_odds_multiply_those_of_every_cause(odds):
    rig = FakeRig({2: 25.0, 5: [40.0, -30.0]})
    usual, other = search(rig), search(rig, odds=odds)
    assert [c.key for c in usual.best.causes] == [c.key for c in other.best.causes]
    assert other.nothing.score == usual.nothing.score
    assert other.best.score - usual.best.score == pytest.approx(2.0 * np.log(odds / rules.PRIOR_ODDS))
    problem = other.best.problem
    change = needed_nats(usual.best.problem, problem.candidates[0]) - needed_nats(
        problem, problem.candidates[0]
    )
    assert change == pytest.approx(np.log(odds / rules.PRIOR_ODDS))


def test_thresholds_are_the_costs():
    """Of a false alarm against a miss: silence is cheaper up to p / (1 - p) = 150."""
    assert pytest.approx(np.log(rules.FALSE_ALARM_COST), abs=0.05) == rules.NAMED_NATS
    for p in (0.99, 0.995):
        named = (1.0 - p) * rules.FALSE_ALARM_COST < p
        assert (np.log(p / (1.0 - p)) > rules.NAMED_NATS) == named
    assert rules.LEAST_PROBABILITY == 0.5


@pytest.mark.parametrize("odds", [0.0, -1.0, float("nan"), float("inf"), 1e4])
def test_odds_that_are_none_are_refused(odds):
    with pytest.raises(InputError, match=r"odds is .*; it must be greater than 0 and at most 1000"):
        diagnose(FakeRig({}), closed_loop=False, odds=odds)

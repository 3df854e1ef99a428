"""Steps that do not pay where they are exact, and what the law of a fault leaves, do not end a search."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.inference import search as module
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.remainder import trace_nats
from discrepancy.inference.search import search
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from fake_rig import NINE, FakeRig


def test_the_next_is_tried_where_the_likeliest_does_not_pay(monkeypatch):
    asked = []

    def nothing_of_cause_2(rig, best, *rest):
        asked.append(best.causes[-1].cause)
        for index in best.free:
            if best.problem.candidates[index].cause == "cause 2":
                return best.without(index), {}
        return best, {}

    monkeypatch.setattr(module, "settled", nothing_of_cause_2)
    found = search(FakeRig({2: 60.0, 5: [30.0, -20.0]}))
    assert asked[:2] == ["cause 2", "cause 5"]
    assert [c.cause for c in found.best.causes] == ["cause 5"]
    assert asked.count("cause 2") == 2  # once more beside the other, and no more


def test_a_search_ends_with_as_many_refused_in_a_row(monkeypatch):
    asked = []

    def nothing_pays(rig, best, *rest):
        asked.append(best.causes[-1].cause)
        return best.without(best.free[-1]), {}

    monkeypatch.setattr(module, "settled", nothing_pays)
    found = search(FakeRig({1: 60.0, 2: 50.0, 4: 40.0}))
    assert not found.best.free
    assert len(asked) == len(set(asked)) == rules.REFUSED


@pytest.fixture(scope="module")
def there():
    """One of nine places is off, in noise of 1."""
    rig = FakeRig({4: 40.0}, catalogue=NINE)
    candidates = rig.candidates()
    problem = Problem.of(rig.rows(candidates), candidates)
    return rig, cast("Hypothesis", SimpleNamespace(problem=problem, fit=Fit.of(problem, (4,)), free=(4,)))


def test_a_trace_leaves_half_its_sum_of_squares(there):
    _, hypothesis = there
    problem, value = hypothesis.problem, hypothesis.fit.part(4)[0]
    traces = [problem.rows(t)[..., problem.spans[4]] @ value for t in problem.trials]
    assert trace_nats(hypothesis, 4) == pytest.approx(0.5 * sum(np.sum(x**2) for x in traces), rel=1e-6)
    louder = [4.0 * power for power in problem.power]
    noisy = SimpleNamespace(problem=problem.with_noise(louder, problem.spread), fit=hypothesis.fit)
    assert trace_nats(cast("Any", noisy), 4) == pytest.approx(trace_nats(hypothesis, 4) / 4.0)


@pytest.mark.parametrize(
    ("share", "kind", "refused"), [(0.9, "many", True), (1.1, "many", False), (0.9, "few", False)]
)
def test_a_kind_scatters_beside_a_fault_of_it_by_more_than_its_law_may_leave(there, share, kind, refused):
    rig, hypothesis = there
    gain = share * rules.LAW_SHARE**2 * trace_nats(hypothesis, 4)
    base = SimpleNamespace(
        problem=hypothesis.problem, fit=hypothesis.fit, free=(4,), causes=[NINE[4]], score=7.0
    )
    scattered = SimpleNamespace(score=7.0 + gain)
    cause = SimpleNamespace(cause=kind)
    assert (
        module._form_of_a_fault(rig, cast("Any", base), cast("Any", cause), cast("Any", scattered)) == refused
    )


def test_causes_are_exchanged_once_where_kinds_were_found_to_scatter(monkeypatch):
    """As often as anything was added, their rivals had been sought in vain: each time anew beside the next scatter."""
    settled, asked = module.settled, []

    def counted(rig, best, *rest):
        asked.append(len(best.free))
        return settled(rig, best, *rest)

    monkeypatch.setattr(module, "settled", counted)
    monkeypatch.setattr(module, "tolerated", lambda base, added: added)
    found = search(FakeRig({2: 60.0, 5: [30.0, -20.0]}))
    assert {c.cause for c in found.best.causes} == {"cause 2", "cause 5"}
    assert asked == [2]
    assert all(found.rivals)


@pytest.mark.parametrize(("needed", "left", "found"), [(1e9, 1e9, 2), (1e9, 1.0, 4), (0.0, 1e9, 4)])
def test_no_more_are_looked_for_where_scatters_account_for_little_of_what_is_left(
    monkeypatch, needed, left, found
):
    """Of what nobody lists, a little looks like the scatter of one place after the other.

    Not so where one accounts for much, or would pay as a fault.
    """
    monkeypatch.setattr(module, "tolerated", lambda base, added: added)
    monkeypatch.setattr(module, "needed", lambda base, more: needed)
    monkeypatch.setattr(module, "nats_left", lambda best: left)
    assert len(search(FakeRig({1: 60.0, 2: 55.0, 4: 50.0, 5: 45.0})).best.free) == found


def test_a_scatter_that_accounts_for_much_lets_a_search_go_on(monkeypatch):
    """As many as end it are in a row: after the second, that accounts for all that is left, it is as at first."""
    left = iter([1e9, 1.0, 1e9, 1e9, 1e9])
    monkeypatch.setattr(module, "tolerated", lambda base, added: added)
    monkeypatch.setattr(module, "needed", lambda base, more: 1e9)
    monkeypatch.setattr(module, "nats_left", lambda best: next(left))
    assert len(search(FakeRig({k: 60.0 - 5.0 * k for k in range(1, 7)})).best.free) == 4

"""What a cause leaves open, such as friction at rest: integrated out, and no credit of the cause."""

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.offer.propose import proposals
from discrepancy.inference.scan import scan
from discrepancy.inference.search import search
from discrepancy.inference.shape.sharpen import sharpened
from discrepancy.team.linear.patches import Patches
from discrepancy.least_squares.problem import Problem
from discrepancy.result.evidence_list import evidence_list
from fake_rig import CHANNELS, ROWS, FakeRig, cause, found_in, names


class OpenRig(FakeRig):
    """Cause 2 leaves open sixty numbers a trial, of its own size."""

    def unknowns(self, candidate):
        count = 60 if candidate.cause == "cause 2" else 0
        rng = np.random.default_rng(11)
        return [Patches.of(0.3 * rng.standard_normal((ROWS, CHANNELS, count))) for _ in self.trials]


SMALL = tuple(cause(f"cause {k}", tolerance=0.1) for k in range(8))


def test_what_a_cause_leaves_open_is_integrated_out():
    """It is there: the cause has its value, and what is left is noise."""
    rig = OpenRig({2: 25.0}, catalogue=SMALL)
    rng = np.random.default_rng(5)
    for t, u in enumerate(rig.unknowns(SMALL[2])):
        x, *own = rig.data[t]
        rig.data[t] = x + 2.5 * u.dense() @ rng.standard_normal(60), *own
    explanation = found_in(rig)
    assert names(explanation.found) == ["cause 2"]
    assert list(explanation.problem.opened) == [SMALL[2].key]
    (found,) = explanation.found
    assert abs(found.values[0] - 2.5) < 3.5 * np.sqrt(found.covariance[0, 0])
    assert explanation.clean
    # What a healthy one would explain of it is not to its credit.
    assert explanation.hypothesis.allowed[found.index] > 100.0
    healthy = Hypothesis.of(explanation.problem, ())
    assert explanation.hypothesis.score - healthy.score < found.over_nothing + 0.2
    # Nor in the list of the strongest: but for the prior odds it has there what the search gave it.
    first = evidence_list(explanation)["before"][0]
    assert first["cause"] == "cause 2"
    assert first["nats"] - first["needed"] + rules.NAMED_NATS == pytest.approx(found.over_nothing, rel=0.05)


class HoldingRig(OpenRig):
    """What cause 2 leaves open can all but imitate it, as friction at rest does where a joint hardly moves."""

    def unknowns(self, candidate):
        opened = super().unknowns(candidate)
        if candidate.cause != "cause 2":
            return opened
        return [u.beside([Patches.of(c)]) for u, c in zip(opened, self.columns(candidate), strict=True)]


def test_what_a_cause_explains_with_nothing_open_stays_to_it():
    rig = HoldingRig({2: 25.0}, catalogue=SMALL)
    rng = np.random.default_rng(5)
    for t, u in enumerate(rig.unknowns(SMALL[2])):
        x, *own = rig.data[t]
        rig.data[t] = x + 2.5 * u.dense()[..., :60] @ rng.standard_normal(60), *own
    nothing = search(rig).nothing
    alone = Hypothesis.of(nothing.problem, [2])
    best = proposals(rig, nothing).best
    assert best.free == (2,)
    assert list(best.problem.opened) == [SMALL[2].key]
    assert best.fit.chi2 < 0.7 * alone.fit.chi2
    assert best.score == pytest.approx(alone.score, abs=1e-6)
    assert alone.score > nothing.score + rules.NAMED_NATS


def test_what_is_left_open_at_rest_is_not_charged_where_it_tells_nothing():
    explanation = found_in(OpenRig({2: 25.0, 5: 400.0}, catalogue=SMALL))
    assert names(explanation.found) == ["cause 5", "cause 2"]
    assert explanation.problem.opened == {}


@pytest.mark.parametrize(("value", "times"), [(25.0, 2), (2000.0, 1)])
def test_the_size_of_what_is_left_open_is_sought_until_it_is_found(monkeypatch, value, times):
    """Where what is open changes the cause's value by less than a share of it, that size is the one."""
    rig = OpenRig({2: value}, catalogue=SMALL)
    rng = np.random.default_rng(5)
    for t, u in enumerate(rig.unknowns(SMALL[2])):
        x, *own = rig.data[t]
        rig.data[t] = x + 2.5 * u.dense() @ rng.standard_normal(60), *own
    base = search(rig, most=0).nothing
    item = next(one for one in scan(base.fit) if one.candidate.cause == "cause 2")
    sizes, with_open = [], Problem.with_open

    def spied(problem, key, along, size):
        sizes.append(size)
        return with_open(problem, key, along, size)

    monkeypatch.setattr(Problem, "with_open", spied)
    new = sharpened(rig, base, item, near=False)
    assert len(sizes) == times
    assert abs(new.fit.part(2)[0][0] * SMALL[2].units[0]) == pytest.approx(sizes[-1], rel=rules.SIZE_SETTLED)

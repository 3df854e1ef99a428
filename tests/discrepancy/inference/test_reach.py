"""What is far less likely than the likeliest is not looked at once more in its place."""

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference import exchange as module
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.offer.propose import Offer, Proposed, proposals
from discrepancy.inference.search import search
from discrepancy.least_squares.problem import Problem
from fake_rig import CATALOGUE, FakeRig, cause

NONE = tuple(cause(c.cause, tolerance=0.0) if c.cause in ("cause 2", "cause 4") else c for c in CATALOGUE)


def base_of(rig):
    return Hypothesis.of(Problem.of(rig.rows(rig.candidates()), rig.candidates()), ())


@pytest.mark.parametrize(
    ("most", "nats", "within"), [(1000.0, 501.0, True), (1000.0, 499.0, False), (60.0, 11.0, True), (60.0, 9.0, False)]
)  # fmt: skip
def test_reach_is_so_many_nats_or_such_a_share_whatever_is_more(most, nats, within):
    assert (rules.REACH_NATS, rules.REACH_SHARE) == (50.0, 0.5)
    base = base_of(FakeRig({}))
    offers = [Offer(cause(name), base.score + x, 0.0) for name, x in (("first", most), ("other", nats))]
    reach = Proposed(None, tuple(offers)).within_reach(base)
    assert reach == {cause(name).key for name in (("first", "other") if within else ("first",))}


def test_what_is_left_out_is_not_offered():
    rig = FakeRig({2: 60.0, 5: [30.0, -20.0]})
    base = base_of(rig)
    every = {one.candidate.key for one in proposals(rig, base).offers}
    among = {c.key for c in rig.candidates() if c.cause in ("cause 2", "cause 3")}
    found = proposals(rig, base, among=among)
    assert {one.candidate.key for one in found.offers} == every & among < every
    assert found.best is not None
    assert found.best.causes[-1].cause == "cause 2"


def asked_in_place(rig, monkeypatch) -> list[set[str] | None]:
    """What each search for rivals was told to look at, by name."""
    asked: list[set[str] | None] = []

    def spied(*args, among=None, **rest):
        asked.append(None if among is None else {key[0] for key in among})
        return proposals(*args, among=among, **rest)

    monkeypatch.setattr(module, "proposals", spied)
    found = search(rig)
    assert [c.cause for c in found.best.causes] == ["cause 2"]
    return asked


def test_a_twin_stays_a_rival_and_what_is_far_behind_does_not(monkeypatch):
    rig = FakeRig({2: 60.0}, twins={4: (2, 0.02)}, catalogue=NONE)
    (first, *_) = asked_in_place(rig, monkeypatch)
    assert first == {"cause 2", "cause 4"}


def test_rivals_of_causes_found_before_are_looked_for_among_all(monkeypatch):
    asked = []

    def spied(rig, base, *, known: Candidate, among=None, **rest):
        asked.append((known.cause, among is None))
        return proposals(rig, base, known=known, among=among, **rest)

    monkeypatch.setattr(module, "proposals", spied)
    found = search(FakeRig({2: 60.0, 5: [30.0, -20.0]}))
    assert {c.cause for c in found.best.causes} == {"cause 2", "cause 5"}
    assert asked == [("cause 2", False), ("cause 2", True), ("cause 5", False)]
    assert np.isfinite(found.best.score)

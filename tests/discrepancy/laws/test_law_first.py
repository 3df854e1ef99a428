"""A law in place of the first cause of a search."""

from types import SimpleNamespace

import pytest

from discrepancy import rules
from discrepancy.inference.search import Searched, search
from discrepancy.laws import instead
from discrepancy.laws.instead import LawFirst
from fake_rig import FakeRig

MUCH = rules.UNLISTED_NATS


def hypothesis(score, *causes):
    return SimpleNamespace(
        score=score, free=tuple(range(len(causes))), causes=[SimpleNamespace(key=key) for key in causes]
    )


@pytest.mark.parametrize(
    ("left", "lead", "by_law", "looked", "taken"),
    [
        (MUCH - 1.0, 900.0, 0.0, False, False),  # the cause explains what is there
        (MUCH + 1.0, MUCH - 1.0, 0.0, True, False),
        (MUCH + 1.0, MUCH + 1.0, MUCH - 1.0, True, True),
        (MUCH + 1.0, 900.0, MUCH + 1.0, True, False),  # there is more than one law
        (MUCH + 1.0, None, 0.0, True, False),  # no law pays, or helps on trials left out
    ],
)
def test_only_where_the_cause_leaves_more_than_noise_and_a_law_does_not(
    monkeypatch, left, lead, by_law, looked, taken
):
    nothing, cause = hypothesis(0.0), hypothesis(100.0, "friction")
    rig, seen = SimpleNamespace(bench=object()), []
    monkeypatch.setattr(instead, "unlisted_nats", lambda found: left if found is cause else by_law)
    monkeypatch.setattr(instead, "likely_causes", lambda found: ())
    monkeypatch.setattr(instead, "located_in", lambda start, bench, say: ["a place"])

    def with_one(start, bench, places, say, forms):
        seen.append(start.best)
        law = None if lead is None else hypothesis(100.0 + lead, "law")
        return None if law is None else (Searched(rig, nothing, law, ((),)), {"law": []})

    monkeypatch.setattr(instead, "with_one", with_one)
    first = LawFirst()
    found = first(Searched(rig, nothing, cause, ((),)))
    assert seen == ([nothing] if looked else []), "beside nothing, not beside the cause"
    assert (found is not None) == taken
    assert (first.cause is not None, bool(first.places)) == (taken, taken)


def test_a_rig_without_places_has_no_laws():
    found = Searched(SimpleNamespace(bench=None), None, hypothesis(1.0, "friction"), ((),))
    assert LawFirst()(found) is None


def test_a_search_asks_once_and_goes_on_with_what_it_is_told():
    """What it is told is as if it had been found; without an answer it finds the same as if it had not asked."""
    asked = []

    def first(searched):
        asked.append([cause.key for cause in searched.best.causes])

    hidden = {2: 25.0, 4: 30.0}
    plain, also = search(FakeRig(hidden)), search(FakeRig(hidden), first=first)
    assert len(asked) == 1
    assert len(asked[0]) == 1
    assert [c.key for c in also.best.causes] == [c.key for c in plain.best.causes]
    assert also.best.score == plain.best.score

    def nothing_there(searched):
        return Searched(searched.rig, searched.nothing, searched.nothing, ())

    alone = FakeRig({2: 25.0})
    assert search(alone, first=nothing_there).best.score == pytest.approx(search(alone).best.score)

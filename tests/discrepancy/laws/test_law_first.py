"""A law in place of the first cause of a search."""

from types import SimpleNamespace

import pytest

from discrepancy import rules
from discrepancy.engine import diagnose as engine
from discrepancy.engine.diagnose import diagnose
from discrepancy.inference import search as inference
from discrepancy.inference.search import Searched, search
from discrepancy.laws import instead
from discrepancy.laws.instead import LawFirst
from fake_rig import FakeRig, names

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
    monkeypatch.setattr(instead, "nats_beyond_noise", lambda found, bench: left if found is cause else by_law)
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


def test_it_is_asked_after_a_first_step_that_healthy_ones_have_too(monkeypatch):
    """Friction in the spring, opened within its scatter, had taken in the most of a hum; five steps more came after."""
    steps, asked = [], []

    def tolerated(best, added):
        steps.append(added)
        return added if len(steps) == 1 else None

    monkeypatch.setattr(inference, "tolerated", tolerated)
    search(FakeRig({2: 25.0, 4: 30.0}), first=lambda searched: asked.append(len(steps)))
    assert asked == [1]
    assert len(steps) > 1


class Stated(LawFirst):
    """Puts something in the place of the first cause that explains nothing."""

    def __call__(self, searched):
        self.cause = searched
        return Searched(searched.rig, searched.nothing, searched.nothing, ())


@pytest.mark.parametrize("worse", [False, True])
def test_where_its_response_is_worse_the_search_goes_on_from_the_cause(monkeypatch, worse):
    """Not with that cause alone, as it had been when the law took its place."""
    monkeypatch.setattr(engine, "LawFirst", Stated)
    monkeypatch.setattr(engine, "laws_of", lambda explanation: ["a law"])
    held = []

    def responding(rig, listed, lawful, jobs, simulated):
        held.append(names(listed.found))
        return (listed, ["No better."]) if worse else (lawful, [])

    monkeypatch.setattr(engine, "responding", responding)
    monkeypatch.setattr(engine, "with_laws", lambda searched, *rest, **more: SimpleNamespace(
        searched=searched, places=(), refinements=()))  # fmt: skip
    rig = FakeRig({2: 25.0, 4: 30.0}, loop=lambda causes, trial: 1.0)
    diagnosis = diagnose(rig)
    assert len(held[0]) == 1
    assert sorted(names(diagnosis.causes)) == ["cause 2", "cause 4"]
    assert ("No better." in diagnosis.notes) == worse

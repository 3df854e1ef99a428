"""A law where what is left passes for noise, but lies at one place."""

from types import SimpleNamespace

import pytest

from discrepancy import rules
from discrepancy.inference.search import Searched
from discrepancy.laws import search
from discrepancy.laws.search import with_laws


def hypothesis(score, *causes):
    return SimpleNamespace(
        score=score,
        free=tuple(range(len(causes))),
        causes=[SimpleNamespace(key=key) for key in causes],
        fit=None,
    )


@pytest.mark.parametrize(
    ("unlisted", "at_one_place", "gain", "looked", "stated"),
    [
        (rules.DOUBT_NATS - 1.0, 900.0, 900.0, False, False),
        (rules.DOUBT_NATS + 1.0, rules.UNLISTED_NATS - 1.0, 900.0, True, False),
        (rules.DOUBT_NATS + 1.0, 900.0, rules.UNLISTED_NATS - 1.0, True, False),
        (rules.DOUBT_NATS + 1.0, 900.0, rules.UNLISTED_NATS + 1.0, True, True),
        (rules.UNLISTED_NATS + 1.0, 10.0, rules.NAMED_NATS + 1.0, True, True),
    ],
)
def test_it_has_to_pay_for_all_that_noise_may_hide(monkeypatch, unlisted, at_one_place, gain, looked, stated):
    """More than noise is left in the last case: there a law has to be worth naming, and no more."""
    before, after = hypothesis(100.0, "friction"), hypothesis(100.0 + gain, "friction", "law")
    places = [SimpleNamespace(nats=at_one_place)]
    seen = []
    monkeypatch.setattr(search, "unlisted_nats", lambda found: unlisted if found is before else 0.0)
    monkeypatch.setattr(search, "line_nats", lambda fit, bench: 0.0)
    monkeypatch.setattr(search, "likely_causes", lambda found: ())
    monkeypatch.setattr(search, "located", lambda fit, bench, where: seen.append(where) or places)
    monkeypatch.setattr(search, "continued", lambda searched, most, say, until: searched)
    monkeypatch.setattr(search, "_of_their_own", lambda searched, forms: searched)

    def with_one(searched, bench, where, say, forms):
        assert where == places
        return Searched(searched.rig, searched.nothing, after, ((), ())), {}

    monkeypatch.setattr(search, "with_one", with_one)
    rig = SimpleNamespace(bench=SimpleNamespace(places=["anywhere"]))
    lawful = with_laws(Searched(rig, hypothesis(0.0), before, ((),)), 8)
    assert bool(seen) == looked
    assert (lawful.searched.best is after) == stated
    assert len(seen) <= 1 or unlisted >= rules.UNLISTED_NATS, "once, beside what is named"


@pytest.mark.parametrize(
    ("score", "named", "gone_on"),
    [(90.0, ("payload",), False), (200.0, ("payload",), True), (90.0, ("payload", "zero"), True)],
)
def test_what_cannot_take_the_place_of_causes_that_leave_noise_is_not_gone_on_with(
    monkeypatch, score, named, gone_on
):
    """A law has to do with as few, and to be likelier: so it needs room for another cause, or to be likelier by now."""
    before, law, asked = hypothesis(100.0, *named), hypothesis(score, "law"), []
    monkeypatch.setattr(search, "unlisted_nats", lambda found: 0.0)
    monkeypatch.setattr(search, "line_nats", lambda fit, bench: 0.0)
    monkeypatch.setattr(search, "likely_causes", lambda found: ())
    monkeypatch.setattr(search, "located", lambda fit, bench, where: [])
    monkeypatch.setattr(search, "_of_their_own", lambda searched, forms: searched)
    monkeypatch.setattr(
        search, "with_one", lambda start, *rest: (Searched(start.rig, start.nothing, law, ((),)), {})
    )

    def continued(searched, most, say, until):
        both = hypothesis(300.0, "law", *named)
        assert until(both)
        assert not until(hypothesis(300.0, "law", "other"))
        asked.append(most)
        return Searched(searched.rig, searched.nothing, both, ((),) * (1 + len(named)))

    monkeypatch.setattr(search, "continued", continued)
    rig = SimpleNamespace(bench=SimpleNamespace(places=["anywhere"]))
    lawful = with_laws(Searched(rig, hypothesis(0.0), before, ((),) * len(named)), 8, instead=True)
    assert bool(asked) == gone_on
    assert lawful.searched.best is before

"""When a law takes the place of causes that leave noise."""

from types import SimpleNamespace

import pytest

from discrepancy import rules
from discrepancy.law_doubt import LawDoubt
from discrepancy.laws.search import _replaces


def hypothesis(score, *causes):
    return SimpleNamespace(
        score=score, free=tuple(range(len(causes))), causes=[SimpleNamespace(key=key) for key in causes]
    )


def named(*causes, score, rivals):
    rig = SimpleNamespace(law_doubt=lambda candidate: LawDoubt(towards_rivals=rivals))
    return SimpleNamespace(rig=rig, nothing=hypothesis(0.0), best=hypothesis(score, *causes))


def test_one_law_instead_of_several_causes():
    assert _replaces(hypothesis(60.0, "law"), named("drive", "ripple", score=50.0, rivals=0.2))


@pytest.mark.parametrize("causes", [("law", "payload"), ("law", "law 2", "payload")])
def test_a_law_beside_all_that_is_named_replaces_nothing(causes):
    assert not _replaces(hypothesis(900.0, *causes), named("payload", score=50.0, rivals=0.2))


def test_more_causes_than_before_replace_nothing():
    assert not _replaces(hypothesis(900.0, "law", "law 2"), named("payload", score=50.0, rivals=0.2))


@pytest.mark.parametrize("rivals", [0.0, 0.2])
def test_one_for_one_only_beyond_the_doubt_in_laws(rivals):
    """A cause worth 100 nats whose law may be off by 0.2: a rival's lead counts a ninth, 1 / (1 + 2 * 100 * 0.04)."""
    least = rules.NAMED_NATS * (9.0 if rivals else 1.0)
    for lead, wanted in ((1.05 * least, True), (0.95 * least, False)):
        assert (
            _replaces(hypothesis(100.0 + lead, "law"), named("payload", score=100.0, rivals=rivals)) is wanted
        )


@pytest.mark.parametrize(("score", "wanted"), [(59.0, False), (61.0, True)])
@pytest.mark.parametrize("causes", [("drive",), ("drive", "ripple")])
def test_what_would_pass_for_noise_calls_for_no_law(causes, score, wanted):
    """Less than 60 nats over nothing are no sign of something unlisted, with a law or without."""
    assert rules.UNLISTED_NATS == 60.0
    assert _replaces(hypothesis(score, "law"), named(*causes, score=5.0, rivals=0.2)) is wanted

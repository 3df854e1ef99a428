"""When a law takes the place of causes that leave noise."""

from types import SimpleNamespace

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.candidate import Transient
from discrepancy.inference.search import Searched
from discrepancy.law_doubt import LawDoubt
from discrepancy.laws import instead, search
from discrepancy.laws.candidate import LawCandidate
from discrepancy.laws.instead import in_place, sites
from discrepancy.laws.search import replaces


def hypothesis(score, *causes):
    return SimpleNamespace(
        score=score, free=tuple(range(len(causes))), causes=[SimpleNamespace(key=key) for key in causes]
    )


def named(*causes, score, rivals):
    rig = SimpleNamespace(law_doubt=lambda candidate: LawDoubt(towards_rivals=rivals))
    return SimpleNamespace(rig=rig, nothing=hypothesis(0.0), best=hypothesis(score, *causes))


def test_one_law_instead_of_several_causes():
    assert replaces(hypothesis(60.0, "law"), named("drive", "ripple", score=50.0, rivals=0.2))


@pytest.mark.parametrize("causes", [("law", "payload"), ("law", "law 2", "payload")])
def test_a_law_beside_all_that_is_named_replaces_nothing(causes):
    assert not replaces(hypothesis(900.0, *causes), named("payload", score=50.0, rivals=0.2))


def test_more_causes_than_before_replace_nothing():
    assert not replaces(hypothesis(900.0, "law", "law 2"), named("payload", score=50.0, rivals=0.2))


@pytest.mark.parametrize("rivals", [0.0, 0.2])
def test_one_for_one_only_beyond_the_doubt_in_laws(rivals):
    """A cause worth 100 nats whose law may be off by 0.2: a rival's lead counts a ninth, 1 / (1 + 2 * 100 * 0.04)."""
    least = rules.NAMED_NATS * (9.0 if rivals else 1.0)
    for lead, wanted in ((1.05 * least, True), (0.95 * least, False)):
        assert (
            replaces(hypothesis(100.0 + lead, "law"), named("payload", score=100.0, rivals=rivals)) is wanted
        )


@pytest.mark.parametrize(("score", "wanted"), [(59.0, False), (61.0, True)])
@pytest.mark.parametrize("causes", [("drive",), ("drive", "ripple")])
def test_what_would_pass_for_noise_calls_for_no_law(causes, score, wanted):
    """Less than 60 nats over nothing are no sign of something unlisted, with a law or without."""
    assert rules.UNLISTED_NATS == 60.0
    assert replaces(hypothesis(score, "law"), named(*causes, score=5.0, rivals=0.2)) is wanted


def listed(key, robot, joint, transient=None):
    return SimpleNamespace(key=key, robot=robot, joint=joint, transient=transient)


def of(*causes, rivals=0.0):
    rig = SimpleNamespace(law_doubt=lambda candidate: LawDoubt(towards_rivals=rivals))
    return SimpleNamespace(rig=rig, best=SimpleNamespace(causes=causes))


def test_sites_are_joints_with_all_their_causes_and_every_other_cause_alone():
    """Where what laws are off by parts them from others, one cause alone is no site; nor is what passes, nor a law."""
    at, term = SimpleNamespace(name="tau reading"), SimpleNamespace(variables=["tau"])
    law = LawCandidate("law", "unlisted", 3, 3, (), at=at, term=term)
    causes = (
        listed("bias", 1, 2), listed("friction", 2, 2), listed("mass", None, None), listed("scale", 1, 2),
        listed("tilt", 2, None), listed("lag", 2, None), listed("push", None, None, Transient(0, 1.0, 1.0)), law,
        listed("push", None, None, Transient(1, 5.0, 1.0)),
    )  # fmt: skip
    assert sites(of(*causes)) == [{"bias", "scale"}, {"friction"}, {"mass"}, {"tilt"}, {"lag"}]
    assert sites(of(*causes, rivals=0.2)) == [{"bias", "scale"}]
    assert sites(of()) == []


class Team:
    """Causes at joints, with scores by which of them are there."""

    def __init__(self, scores, causes):
        self.scores, self.problem = scores, SimpleNamespace(candidates=causes)
        self.free, self.score = tuple(range(len(causes))), scores[len(causes)]

    @property
    def causes(self):
        return [self.problem.candidates[i] for i in self.free]

    def without(self, index):
        less = Team(self.scores, self.problem.candidates)
        less.free = tuple(i for i in self.free if i != index)
        less.score = self.scores[len(less.free)]
        return less


PLACES = [
    SimpleNamespace(robot=robot, joint=joint)
    for robot, joint in ((1, 3), (2, 1), (1, None), (None, None), (3, 3))
]


@pytest.fixture
def replaced(monkeypatch):
    """Tries laws in place of causes; gives what was found, beside which causes and at which places they were sought."""

    def run(best, lawful, rivals=0.0, own=0.0):
        rig = SimpleNamespace(
            bench=SimpleNamespace(places=PLACES), law_doubt=lambda candidate: LawDoubt(towards_rivals=rivals)
        )
        start, where, asked, nothing = [], [], [], SimpleNamespace(score=0.0)

        def with_one(searched, bench, places, say, forms, least):
            asked.append(least)
            start.append([cause.key for cause in searched.best.causes])
            return Searched(rig, nothing, lawful, ((),) * len(lawful.free)), {}

        def located(fit, bench, places):
            where.append(list(places))
            return list(places)

        monkeypatch.setattr(instead, "exact", lambda rig, hypothesis, nothing: hypothesis)
        monkeypatch.setattr(instead, "located", located)
        monkeypatch.setattr(instead, "likely_causes", lambda hypothesis: ())
        monkeypatch.setattr(search, "unlisted_nats", lambda hypothesis: 0.0)
        monkeypatch.setattr(Team, "fit", None, raising=False)
        monkeypatch.setattr(instead, "with_one", with_one)
        monkeypatch.setattr(instead, "score_of", lambda fit, index: own)
        return in_place(Searched(rig, nothing, best, ((),) * len(best.free))), start, where, asked

    return run


@pytest.mark.parametrize(("lead", "taken"), [(5.1, True), (4.9, False)])
def test_a_law_takes_the_place_of_several_causes_at_its_joint(replaced, lead, taken):
    """It is looked for at that joint only, without the causes there, beside all others; and it has to be likelier."""
    bias, scale, other = listed("bias", 1, 3), listed("scale", 1, 3), listed("friction", 2, 1)
    best = Team({3: 100.0, 2: 60.0, 1: 20.0}, [bias, other, scale])
    lawful = Team({2: 100.0 + lead}, [other, listed("law", 1, 3)])
    found, start, where, asked = replaced(best, lawful, rivals=0.2)
    assert start == [["friction"]]
    assert asked == [-np.inf]
    assert where == [PLACES[:1]]
    assert (found is not None) == taken
    assert found is None or found.searched.best is lawful


@pytest.mark.parametrize(("lead", "taken"), [(20.1, True), (19.9, False)])
@pytest.mark.parametrize("own", [-3.0, 40.0])
@pytest.mark.parametrize(
    ("joint", "places"), [(3, PLACES[:1]), (None, [PLACES[0], PLACES[2], PLACES[3]])], ids=["joint", "robot"]
)
def test_a_law_takes_the_place_of_one_cause_only_if_it_is_likelier_by_far(
    replaced, lead, taken, joint, places, own
):
    """That of a joint at the joint; that of a robot at any of its joints and at the payload, at no other robot."""
    best = Team({1: 100.0, 0: 20.0}, [listed("one", 1, joint)])
    lawful = Team({1: 100.0 + lead}, [listed("law", 1, joint)])
    found, start, where, asked = replaced(best, lawful, own=own)
    assert start == [[]]
    assert asked == [max(own, 20.0)]  # at first sight it explains more than the cause does
    assert where == [places]
    assert (found is not None) == taken


def test_a_cause_that_went_with_another_is_no_site_any_more(replaced):
    """The first law takes the place of both: what is left of the second's site is looked at no more."""
    best = Team({2: 100.0, 1: 20.0}, [listed("one", 1, 3), listed("two", 2, 1)])
    lawful = Team({1: 200.0, 0: 0.0}, [listed("law", 1, 3)])
    found, start, *_ = replaced(best, lawful)
    assert start == [["two"]]
    assert found is not None
    assert found.searched.best is lawful

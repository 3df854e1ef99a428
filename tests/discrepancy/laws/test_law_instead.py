"""When a law takes the place of causes that leave noise."""

from types import SimpleNamespace

import pytest

from discrepancy import rules
from discrepancy.inference.search import Searched
from discrepancy.law_doubt import LawDoubt
from discrepancy.laws import instead, search
from discrepancy.laws.instead import crowded, in_place_of_several
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


def at_joints(*joints):
    return SimpleNamespace(causes=[SimpleNamespace(robot=robot, joint=joint) for robot, joint in joints])


def test_joints_with_several_causes_arecrowded():
    """What sits at a robot or at the payload is beside nothing."""
    several = at_joints((1, 2), (2, 2), (None, None), (1, 2), (2, None), (2, None), (None, None))
    assert crowded(several) == [(1, 2)]
    assert crowded(at_joints()) == []


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


@pytest.mark.parametrize(("lead", "taken"), [(5.1, True), (4.9, False)])
def test_a_law_takes_the_place_of_several_causes_at_its_joint(monkeypatch, lead, taken):
    """It is looked for at that joint only, without the causes there, beside all others; and it has to be likelier."""
    bias, scale, other = (
        SimpleNamespace(key=key, robot=robot, joint=joint)
        for key, robot, joint in (("bias", 1, 3), ("scale", 1, 3), ("friction", 2, 1))
    )
    best = Team({3: 100.0, 2: 60.0, 1: 20.0}, [bias, other, scale])
    law = SimpleNamespace(key="law", robot=1, joint=3)
    lawful = Team({2: 100.0 + lead}, [other, law])
    places = [SimpleNamespace(robot=robot, joint=joint) for robot, joint in ((1, 3), (2, 1), (1, None))]
    rig = SimpleNamespace(bench=SimpleNamespace(places=places))
    start, where = [], []
    monkeypatch.setattr(instead, "exact", lambda rig, hypothesis, nothing: hypothesis)
    monkeypatch.setattr(instead, "located", lambda fit, bench, places: where.extend(places) or list(places))
    monkeypatch.setattr(instead, "likely_causes", lambda hypothesis: ())
    monkeypatch.setattr(search, "unlisted_nats", lambda hypothesis: 0.0)
    monkeypatch.setattr(Team, "fit", None, raising=False)

    def with_one(searched, bench, places, say, forms):
        start.append([cause.key for cause in searched.best.causes])
        return Searched(rig, nothing, lawful, ((), ())), {}

    monkeypatch.setattr(instead, "with_one", with_one)
    nothing = SimpleNamespace(score=0.0)
    found = in_place_of_several(Searched(rig, nothing, best, ((), (), ())))
    assert start == [["friction"]]
    assert where == places[:1]
    assert (found is not None) == taken
    assert found is None or found.searched.best is lawful

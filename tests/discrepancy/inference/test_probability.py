"""Probabilities: limits and directions, and whether causes named with them are there as often as they say."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import binom, halfnorm, norm

from discrepancy import rules
from discrepancy.engine.explanation import explain
from discrepancy.inference.probability import parted, probability, told_nats
from discrepancy.inference.search import search
from discrepancy.law_doubt import LawDoubt
from fake_rig import FakeRig

DOUBT = LawDoubt(0.2)


def test_limits():
    assert probability([], 0.0, DOUBT) == pytest.approx(1.0, abs=1e-5)
    assert probability([np.inf], 0.0, DOUBT) == pytest.approx(1.0, abs=1e-5)
    assert probability([0.0], 0.0, DOUBT) == pytest.approx(0.5, abs=1e-5)
    assert probability([0.0, 0.0, 0.0], 0.0, DOUBT) == pytest.approx(0.25, abs=1e-5)
    assert probability([-np.inf], 0.0, DOUBT) < 1e-20
    assert probability([], 1.0, DOUBT) < 1e-4


def test_rivals_divide_it_by_their_likelihoods():
    gaps = np.array([0.3, 2.0, 5.0])
    shares = np.exp(-np.array([0.0, *gaps]))
    assert probability(gaps, 0.0, DOUBT) == pytest.approx(shares[0] / shares.sum(), abs=1e-5)


@pytest.mark.parametrize("share", [0.05, 0.2, 0.4, 0.8])
@pytest.mark.parametrize("law", [0.1, 0.2, 1.0])
def test_law_against_something_unlisted(share, law):
    """Bayes' rule with the density of a half-normal share against one that grows with the share."""
    listed = rules.LISTED_ODDS * 2.0 * norm.pdf(share, scale=law)
    unlisted = 2.0 * share
    assert probability([], share, LawDoubt(law)) == pytest.approx(listed / (listed + unlisted), rel=1e-9)


def test_it_falls_with_what_is_left_and_with_nearer_rivals():
    left = [probability([5.0], share, DOUBT) for share in np.linspace(0.01, 1.0, 30)]
    assert np.all(np.diff(left) < 0)
    near = [probability([gap], 0.1, DOUBT) for gap in np.linspace(-10.0, 10.0, 30)]
    assert np.all(np.diff(near) > 0)
    wide = [probability([5.0], 0.5, LawDoubt(law)) for law in (0.1, 0.2, 0.4)]
    assert np.all(np.diff(wide) > 0)


def test_rivals_that_laws_may_be_off_towards():
    """Monte Carlo: two traces a distance apart, data on the line between them, laws off along it by a share."""
    rng = np.random.default_rng(5)
    worth, share, apart = 60.0, 0.15, 4.0
    off = share * np.sqrt(2.0 * worth)
    truth = rng.random(400_000) < 0.5
    seen = np.where(truth, 0.0, apart) + rng.normal(size=truth.size) * np.sqrt(1.0 + off**2)
    gap = 0.5 * ((seen - apart) ** 2 - seen**2)  # of laws that are exact
    doubt = LawDoubt(0.2, share)
    for low, high in ((-4.0, -2.0), (-1.0, 1.0), (3.0, 5.0), (7.0, 9.0)):
        there = (gap > low) & (gap < high)
        stated = probability([0.5 * (low + high)], 0.0, doubt, worth)
        assert truth[there].mean() == pytest.approx(stated, abs=0.02)
    np.testing.assert_allclose(parted([3.0], DOUBT, worth), [3.0])


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 1.0])
def test_what_something_unlisted_leaves_is_not_seen_of_a_weak_cause(share):
    """Against numerical integrals of both densities over the shares that look alike; a strong cause shows all."""
    doubt, worth = LawDoubt(1.0, 0.0, 20.0), 320.0
    low, high = max(share - 0.25, 0.0), min(share + 0.25, 1.0)
    listed, unlisted = quad(halfnorm.pdf, low, high)[0], quad(lambda x: 2.0 * x, low, high)[0]
    odds = rules.LISTED_ODDS * listed / unlisted
    assert probability([], share, doubt, worth) == pytest.approx(odds / (1.0 + odds), rel=1e-6)
    weak = [probability([], 0.0, doubt, nats) for nats in (5.0, 20.0, 100.0, 1e4)]
    assert np.all(np.diff(weak) >= 0.0)
    assert weak[0] < 0.75
    assert weak[-1] > 0.95
    assert probability([], 0.3, doubt, 1e9) == pytest.approx(probability([], 0.3, LawDoubt(1.0)), rel=1e-3)


@pytest.mark.slow
def test_named_causes_are_there_as_often_as_their_probabilities_say():
    """Sixty draws: one of two causes that leave nearly the same trace is there, or the least of a fault, or none."""
    rng = np.random.default_rng(17)
    stated, right, missed = [], [], 0
    for seed in range(60):
        present = int(rng.choice([2, 4] if seed % 3 else [0, 1, 3]))
        size = rng.uniform(18.0, 32.0) if seed % 3 else rng.uniform(2.0, 9.0)
        rig = FakeRig(
            {present: size * rng.choice([-1.0, 1.0])}, trials=("a", "b"), twins={4: (2, 0.006)}, seed=seed
        )
        found = explain(search(rig)).found
        missed += not found
        for item in found:
            stated.append(item.probability)
            right.append(item.index == present)
    assert len(stated) > 45
    assert missed > 3  # there are faults near the limit among them
    assert 0.6 < np.mean(stated) < 0.97  # the question is open
    low, high = binom.interval(0.99, len(stated), np.mean(stated))
    assert low <= sum(right) <= high
    # And those of more than nine in ten are right more often than the others.
    sure = np.array(stated) > 0.9
    assert np.mean(np.array(right)[sure]) > 0.9
    assert np.mean(np.array(right)[~sure]) < 0.9


def test_as_few_rivals_as_make_a_cause_likelier_than_the_others_cannot_be_told_from_it():
    """By hand: the nearest are left out until what the others have together is no more than the cause has."""
    doubt, worth, gaps = LawDoubt(0.2, 0.2), 870.0, [40.0, 41.0, 45.0, 300.0]
    parts = np.exp(-np.array(gaps) / (1.0 + 2.0 * worth * 0.2**2))
    nearest = next(k for k in range(len(gaps)) if parts[k:].sum() <= 1.0)
    assert nearest == 2
    told = told_nats(gaps, 0.0, doubt, worth)
    assert gaps[nearest - 1] < told < gaps[nearest]
    assert probability(gaps, 0.0, doubt, worth) < rules.LEAST_PROBABILITY
    assert probability(gaps[nearest:], 0.0, doubt, worth) >= rules.LEAST_PROBABILITY
    # Where the cause itself has a half, and where laws are exact, only what the rows put near.
    assert told_nats(gaps[nearest:], 0.0, doubt, worth) == rules.AMBIGUOUS_NATS
    assert told_nats(gaps, 0.0, LawDoubt(0.2), worth) == rules.AMBIGUOUS_NATS

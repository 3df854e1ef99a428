"""Probabilities: limits and directions, and whether causes named with them are there as often as they say."""

import numpy as np
import pytest
from scipy.stats import binom, norm

from discrepancy import rules
from discrepancy.engine.explanation import explain
from discrepancy.inference.probability import probability
from discrepancy.inference.search import search
from fake_rig import FakeRig


def test_limits():
    assert probability([], 0.0, 0.2) == pytest.approx(1.0, abs=1e-5)
    assert probability([np.inf], 0.0, 0.2) == pytest.approx(1.0, abs=1e-5)
    assert probability([0.0], 0.0, 0.2) == pytest.approx(0.5, abs=1e-5)
    assert probability([0.0, 0.0, 0.0], 0.0, 0.2) == pytest.approx(0.25, abs=1e-5)
    assert probability([-np.inf], 0.0, 0.2) < 1e-20
    assert probability([], 1.0, 0.2) < 1e-4


def test_rivals_divide_it_by_their_likelihoods():
    gaps = np.array([0.3, 2.0, 5.0])
    shares = np.exp(-np.array([0.0, *gaps]))
    assert probability(gaps, 0.0, 0.2) == pytest.approx(shares[0] / shares.sum(), abs=1e-5)


@pytest.mark.parametrize("share", [0.05, 0.2, 0.4, 0.8])
@pytest.mark.parametrize("law", [0.1, 0.2, 1.0])
def test_law_against_something_unlisted(share, law):
    """Bayes' rule with the density of a half-normal share against one that grows with the share."""
    listed = rules.LISTED_ODDS * 2.0 * norm.pdf(share, scale=law)
    unlisted = 2.0 * share
    assert probability([], share, law) == pytest.approx(listed / (listed + unlisted), rel=1e-9)


def test_it_falls_with_what_is_left_and_with_nearer_rivals():
    left = [probability([5.0], share, 0.2) for share in np.linspace(0.01, 1.0, 30)]
    assert np.all(np.diff(left) < 0)
    near = [probability([gap], 0.1, 0.2) for gap in np.linspace(-10.0, 10.0, 30)]
    assert np.all(np.diff(near) > 0)
    wide = [probability([5.0], 0.5, law) for law in (0.1, 0.2, 0.4)]
    assert np.all(np.diff(wide) > 0)


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

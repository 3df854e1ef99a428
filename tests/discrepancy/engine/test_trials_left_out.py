"""What trials left out of a fit make of the probability of a cause."""

from dataclasses import dataclass

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.engine.diagnose import diagnose
from discrepancy.engine.held_out import predictive_nats
from discrepancy.inference.probability import probability
from discrepancy.law_doubt import LawDoubt
from discrepancy.least_squares.problem import Problem
from fake_rig import CATALOGUE, ROWS, FakeRig, cause

SIZES = (1.5, -0.5, 1.5, -0.5)
"""Of the cause in the trials: half of it in the mean; of two trials the others tell the wrong sign."""


@dataclass
class Unlike(FakeRig):
    """One cause has another size in every trial, and its law may leave any share of its trace.

    Attributes:
        sizes: over ``scale``, by trial.
        scale: in tolerances.
        foreign: noise that makes all trials equally loud; a quiet model would take one for a loud one.
    """

    sizes: tuple = SIZES
    scale: float = 9.0
    foreign: float = 5.0

    def __post_init__(self):
        super().__post_init__()
        column = self.columns_of[self.catalogue[2].key]
        self.data = [
            (x + size * self.scale * column[t][..., 0], local, shared)
            for t, (size, (x, local, shared)) in enumerate(zip(self.sizes, self.data, strict=True))
        ]

    def law_doubt(self, candidate):
        return LawDoubt(share=1.0)


def stated(item):
    """The probability without what was held out."""
    return probability([gap for _, gap in item.rivals], item.share_left, item.doubt, item.over_nothing)


def test_a_cause_that_trials_left_out_speak_against_is_as_likely_wrong_as_not():
    diagnosis = diagnose(Unlike({}))
    (item,) = diagnosis.explanation.suspected
    assert item.candidate.cause == "cause 2"
    assert max(item.folds[1::2]) < -rules.NAMED_NATS < rules.NAMED_NATS < min(item.folds[::2])
    assert item.probability == pytest.approx(rules.CONTRADICTED * stated(item))
    assert item.probability_alike < rules.LEAST_PROBABILITY <= stated(item)
    (note,) = [note for note in diagnosis.notes if "is less likely with it" in note]
    worst = "abcd"[int(np.argmin(item.folds))]
    assert note.startswith(f"Cause 2 (robot 1): as the others tell it, {worst} is less likely with it, by ")
    assert f"by {-min(item.folds):.0f} nats" in note


def test_one_that_they_speak_for_keeps_its_probability():
    diagnosis = diagnose(Unlike({}, sizes=(1.0, 1.0, 0.9, 1.1)))
    (item,) = diagnosis.explanation.found
    assert min(item.folds) > rules.NAMED_NATS
    assert item.probability == stated(item)
    assert not any("less likely with it" in note for note in diagnosis.notes)


def of_normal(z, covariance):
    """Log density of a normal distribution, but for a constant."""
    return -0.5 * (z @ np.linalg.solve(covariance, z) + np.linalg.slogdet(covariance)[1])


@pytest.mark.parametrize("tolerance", [0.0, 1.0])
def test_nats_are_those_of_normal_distributions(tolerance):
    """log p(trial | others) from the covariance of all numbers of all trials, nothing projected or eliminated."""
    catalogue = (*CATALOGUE[:2], cause("asked", tolerance=tolerance))
    rig = FakeRig({0: 3.0, 2: 0.7}, ("a", "b", "c"), catalogue)
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    size, trials = ROWS * 4, range(3)
    vague = 1e3

    def flat(t, x):
        """Numbers of one trial among those of all."""
        out = np.zeros((3 * size, x.shape[-1] if x.ndim == 3 else 1))
        out[t * size : (t + 1) * size] = x.reshape(size, -1)
        return out

    z = sum(flat(t, rig.data[t][0]) for t in trials)[:, 0]
    known = np.eye(3 * size)
    for t in trials:
        own = vague * flat(t, rig.data[t][1])
        known += own @ own.T
    shared = vague * sum(flat(t, rig.data[t][2]) for t in trials)
    columns = [sum(flat(t, rig.columns_of[c.key][t]) for t in trials) for c in catalogue]
    known += shared @ shared.T + columns[1] @ columns[1].T + vague**2 * columns[0] @ columns[0].T
    asked = columns[2]
    inverse = np.linalg.solve(known, asked)
    likeliest = float(abs(inverse[:, 0] @ z) / (inverse[:, 0] @ asked[:, 0]))
    with_it, without = (known + s**2 * asked @ asked.T for s in (likeliest, 0.0))
    expected = []
    for t in trials:
        others = np.ones(3 * size, dtype=bool)
        others[t * size : (t + 1) * size] = False
        at = np.ix_(others, others)
        rows = [of_normal(z, c) - of_normal(z[others], c[at]) for c in (with_it, without)]
        expected.append(rows[0] - rows[1])
    np.testing.assert_allclose(predictive_nats(problem, [0], 2), expected, atol=0.02)
    assert min(map(abs, expected)) > 0.1


def test_of_what_is_there_a_trial_hardly_ever_speaks_against_it():
    """Below -a with a probability of exp(-a) at most: of values drawn as they may be, sizes learnt from all."""
    gains = []
    for seed in range(40):
        size = float(np.random.default_rng(seed).normal(0.0, 0.5))
        rig = FakeRig({2: size}, catalogue=(*CATALOGUE[:2], cause("asked", tolerance=0.0)), seed=seed)
        problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
        gains += predictive_nats(problem, [], 2)
    gains = np.array(gains)
    for a in (0.5, 1.0, 2.0):
        assert np.mean(gains < -a) <= np.exp(-a) + 2.0 * np.sqrt(np.exp(-a) / gains.size)
    assert np.any(gains < -0.5)
    assert np.any(gains > 2.0)

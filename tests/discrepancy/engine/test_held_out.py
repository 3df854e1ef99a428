"""What trials left out of a fit make of the probability of a cause."""

from dataclasses import dataclass

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.engine.diagnose import diagnose
from discrepancy.inference.probability import probability
from discrepancy.law_doubt import LawDoubt
from fake_rig import FakeRig, found_in, names

SIZES = (1.5, -0.5, 1.5, -0.5)
"""Of the cause in the trials: half of it in the mean; of two trials the others tell the wrong sign."""


@dataclass
class Unlike(FakeRig):
    """One cause has another size in every trial; its law may leave any share of its trace.

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


def test_a_cause_that_foretells_other_trials_worse_is_as_likely_wrong_as_not():
    diagnosis = diagnose(Unlike({}))
    (item,) = diagnosis.explanation.suspected
    assert item.candidate.cause == "cause 2"
    assert sum(item.folds) < -2.0 * rules.NAMED_NATS
    assert max(item.folds[1::2]) < 0.0 < min(item.folds[::2])
    assert item.probability == pytest.approx(rules.CONTRADICTED * stated(item))
    assert item.probability_alike < rules.LEAST_PROBABILITY <= stated(item)
    (note,) = [note for note in diagnosis.notes if "foretells a trial worse" in note]
    assert note.startswith("Cause 2")
    assert f"by {-sum(item.folds):.0f} of chi-square" in note


def test_one_that_foretells_them_keeps_its_probability():
    diagnosis = diagnose(Unlike({}, sizes=(1.0, 1.0, 0.9, 1.1)))
    (item,) = diagnosis.explanation.found
    assert min(item.folds) > 0.0
    assert item.probability == stated(item)
    assert not any("foretells" in note for note in diagnosis.notes)


def test_one_that_is_hardly_there_is_not_contradicted_by_chance():
    """Folds of what is no more than noise are about nought, and not below by what has to speak for a cause."""
    sums = [
        sum(item.folds)
        for seed in range(6)
        for item in found_in(FakeRig({2: 6.0}, seed=seed)).found
        if names([item]) == ["cause 2"]
    ]
    assert len(sums) >= 3
    assert np.min(sums) > 0.0

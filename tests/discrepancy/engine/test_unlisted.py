"""A misfit that no cause explains, or of which one explains a part."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.engine.diagnose import diagnose
from discrepancy.inference.remainder import unlisted_nats
from discrepancy.inference.search import search
from fake_rig import CATALOGUE, RATE_HZ, ROWS, FakeRig, found_in


def test_misfit_of_unknown_origin_is_unexplained():
    diagnosis = diagnose(FakeRig({}, foreign=3.0), closed_loop=False)
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.causes == ()
    assert diagnosis.explanation.after > 5 * diagnosis.explanation.samples
    assert diagnosis.explanation.unlisted_nats > 1000.0


def test_foreign_misfit_in_one_octave_is_not_noise():
    """A process of its own in a cell, within what chi-square of all numbers would let pass."""
    rig = FakeRig({})
    time = np.arange(ROWS) / RATE_HZ
    for t, (x, *own) in enumerate(rig.data):
        rig.data[t] = x + 1.3 * np.sin(2 * np.pi * 0.3 * time + t)[:, None] * [1, 0, 0, 0], *own
    explanation = found_in(rig)
    assert explanation.found == ()
    assert explanation.unlisted_nats > rules.UNLISTED_NATS
    assert not explanation.clean


@pytest.mark.parametrize(("share", "unlisted"), [(0.0, True), (0.1, False), (0.02, True)])
def test_what_a_law_of_another_form_leaves_is_nothing_unlisted(share, unlisted):
    """A cause of 60 whose real form is off by 6 % of its trace at random: known to be off by ten, or by two."""
    catalogue = [replace(c, form_share=share) if k == 2 else c for k, c in enumerate(CATALOGUE)]
    rig, rng = FakeRig({2: 60.0}, catalogue=tuple(catalogue)), np.random.default_rng(8)
    for t, (x, *own) in enumerate(rig.data):
        rig.data[t] = x + 0.06 * 60.0 * 0.3 * rng.standard_normal(x.shape), *own
    best = search(rig).best
    assert [c.cause for c in best.causes] == ["cause 2"]
    assert (unlisted_nats(best) > rules.UNLISTED_NATS) is unlisted


def test_cause_within_a_larger_foreign_misfit_explains_a_part():
    diagnosis = diagnose(FakeRig({2: 40.0}, foreign=4.0), closed_loop=False)
    assert [f.candidate.cause for f in (*diagnosis.causes, *diagnosis.explanation.suspected)] == ["cause 2"]
    assert diagnosis.verdict in ("partly_explained", "unexplained")
    assert diagnosis.explanation.after > 5 * diagnosis.explanation.samples


class Lawless(FakeRig):
    """Something unlisted whose trace is that of cause 2 but for as much again, of another kind."""

    def __post_init__(self):
        super().__post_init__()
        rng = np.random.default_rng(9)
        for t, (x, *own) in enumerate(self.data):
            self.data[t] = x + 25.0 * 0.3 * rng.standard_normal(x.shape), *own


def test_what_leaves_as_much_as_it_explains_is_suspected_only():
    diagnosis = diagnose(Lawless({2: 25.0}), closed_loop=False)
    assert diagnosis.causes == ()
    (suspect,) = diagnosis.explanation.suspected
    assert suspect.candidate.cause == "cause 2"
    assert suspect.share_left == pytest.approx(np.sqrt(0.5), abs=0.07)
    assert suspect.over_nothing > 10.0
    assert suspect.probability <= suspect.probability_alike < rules.LEAST_PROBABILITY
    assert diagnosis.explanation.hypothesis.free == ()
    assert diagnosis.verdict == "unexplained"

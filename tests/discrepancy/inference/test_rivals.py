"""What could be there instead: look-alikes, and the gap to them."""

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.engine.diagnose import diagnose
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.search import search
from discrepancy.least_squares.problem import Problem
from fake_rig import TWINS, FakeRig, names


def test_look_alike_is_a_rival_at_its_distance():
    rig = FakeRig({2: 25.0}, twins=TWINS)
    diagnosis = diagnose(rig, closed_loop=False)
    assert len(diagnosis.causes) == 1
    named = diagnosis.causes[0].candidate.cause
    assert named in ("cause 2", "cause 4")
    alternatives = diagnosis.alternatives[0]
    assert alternatives[0].candidate.cause == ("cause 4" if named == "cause 2" else "cause 2")
    assert all(a.evidence_gap > 20 for a in alternatives[1:])
    gap = alternatives[0].evidence_gap
    assert 0 <= gap < 5
    assert alternatives[0].ambiguous
    assert alternatives[0].chi2_per_n is None
    assert diagnosis.causes[0].probability == pytest.approx(1.0 / (1.0 + np.exp(-gap)), abs=0.01)

    told = diagnose(FakeRig({2: 25.0}, twins={4: (2, 0.04)}), closed_loop=False)
    assert names(told.causes) == ["cause 2"]
    assert told.alternatives[0][0].candidate.cause == "cause 4"
    assert told.alternatives[0][0].evidence_gap > 20
    assert not told.alternatives[0][0].ambiguous


def test_gap_is_the_difference_of_scores():
    """Of the hypotheses with the one and the other, each from the start."""
    rig = FakeRig({2: 25.0}, twins={4: (2, 0.04)})
    searched = search(rig)
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    scores = [Hypothesis.of(problem, [i]).score for i in (2, 4)]
    rivals = {None if r.candidate is None else r.candidate.cause: r.gap for r in searched.rivals[0]}
    assert rivals["cause 4"] == pytest.approx(scores[0] - scores[1], abs=6 * rules.LEARN_NATS)
    assert rivals[None] == pytest.approx(
        scores[0] - Hypothesis.of(problem, []).score, abs=6 * rules.LEARN_NATS
    )


def test_one_among_many_alike_is_named_with_its_look_alikes():
    """Of four that leave the same trace none is likelier than not; that it is one of them is as good as certain."""
    diagnosis = diagnose(FakeRig({2: 25.0}, twins={k: (2, 0.0005) for k in (4, 6, 7)}), closed_loop=False)
    (found,) = diagnosis.causes
    alike = [a.candidate.cause for a in diagnosis.alternatives[0] if a.ambiguous]
    assert sorted([found.candidate.cause, *alike]) == ["cause 2", "cause 4", "cause 6", "cause 7"]
    gaps = [a.evidence_gap for a in diagnosis.alternatives[0] if a.ambiguous]
    assert found.probability == pytest.approx(1.0 / (1.0 + np.sum(np.exp(-np.array(gaps)))), abs=0.01)
    assert found.probability < 0.5
    assert found.probability_alike > 0.99

"""What a further cause has to take away, where the first one leaves much in other channels."""

import numpy as np
import pytest

from discrepancy.engine.leaders import Leader
from discrepancy.engine.search import search
from discrepancy.engine.worth import is_another
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from fake_rig import CATALOGUE, CHANNELS, ROWS, FakeRig, cause

POSES, FORCES = slice(0, 2), slice(2, 4)
EVENT = 3


def rig_with(kinds, foreign_in):
    """Cause 2 is there, something foreign in two channels, and cause 3, which acts on the other two alone."""
    catalogue = (*CATALOGUE[:EVENT], cause("cause 3", tolerance=0.0), *CATALOGUE[EVENT + 1 :])
    rig = FakeRig({2: 60.0}, catalogue=catalogue, kinds=kinds)
    rng = np.random.default_rng(11)
    for t, (x, local, shared) in enumerate(rig.data):
        column = np.zeros((ROWS, CHANNELS, 1))
        column[:, FORCES] = 0.3 * rng.standard_normal((ROWS, 2, 1))
        rig.columns_of[catalogue[EVENT].key][t] = column
        x = x + column @ np.array([2.0])
        x[:, foreign_in] += 2.0 * rng.standard_normal((ROWS, 2))
        rig.data[t] = x, local, shared
    return rig


@pytest.mark.parametrize(
    ("kinds", "foreign_in", "expected"),
    [
        (("pose", "pose", "force", "force"), POSES, ["cause 2", "cause 3"]),
        # One kind of channels: what is left there speaks against a cause that takes a tenth of it.
        (("any",) * 4, POSES, ["cause 2"]),
        (("pose", "pose", "force", "force"), FORCES, ["cause 2"]),
    ],
)
def test_only_channels_that_a_further_cause_acts_on_count(kinds, foreign_in, expected):
    found = search(rig_with(kinds, foreign_in)).found
    assert [f.candidate.cause for f in found] == expected
    if len(found) > 1:
        assert found[1].values[0] == pytest.approx(2.0, abs=0.4)


@pytest.mark.parametrize(("other", "apart", "expected"), [(4, 0.005, False), (4, 0.5, True), (5, None, True)])
def test_what_makes_a_named_cause_unknown_is_no_other(other, apart, expected):
    """Columns alike to half a percent divide a value at will; with one within its tolerance the other is known."""
    rig = FakeRig({2: 25.0}, twins={} if apart is None else {other: (2, apart)})
    problem = Problem.of(rig.rows(rig.candidates()), rig.candidates())
    fit = Fit.of(problem, [2])
    evidence = fit.evidence_of(other)
    assert is_another(fit, Leader(evidence, problem, 0.0)) is expected
    nothing_named = Fit.of(problem)
    assert is_another(nothing_named, Leader(evidence, problem, 0.0))

"""Search and diagnosis on a rig of pure numbers, where the truth is known."""

import logging
from dataclasses import dataclass

import numpy as np
import pytest

from discrepancy.engine.diagnose import diagnose
from discrepancy.engine.explanation import explain
from discrepancy.inference.search import search
from discrepancy.rules import CLEAN_CHI2_PER_N
from fake_rig import CATALOGUE, FakeRig, cause, found_in, names


@pytest.mark.parametrize("seed", range(5))
def test_clean_data_have_no_cause(seed):
    rig = FakeRig({}, seed=seed)
    diagnosis = diagnose(rig, closed_loop=False)
    explanation = diagnosis.explanation
    assert names(explanation.found) == names(explanation.suspected) == []
    assert explanation.scatter == ()
    assert explanation.samples == 4 * 120 * 4
    assert explanation.after == explanation.before < CLEAN_CHI2_PER_N * explanation.samples
    assert diagnosis.verdict == "consistent"
    assert diagnosis.not_simulated
    assert diagnosis.notes == ()


def test_why_something_is_named_is_in_the_log(caplog):
    """What was offered, how much it had to gain, and what became of it: gains add up to what the search found."""
    with caplog.at_level(logging.DEBUG, logger="discrepancy.inference.search"):
        searched = search(FakeRig({2: 25.0}))
    said = [record.getMessage() for record in caplog.records]
    gains = [float(line.split(": ")[1]) for line in said if ", there:" in line]
    assert len(gains) == 1
    assert gains[0] == pytest.approx(searched.best.score - searched.nothing.score, abs=0.1)
    assert said[0].startswith("beside nothing")
    assert said[1].strip().startswith("cause 2")
    assert any(line.startswith("beside cause 2") for line in said)


def test_nothing_is_said_unless_asked_for(caplog):
    search(FakeRig({2: 25.0}))
    assert caplog.records == []


@pytest.mark.parametrize("seed", [1, 2])
def test_one_cause_is_found_with_its_value(seed):
    rig = FakeRig({2: 25.0}, seed=seed)
    off = np.random.default_rng(seed).standard_normal(10)  # as the rig draws them; the sixth has two numbers
    explanation = found_in(rig)
    assert names(explanation.found) == ["cause 2"]
    found = explanation.found[0]
    se = np.sqrt(found.covariance[0, 0])
    assert abs(found.values[0] - (25.0 + off[2])) < 3.0 * se
    assert 0.02 * 24.0 < se < 0.7  # the law is off by a fiftieth, besides
    assert found.probability > 0.99
    assert found.over_nothing > 100.0
    assert len(found.folds) == 4
    # Each of four trials shows it: half of 25 squared times 480 numbers of 0.09, less what the unknowns take.
    np.testing.assert_allclose(found.folds, 0.5 * 25.0**2 * 480 * 0.09, rtol=0.25)
    assert found.held_out > 0.9
    assert found.in_sample > 0.9
    assert explanation.explained > 0.9
    np.testing.assert_allclose(explanation.shared, [-4.0, 3.0, -2.0], atol=0.6)
    for local, own in zip(explanation.local, rig.own, strict=True):
        np.testing.assert_allclose(local, -own, atol=0.3)


def test_two_causes_are_found_the_larger_first():
    explanation = found_in(FakeRig({2: 20.0, 5: [40.0, -30.0]}))
    assert names(explanation.found) == ["cause 5", "cause 2"]
    # Columns are independent and alike in size, so shares are those of the squares: 2500 and 400 of 2900.
    for kind in ("in_sample", "held_out"):
        shares = [getattr(found, kind) for found in explanation.found]
        np.testing.assert_allclose(shares, [25 / 29, 4 / 29], atol=0.06)
        assert 0.95 < sum(shares) <= 1.0 + 1e-9
    np.testing.assert_allclose(explanation.found[0].values, [40.0, -30.0], atol=2.5)
    assert explanation.found[1].values[0] == pytest.approx(20.0, abs=2.5)
    assert diagnose(FakeRig({2: 20.0, 5: [40.0, -30.0]}), closed_loop=False).verdict == "explained"


def test_no_more_causes_than_asked_for():
    rig = FakeRig({k: 30.0 for k in range(3)})
    assert len(search(rig, most=2).best.free) == 2
    assert len(search(rig).best.free) == 3
    assert search(rig, most=0).best.free == ()


def test_single_trial_says_so():
    diagnosis = diagnose(FakeRig({2: 40.0}, trials=("only",)), closed_loop=False)
    assert names(diagnosis.causes) == ["cause 2"]
    assert diagnosis.causes[0].held_out is None
    assert any("One trial only" in note for note in diagnosis.notes)


def test_progress_is_told():
    said, simulated = [], []
    rig = FakeRig({2: 25.0}, loop=lambda c, t: 1.1 if c else 9.0)
    diagnose(rig, say=said.append, simulated=simulated.append)
    assert said[0] == "columns"
    assert "scan" in said
    assert "simulate" in said
    assert any(what.startswith("refit cause 2") for what in said)
    assert sum(simulated) == len(rig.calls)


@dataclass
class Sum(FakeRig):
    """Cause 6 leaves nearly the trace of causes 0 and 1 together."""

    def __post_init__(self):
        super().__post_init__()
        key = self.catalogue[6].key
        parts = [self.columns_of[self.catalogue[k].key] for k in (0, 1)]
        self.columns_of[key] = [
            a + b + 0.065 * c for a, b, c in zip(*parts, self.columns_of[key], strict=True)
        ]
        for t, (x, *own) in enumerate(self.data):
            self.data[t] = x + 20.0 * (parts[0][t] + parts[1][t])[..., 0], *own


def test_what_the_first_guess_left_goes_once_the_right_ones_stand_there():
    """One that accounts for most comes first, the two behind it are found, and it is taken away."""
    said = []
    catalogue = (*CATALOGUE[:6], cause("cause 6", tolerance=0.0), CATALOGUE[7])
    explanation = explain(search(Sum({}, catalogue=catalogue), progress=said.append))
    assert next(what for what in said if what.startswith("refit")).startswith("refit cause 6")
    assert sorted(names(explanation.found)) == ["cause 0", "cause 1"]
    for found in explanation.found:
        assert found.values[0] == pytest.approx(20.0, abs=3.0)

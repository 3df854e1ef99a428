"""What recordings could have shown, on a rig of pure numbers."""

from dataclasses import replace

import pytest

from discrepancy.engine.search import search
from discrepancy.least_squares.fit import Fit
from discrepancy.result.sensitivity import blind_spots, detection_limits
from discrepancy.rules import NOTICED_CHI2
from fake_rig import CATALOGUE, FakeRig, cause


def test_cause_of_the_size_of_its_limit_gains_what_is_needed_to_notice_it():
    """The gain of a cause put into noise-free data, by two fits, at the limit that the noisy data give."""
    rig = FakeRig({}, seed=2)
    explanation = search(rig)
    limits = {entry["cause"]: entry["parameters"] for entry in detection_limits(explanation)}
    assert len(limits) == len(CATALOGUE)
    problem = explanation.problem
    for index in (0, 3):
        column = rig.columns(CATALOGUE[index])
        pure = problem.with_residual([c[..., 0] * limits[CATALOGUE[index].cause]["p0"] for c in column])
        gain = Fit.of(pure).misfit - Fit.of(pure, [index]).misfit
        assert gain == pytest.approx(NOTICED_CHI2, rel=1e-6)


def test_named_causes_have_no_limit():
    explanation = search(FakeRig({2: 25.0}))
    assert "cause 2" not in {entry["cause"] for entry in detection_limits(explanation)}


def test_cause_without_a_trace_is_a_blind_spot():
    """Its columns are those of an unknown."""

    class Blind(FakeRig):
        def columns(self, candidate):
            if candidate.cause == "hidden":
                return [shared[..., :1] for _, _, shared in self.data]
            return super().columns(candidate)

    rig = Blind({}, catalogue=(*CATALOGUE, cause("hidden", robot=2)))
    explanation = search(rig)
    assert [spot["what"] for spot in blind_spots(explanation)] == ["hidden (robot 2)"]
    assert blind_spots(search(FakeRig({}))) == []
    limit = next(e for e in detection_limits(explanation) if e["cause"] == "hidden")
    assert limit["parameters"] == {"p0": None}


def test_limit_shrinks_with_more_trials():
    few, many = (
        detection_limits(search(replace(FakeRig({}), trials=trials)))
        for trials in (("a", "b"), tuple("abcdefgh"))
    )
    for a, b in zip(few, many, strict=True):
        assert b["parameters"]["p0"] < a["parameters"]["p0"]

"""What recordings could have shown, on a rig of pure numbers."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.engine.diagnose import diagnose
from discrepancy.engine.explanation import Explanation
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.result.evidence_list import nats, needed_nats
from discrepancy.result.sensitivity import blind_spots, detection_limits
from fake_rig import CATALOGUE, FakeRig, cause

SEVERAL = tuple(cause(f"kind {k % 2}", robot=1 + k // 2) for k in range(8))

BOUNDED = tuple(replace(candidate, most_spread=1.0) for candidate in SEVERAL)


def explained(rig: FakeRig) -> Explanation:
    return diagnose(rig).explanation


@pytest.mark.parametrize(
    "catalogue",
    [CATALOGUE, SEVERAL, BOUNDED],
    ids=["one of a kind", "four of a kind", "four that cannot scatter"],
)
def test_cause_of_the_size_of_its_limit_is_named_nine_times_in_ten(catalogue: tuple) -> None:
    """By the engine's own comparison of hypotheses, spreads learnt anew, on data with the fault and no noise."""
    rig = FakeRig({}, seed=2, catalogue=catalogue)
    explanation = explained(rig)
    limits = {(e["cause"], e["robot"]): e["parameters"]["p0"] for e in detection_limits(explanation)}
    assert len(limits) == len(catalogue)
    problem = explanation.nothing.problem
    for index in (0, 3):
        candidate = catalogue[index]
        limit = limits[candidate.cause, candidate.robot]
        information = explanation.fit.told(index)[0][0, 0]
        low = limit - rules.NOTICED_SE / np.sqrt(information)
        # Healthy ones are off by their tolerance, as told, and the fault by as much as nine in ten.
        values = [explanation.fit.part(k)[0] for k in range(len(catalogue))]
        values[index] = np.full(1, low)
        pure = [
            np.sum([rig.columns(c)[t] @ v for c, v in zip(catalogue, values, strict=True)], axis=0)
            for t in problem.trials
        ]
        base = Hypothesis.of(problem.with_residual(pure), ())
        assert nats(base, index) == pytest.approx(needed_nats(problem, candidate), rel=0.1)


def test_named_causes_have_no_limit() -> None:
    explanation = explained(FakeRig({2: 25.0}))
    assert "cause 2" not in {entry["cause"] for entry in detection_limits(explanation)}


def test_cause_without_a_trace_is_a_blind_spot() -> None:
    """Its columns are those of an unknown."""

    class Blind(FakeRig):
        def columns(self, candidate):
            if candidate.cause == "hidden":
                return [shared[..., :1] for _, _, shared in self.data]
            return super().columns(candidate)

    rig = Blind({}, catalogue=(*CATALOGUE, cause("hidden", robot=2)))
    explanation = explained(rig)
    assert [spot["what"] for spot in blind_spots(explanation)] == ["hidden (robot 2)"]
    assert blind_spots(explained(FakeRig({}))) == []
    limit = next(e for e in detection_limits(explanation) if e["cause"] == "hidden")
    assert limit["parameters"] == {"p0": None}


def test_limit_shrinks_with_more_trials() -> None:
    few, many = (
        detection_limits(explained(replace(FakeRig({}), trials=trials)))
        for trials in (("a", "b"), tuple("abcdefgh"))
    )
    for a, b in zip(few, many, strict=True):
        assert b["parameters"]["p0"] < a["parameters"]["p0"]

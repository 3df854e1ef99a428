"""What is at the likeliest's place is looked at in its best shape, too: in that of a scan it may explain little."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.offer.propose import proposals
from discrepancy.inference.scan import in_best_shape, scan
from discrepancy.least_squares.problem import Problem
from fake_rig import CATALOGUE, RATE_HZ, ROWS, FakeRig, cause

TRUE_S, SIZE = 0.8, 30.0
PATTERN = np.array([1.0, -0.7, 0.4, 0.9])


class Decaying(FakeRig):
    """A decay at joint 1 of robot 1, of which the scan has but the fast one, beside what imitates it in part."""

    def __post_init__(self):
        super().__post_init__()
        decay = next(c for c in self.catalogue if c.cause == "decay")
        true = self.columns(decay.in_shape({"time_s": TRUE_S}))
        for t, (x, *own) in enumerate(self.data):
            rng = np.random.default_rng(t)
            self.columns_of["imitator", 1, 1][t] = 0.8 * true[t] + 0.01 * rng.standard_normal(true[t].shape)
            self.data[t] = (x + SIZE * true[t][..., 0], *own)

    def columns(self, candidate):
        if candidate.cause != "decay":
            return super().columns(candidate)
        time = np.arange(ROWS) / RATE_HZ
        each = [
            np.exp(-(time % (3.0 + 0.5 * t)) / candidate.shape["time_s"]) for t in range(len(self.trials))
        ]
        return [0.1 * (one[:, None] * PATTERN)[..., None] for one in each]

    def refinements(self, candidate, *, finer=False):
        if candidate.cause != "decay":
            return []
        near = candidate.shape["time_s"] * (
            np.array([0.6, 0.9, 1.1, 1.7]) if finer else 2.0 ** np.arange(-1.0, 1.1)
        )
        return [candidate.in_shape({"time_s": float(one)}) for one in near]


@pytest.mark.parametrize(
    ("robot", "joint", "first"), [(1, 1, "decay"), (1, None, "decay"), (2, 1, "imitator")]
)
def test_what_is_at_the_same_place_is_sharpened_though_its_scan_is_far_behind(robot, joint, first):
    decay = replace(cause("decay", robot, 0.0, joint=joint), shape={"time_s": 0.06})
    rig = Decaying({}, catalogue=(*CATALOGUE, cause("imitator", 1, 0.0, joint=1), decay))
    candidates = rig.candidates()
    base = Hypothesis.of(Problem.of(rig.rows(candidates), candidates), ())
    seen = {item.candidate.cause: in_best_shape(rig, base.fit, item).score for item in scan(base.fit)}
    share = seen["decay"] / seen["imitator"]
    assert rules.PLACE_SHARE < share < 1.0 - rules.CLOSE_NATS / seen["imitator"]
    proposed = proposals(rig, base)
    assert proposed.best is not None
    assert proposed.best.causes[-1].cause == first
    assert first != "decay" or proposed.best.causes[-1].shape["time_s"] == pytest.approx(TRUE_S, rel=0.2)

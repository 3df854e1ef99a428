"""A cause whose only other shape is one with more to it gets that, too, where it is the likeliest."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.offer.propose import Offer, _sharper
from discrepancy.inference.scan import scan
from discrepancy.inference.shape.sharpen import sharpened
from discrepancy.least_squares.problem import Problem
from fake_rig import CATALOGUE, RATE_HZ, ROWS, FakeRig, cause

PATTERN = np.array([1.0, -0.7, 0.4, 0.9])
DRAG = cause("drag", tolerance=0.0)


class Squares(FakeRig):
    """What resists goes with a speed's square."""

    def __post_init__(self):
        super().__post_init__()
        square = self.columns(replace(DRAG, shape={"powers": 2.0}))
        for t, (x, *own) in enumerate(self.data):
            self.data[t] = (x + 30.0 * square[t][..., 0], *own)

    def columns(self, candidate):
        if candidate.cause != "drag":
            return super().columns(candidate)
        speeds = (np.sin(np.arange(ROWS) / RATE_HZ * (0.9 + 0.3 * t)) for t in range(len(self.trials)))
        power = candidate.shape.get("powers", 1.0)
        return [0.2 * (np.sign(v) * np.abs(v) ** power)[:, None, None] * PATTERN[:, None] for v in speeds]

    def further(self, candidate):
        plain = candidate.cause == "drag" and not candidate.shape
        return [replace(candidate, shape={"powers": 2.0})] if plain else []


def test_more_to_a_shape_is_sought_though_a_scan_puts_others_before_it():
    """Where a kind scatters, a scan puts all its places first; the likeliest had been looked at in one shape alone."""
    rig = Squares({}, catalogue=(*CATALOGUE, DRAG), seed=2)
    candidates = rig.candidates()
    base = Hypothesis.of(Problem.of(rig.rows(candidates), candidates), ())
    item = next(one for one in scan(base.fit) if one.candidate.cause == "drag")
    first = replace(item, index=0, candidate=candidates[0], score=item.score + 10.0 * rules.CLOSE_NATS)
    rough = sharpened(rig, base, item, near=False)
    offers = {
        (one.candidate.key, None): Offer(one.candidate, score, score)
        for one, score in ((first, base.score - 5.0), (item, rough.score))
    }
    pairs = [(first, base.score - 5.0), (item, rough.score)]
    ((_, best),) = _sharper(rig, base, [first, item], {}, pairs, offers)
    assert best.causes[-1].shape == {"powers": 2.0}
    assert best.fit.part(best.free[-1])[0][0] == pytest.approx(30.0, rel=0.1)
    assert best.score > rough.score + rules.CLOSE_NATS

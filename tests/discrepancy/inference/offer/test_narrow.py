"""What has a shape is sought with every kind within its tolerance, where it could be there at all."""

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.offer.narrow import with_kinds_narrow
from discrepancy.inference.scan import score_of
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from fake_rig import NINE, FakeRig, cause


class Rigid(FakeRig):
    """Beside a kind that scatters, one that has a shape."""

    rigid = ("payload",)


@pytest.mark.parametrize(("size", "sought"), [(0.2, False), (0.6, True)])
def test_it_is_sought_where_it_is_likelier_than_not(size, sought):
    off = {k: 20.0 * value for k, value in enumerate(np.random.default_rng(5).standard_normal(9))}
    rig = Rigid({**off, 9: size}, catalogue=(*NINE, cause("payload", None, 0.0)))
    candidates = rig.candidates()
    base = Hypothesis.of(Problem.of(rig.rows(candidates), candidates), ())
    assert base.problem.spread[0] > rules.HELD_FACTOR
    narrow = base.problem.with_noise(base.problem.power, np.ones_like(base.problem.spread))
    score = score_of(Fit.of(narrow, ()), 9)
    assert (score > rules.NARROW_NATS) == sought
    assert score > rules.LOOKED_AT_NATS
    assert len(with_kinds_narrow(rig, base, base)) == sought

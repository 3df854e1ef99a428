"""More to a shape is told only where it is worth its share of the plain one."""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.scan import Scanned
from discrepancy.inference.shape.sharpen import sharpened
from discrepancy.least_squares.problem import Problem
from fake_rig import CATALOGUE, RATE_HZ, ROWS, FakeRig, cause

CREEP = cause("creep")
PATTERN = np.array([1.0, -0.7, 0.4, 0.9])


class Creeping(FakeRig):
    """Besides the others a way that grows from the beginning, or from later on."""

    truth: ClassVar = {}

    def __post_init__(self):
        super().__post_init__()
        true = self.columns(CREEP.in_shape(self.truth))
        self.data = [(x + 30.0 * true[t][..., 0], *own) for t, (x, *own) in enumerate(self.data)]

    def columns(self, candidate):
        if candidate.cause != "creep":
            return super().columns(candidate)
        time = np.maximum(0.0, np.arange(ROWS) / RATE_HZ - candidate.shape.get("start_s", 0.0))
        return [(time[:, None] * PATTERN)[..., None] for _ in self.trials]

    def further(self, candidate):
        if candidate.cause != "creep" or candidate.shape:
            return []
        return [candidate.in_shape({"start_s": start}) for start in np.arange(0.1, 6.0, 0.1)]


class Sparing(Creeping):
    """A later start must be worth a twentieth of what the creep is."""

    more_share: ClassVar = {"creep": 0.05}


@pytest.mark.parametrize("scatter", [1.0, 100.0])
@pytest.mark.parametrize(
    ("kind", "start_s", "told_s"),
    [
        (Creeping, 0.3, 0.3),
        (Sparing, 0.3, None),
        (Sparing, 4.0, 4.0),
    ],
)
def test_a_later_start_is_told_where_it_is_worth_its_share(kind, start_s, told_s, scatter, monkeypatch):
    """The share is of what the cause explains, whether its kind is known to scatter or not."""
    monkeypatch.setattr(Creeping, "truth", {"start_s": start_s})
    rig = kind({}, catalogue=(*CATALOGUE, CREEP), seed=3)
    candidates = rig.candidates()
    problem = Problem.of(rig.rows(candidates), candidates)
    spread = problem.spread.copy()
    spread[problem.columns_of(len(CATALOGUE))] = scatter
    base = Hypothesis.of(replace(problem, spread=spread), ())
    new = sharpened(rig, base, Scanned(len(CATALOGUE), CREEP, 0.0), near=True)
    assert new.causes[-1].shape.get("start_s") == pytest.approx(told_s)

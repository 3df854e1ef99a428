"""No shape is looked at twice: not beside the same best, not once it was found, not with more to it where none is."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.offer.propose import proposals
from discrepancy.inference.scan import Scanned
from discrepancy.inference.search import search
from discrepancy.inference.shape.best_shape import best_shape
from discrepancy.least_squares.problem import Problem
from fake_rig import CATALOGUE, RATE_HZ, ROWS, FakeRig, cause

TRUE_W, SIZE = 1.313, 1.2
WAVE = replace(cause("wave", tolerance=0.0), shape={"w": 1.3})
PATTERN = np.array([1.0, -0.7, 0.4, 0.9])


class Counting(FakeRig):
    """Besides the others a wave of unknown frequency and depth; it counts how often each shape is asked for."""

    size = SIZE

    def __post_init__(self):
        super().__post_init__()
        wave = replace(WAVE, shape={"w": TRUE_W})
        true = self.columns(wave)
        self.data = [(x + self.size * true[t][..., 0], *own) for t, (x, *own) in enumerate(self.data)]
        self.asked, self.refined = Counter(), Counter()

    def columns(self, candidate):
        if candidate.cause != "wave":
            return super().columns(candidate)
        if hasattr(self, "asked"):
            self.asked[tuple(sorted(candidate.shape.items()))] += 1
        time, deep = np.arange(ROWS) / RATE_HZ, candidate.shape.get("deep", 0.0)
        waves = [
            np.sin(candidate.shape["w"] * time + t + deep * np.sin(time)) for t in range(len(self.trials))
        ]
        return [(wave[:, None] * PATTERN)[..., None] for wave in waves]

    def refinements(self, candidate, *, finer=False):
        if candidate.cause != "wave":
            return []
        w = candidate.shape["w"]
        self.refined[w] += finer
        near = w + np.array([-0.004, -0.002, 0.002, 0.004]) if finer else np.arange(1.1, 1.5, 0.04)
        return [replace(candidate, shape={**candidate.shape, "w": float(x)}) for x in near if x != w]

    def further(self, candidate):
        if candidate.cause != "wave" or "deep" in candidate.shape:
            return []
        return [replace(candidate, shape={**candidate.shape, "deep": deep}) for deep in (1.0, 2.0)]


class Shown(Counting):
    """What has more to it only where there is any."""

    plain_first = ("wave",)


class Absent(Shown):
    """The wave is not there."""

    size = 0.0


def of(rig):
    candidates = rig.candidates()
    problem = Problem.of(rig.rows(candidates), candidates)
    index = next(i for i, c in enumerate(candidates) if c.cause == "wave")
    rig.asked.clear()
    return problem, Scanned(index, candidates[index], 0.0)


def rig_of(kind):
    return kind({}, catalogue=(*CATALOGUE, WAVE), seed=3)


def test_finer_shapes_around_the_same_best_are_looked_at_once():
    """Where the first shape stayed the best, its finer ones had been looked at in every round."""
    rig = rig_of(Shown)
    problem, item = of(rig)
    there = item.candidate.in_shape({"w": TRUE_W})
    problem = problem.with_columns(item.index, there, rig.columns(there))
    best = best_shape(rig, problem, (), replace(item, candidate=there))
    assert best.shape["w"] == pytest.approx(TRUE_W, abs=0.004)
    assert 0 < max(rig.refined.values()) <= 2  # and once more after what has more to it


def test_what_has_more_to_it_is_tried_only_where_there_is_any():
    asked = {}
    for kind in (Shown, Absent):
        rig = rig_of(kind)
        problem, item = of(rig)
        best_shape(rig, problem, (), item)
        asked[kind] = {name for shape in rig.asked for name in dict(shape)}
    assert "deep" in asked[Shown]
    assert "deep" not in asked[Absent]


def test_shapes_that_were_sought_are_where_the_next_look_begins():
    rig = rig_of(Counting)
    problem, _ = of(rig)
    base = Hypothesis.of(problem, ())
    first = proposals(rig, base)
    sought = sum(rig.asked.values())
    assert first.best is not None
    assert first.shapes[first.best.causes[-1].key].shape == first.best.causes[-1].shape
    rig.asked.clear()
    again = proposals(rig, base, shapes=first.shapes)
    assert again.best is not None
    assert again.best.causes[-1].shape == first.best.causes[-1].shape
    assert again.best.score == pytest.approx(first.best.score, abs=1e-9)
    assert sum(rig.asked.values()) < 0.7 * sought


def test_search_finds_the_same_with_and_without_what_was_sought(monkeypatch):
    import discrepancy.inference.search as module

    found = search(rig_of(Counting))
    whole = lambda *args, shapes=None, **how: proposals(*args, **how)  # noqa: E731
    monkeypatch.setattr(module, "proposals", whole)
    again = search(rig_of(Counting))
    assert [c.key for c in found.best.causes] == [c.key for c in again.best.causes]
    assert found.best.score == pytest.approx(again.best.score, abs=1e-6)
    for one, other in zip(found.rivals, again.rivals, strict=True):
        gaps = {r.candidate and r.candidate.key: r.gap for r in other}
        assert one
        for rival in one:
            assert rival.gap == pytest.approx(gaps[rival.candidate and rival.candidate.key], abs=1e-6)

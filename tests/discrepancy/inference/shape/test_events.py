"""What acts for a while: found where and as it acts."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.candidate import Transient
from discrepancy.inference.scan import score_of
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from fake_rig import CATALOGUE, CHANNELS, RATE_HZ, ROWS, FakeRig, cause, found_in, names


def with_push(rig, values, which=0):
    """The rig with one of its events in place."""
    push = rig.transients([])[which]
    t = push.transient.trial
    x, local, shared = rig.data[t]
    rig.data[t] = x + rig.columns(push)[t] @ np.array(values), local, shared
    return rig


class ShapedRig(FakeRig):
    """The last cause is an event; in the catalogue's shape it has the trace of something else."""

    def columns(self, candidate):
        columns = super().columns(candidate)
        if candidate.cause != "event" or candidate.shape:
            return columns
        return [np.roll(c, 31, axis=0) for c in columns]

    def refinements(self, candidate, *, finer=False):
        return [] if finer or candidate.cause != "event" else [replace(candidate, shape={"right": 1.0})]


def test_event_is_found_in_a_shape_that_is_not_the_catalogues():
    catalogue = (*CATALOGUE, cause("event", tolerance=0.0))
    rig = ShapedRig({len(CATALOGUE): 8.0}, catalogue=catalogue, seed=5)
    explanation = found_in(rig)
    assert names(explanation.found) == ["event"]
    assert explanation.found[0].candidate.shape == {"right": 1.0}
    assert explanation.found[0].values[0] == pytest.approx(8.0, abs=0.5)
    unseen = score_of(Fit.of(Problem.of(rig.rows(rig.candidates()), rig.candidates())), len(CATALOGUE))
    assert unseen < rules.NAMED_NATS  # the scan alone would not have


def test_event_in_place_is_found_and_noise_alone_is_not():
    """A burst that the event's columns make, and one of random numbers that they merely overfit."""
    explanation = found_in(with_push(FakeRig({}, burst=(1, 0.0, 2)), [3.0, -2.0]))
    (found,) = explanation.found
    assert found.candidate.transient == Transient(1, 3.2, 4.0)
    assert np.all(np.abs(found.values - [3.0, -2.0]) < 3.0 * np.sqrt(np.diag(found.covariance)))
    assert found.held_out is None
    assert found.folds == ()
    assert found.over_nothing > 100.0

    for size, columns in ((4.0, 60), (30.0, 100)):
        overfit = found_in(FakeRig({}, burst=(1, size, columns)))
        assert names(overfit.found) == []


class Overlapping(FakeRig):
    """Two events of one kind whose intervals overlap, one that does not."""

    INTERVALS = ((20, 60), (45, 85), (90, 115))

    def transients(self, remaining):
        return [
            cause("push", None, 0.0, 1, "push", Transient(1, first / RATE_HZ, (last - first) / RATE_HZ))
            for first, last in self.INTERVALS
        ]

    def _burst_columns(self, t, candidate):
        out = np.zeros((ROWS, CHANNELS, 1))
        if t == candidate.transient.trial:
            for first, last in self.INTERVALS:
                if abs(candidate.transient.start_s - first / RATE_HZ) < 1e-9:
                    pattern = np.random.default_rng(first).standard_normal((last - first, CHANNELS, 1))
                    out[first:last] = pattern
        return out


def test_events_that_overlap_are_one():
    """What is left of one is its form; one that acts later is another."""
    rig = with_push(Overlapping({}), [9.0], 0)
    explanation = found_in(with_push(rig, [4.0], 1))
    assert [f.candidate.transient.start_s for f in explanation.found] == [20 / RATE_HZ]

    rig = with_push(Overlapping({}), [9.0], 0)
    explanation = found_in(with_push(rig, [4.0], 2))
    starts = sorted(f.candidate.transient.start_s for f in explanation.found)
    assert starts == [20 / RATE_HZ, 90 / RATE_HZ]

"""Where a team is made linear again: beside causes elsewhere, and where only rests scatter in place, as noise."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.laws.candidate import candidate_of
from discrepancy.laws.term import Term
from discrepancy.least_squares.problem import Problem
from discrepancy.team.linear.elsewhere import HEALTHY

from discrepancy.team import rows
from discrepancy.team.laws.variable import TIME
from discrepancy.team.linear import start
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import default_tolerances
from estimator.estimate.payload import estimate_payload
from estimator.recording.parquet import read_recording

TIMES = 5.0
NOTHING = SimpleNamespace(causes=[], free=())


@pytest.fixture
def team(biased_trials: list[Path]):
    """Recordings as a rig, with tolerances so many times as wide of what leaves something open at rest."""
    recordings = [read_recording(path) for path in biased_trials[1:]]
    estimate = estimate_payload(recordings, "joint")

    def of(times: float) -> TeamRig:
        wide = {cause: times if cause in HEALTHY else 1.0 for cause in default_tolerances()}
        tolerances = {
            cause: {name: wide[cause] * value for name, value in each.items()}
            for cause, each in default_tolerances().items()
        }
        return TeamRig.of(recordings, estimate, tolerances)

    return of


def test_rests_that_scatter_are_louder_noise_and_nothing_moves(team, monkeypatch):
    rig = team(1.0)
    monkeypatch.setattr(rows, "found_at", lambda *_: SimpleNamespace(curvature=0.0))
    monkeypatch.setattr(rows, "resting_of", lambda _: dict.fromkeys(HEALTHY, TIMES))
    louder = rig.relinearised(NOTHING)
    assert louder is not None
    assert louder.linear is rig.linear
    assert louder.origin is None
    assert louder.resting == dict.fromkeys(HEALTHY, TIMES)
    expected = team(TIMES).whitening
    for before, now, wide in zip(rig.whitening, louder.whitening, expected, strict=True):
        size, of_wide, was = (np.diag(w.chol_moving @ w.chol_moving.T) for w in (now, wide, before))
        # There all is linear where the readings are, and here at their adjusted values.
        np.testing.assert_allclose(size, of_wide, rtol=0.1)
        assert np.max(size / was) > 1.25  # what the scatter adds is more than that tolerance
    # As loud as they are: there is nothing left to do.
    assert louder.relinearised(NOTHING) is None


@pytest.mark.parametrize("cause", ["sea_hardening", "joint_friction", "clock_delay", "payload_tether"])
def test_beside_errors_of_signals_and_forces_alike_it_is_linear_elsewhere(team, monkeypatch, cause):
    """What a cause puts into the residual stays there: rows are as before, less what robots and columns move."""
    rig = team(1.0)
    candidates = rig.candidates()
    nothing = Hypothesis.of(Problem.of(rig.rows(candidates), candidates), ())
    index = next(i for i, c in enumerate(candidates) if c.cause == cause)
    found = Hypothesis.of(nothing.problem, (index,))
    real, adjusted, put = rows.found_at, start.with_adjusted_signals, []
    monkeypatch.setattr(rows, "found_at", lambda *args: replace(real(*args), curvature=2.0))

    def noted(linear, noise, explained):
        put.append(linear.reduction(explained))
        return adjusted(linear, noise, explained)

    monkeypatch.setattr(start, "with_adjusted_signals", noted)
    moved = rig.relinearised(found)
    assert moved is not None
    assert moved.missed == 2.0
    np.testing.assert_array_equal(moved.origin.x, real(rig.linear, rig.whitening, found, None).origin.x)
    assert moved.beside
    # Signals are adjusted to what it leaves.
    ((candidate, values),) = found.fit.active
    for trial, rows_of_it in enumerate(put):
        expected = rig._unwhitened(trial, candidate) @ values
        np.testing.assert_allclose(rows_of_it, expected, atol=0.05 * np.abs(expected).max(axis=0).max())
    there = Problem.of(moved.rows(candidates), candidates)
    value, se = (x.ravel() for x in found.fit.part(index))
    again = Hypothesis.of(there, (index,)).fit.part(index)
    # Within tolerances all is straight: it is found as it was.
    np.testing.assert_allclose(again[0], value, atol=0.3 * np.sqrt(se[0]) + 0.02 * np.abs(value).max())


def test_beside_laws_that_nobody_lists_it_stays(team, monkeypatch):
    rig = team(1.0)
    monkeypatch.setattr(rows, "found_at", lambda *_: pytest.fail("it is not asked where"))
    law = candidate_of(rig.bench.places[0], Term("linear", TIME), 1.0, 1)
    assert rig.relinearised(SimpleNamespace(causes=[law])) is None

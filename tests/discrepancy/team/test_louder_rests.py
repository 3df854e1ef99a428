"""Where only friction at rest or play scatter, their noise is drawn again, and all stays linear where it is."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from discrepancy.team import rows
from discrepancy.team.linear.elsewhere import HEALTHY
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import default_tolerances
from estimator.estimate.payload import estimate_payload
from estimator.recording.parquet import read_recording

TIMES = 5.0


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
    louder = rig.relinearised(None)
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
    assert louder.relinearised(None) is None

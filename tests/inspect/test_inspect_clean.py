"""No false alarms: robots as designed, poorly calibrated ones, and ones with an effect of realistic size."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from effect_cases import example
from estimator.recording.model import Recording
from estimator.recording.parquet import write_recording
from mocobot_inspect.findings import findings
from mocobot_inspect.team import Inspection, inspect_log
from mocobot_logs.open_log import open_log
from mocobot_sim.effects import apply_effects
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import PRESETS
from mocobot_sim.trial.simulate import TrialRequest, simulate
from mocobot_sim.trial.trajectories import static_orientations
from omnid_design import DESIGN

SHORT = {"random": {"vias": 8}, "periodic": {"duration_s": 10.0}, "static": {}}
HOLD_S = 3.0
"""Of static trials: postures count here, not how long they are held."""


def inspected(recording: Recording, folder: Path) -> Inspection:
    path = folder / "rec.parquet"
    write_recording(recording, path)
    return inspect_log(open_log(path), DESIGN)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("payload", "trial", "preset"),
    [
        ("a", "random", "nominal"),
        ("b", "static", "uncalibrated"),
        ("c", "periodic", "nominal"),
        ("d", "random", "uncalibrated"),
    ],
)
def test_trials_of_all_payloads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, payload: str, trial: str, preset: str
) -> None:
    short = partial(static_orientations, hold_s=HOLD_S)
    monkeypatch.setattr("mocobot_sim.trial.simulate.static_orientations", short)
    request = TrialRequest(payload, trial, seed=11, **SHORT[trial])
    recording = simulate(request, [PRESETS[preset]]).recordings[preset]
    found = inspected(recording, tmp_path)
    assert found.wiring is not None
    assert found.wiring.found == ()
    assert not found.wiring.as_is.suspicious
    assert found.wiring.as_is.total < (0.1 if preset == "nominal" else 1.5)
    # What the estimate itself doubts of poorly calibrated robots is not a mistake in the log.
    assert [f.sentence for f in findings(found) if f.topic != "estimate"] == []


@pytest.mark.slow
@pytest.mark.parametrize("cause", ["joint_friction", "base_tilt", "tether"])
def test_robots_with_an_effect(tmp_path: Path, cause: str) -> None:
    scene = apply_effects(build_team("b"), [example(cause, robot=2)])
    done = simulate(TrialRequest("b", "random", seed=4, vias=6), [PRESETS["nominal"]], scene=scene)
    found = inspected(done.recordings["nominal"], tmp_path)
    assert found.wiring is not None
    assert found.wiring.as_is.total < 0.3
    assert findings(found) == []


def test_zeros_of_three_degrees_are_no_mistake_in_the_wiring(tmp_path: Path) -> None:
    """Three times the spread of poor calibration: the misfit may be suspicious, but nothing is accused."""
    rng = np.random.default_rng(6)
    recording = simulate(TrialRequest("a", "random", seed=2, vias=8), [PRESETS["ideal"]]).recordings["ideal"]
    zeros = np.deg2rad(3.0) * rng.standard_normal((2, 3, 3))
    scale = 1 + 0.06 * rng.standard_normal((3, 3))
    changed = Recording(
        recording.time,
        recording.phi + zeros[0],
        recording.theta + zeros[1],
        recording.tau * scale,
        None,
        recording.metadata,
    )
    found = inspected(changed, tmp_path)
    assert found.wiring is not None
    assert found.wiring.found == ()
    assert found.wiring.as_is.total > 0.5

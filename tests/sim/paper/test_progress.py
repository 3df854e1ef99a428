"""Progress of the paper's experiment: from its first second on, of all steps, with the stage by its name."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest
from joblib import Parallel, delayed

from estimator.arrays import Array
from mocobot_sim.paper import experiment
from mocobot_sim.paper import store as shares_module
from mocobot_sim.paper.experiment import PaperPlan, run_paper
from mocobot_sim.paper.store import shares
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.simulate import Simulated
from mocobot_sim.trial.trial_log import TrialLog
from mocobot_sim.trial.truth import GroundTruth


def _work(share: Array, amount: float) -> None:
    share[0] = amount


@pytest.mark.slow
def test_other_processes_fill_shares() -> None:
    told: list[float] = []
    with shares(3, told.append) as done, Parallel(n_jobs=2) as pool:
        assert set(told) == {0.0}
        pool(delayed(_work)(done[k : k + 1], amount) for k, amount in enumerate((0.25, 0.5, 1.0)))
    assert told[-1] == 1.75


def test_parts_of_trials_count(
    monkeypatch: pytest.MonkeyPatch, random_a: TrialLog, team_a: TeamScene
) -> None:
    """Trials that take four looks each, one of which is the end."""
    looks = 0.02
    monkeypatch.setattr(shares_module, "EVERY_S", looks)
    recording = measure(random_a, sensor_preset("ideal"), np.random.default_rng(0), name="rec")

    def simulate(*_: object, progress: Callable[[int, int], object]) -> Simulated:
        for quarter in range(5):
            progress(100 * quarter, 400)
            time.sleep(3.0 * looks)
        return Simulated({"ideal": recording}, random_a, GroundTruth.of(team_a))

    monkeypatch.setattr(experiment, "simulate", simulate)
    monkeypatch.setattr(experiment, "estimate_both", lambda *_: (None, None))
    monkeypatch.setattr(experiment, "score", lambda *_: {})
    plan = PaperPlan(payloads=("a",), presets=("ideal",), trials=2)
    told: list[tuple[float, float, str]] = []
    run_paper(plan, progress=lambda *now: told.append(now))
    done = [now for now, _, _ in told]
    assert done == sorted(done)
    assert (done[0], done[-1]) == (0.0, plan.steps)
    assert {steps for _, steps, _ in told} == {plan.steps}
    stages = list(dict.fromkeys(stage for _, _, stage in told))
    assert stages == ["random trials", "grasps", "other trials", "estimates"]
    assert {0.25, 0.5, 0.75, 1.25, 3.5} < set(done)

"""A trial says whether its control was stable, as the trial itself then shows, and gains have a range."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mocobot
from command import run
from estimator.errors import InputError
from mocobot_sim.control.control import ControlGains
from mocobot_sim.effects import apply_effects, make_effect
from mocobot_sim.scene.free import build_free_team
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.trial.trajectories import Trajectory
from mocobot_sim.trial.trial import run_trial
from mocobot_view.payload import read_truth


def held(scene: TeamScene, samples: int = 2) -> Trajectory:
    home = np.broadcast_to(scene.wrist_home_b, (scene.robots, 3))
    return Trajectory("random", np.repeat(home[None], samples, axis=0))


@pytest.mark.parametrize(("damping", "stable", "warns"), [(50.0, True, False), (5.0, False, True)])
def test_soft_impedance_without_damping_is_unstable(
    team_a: TeamScene, damping: float, stable: bool, warns: bool
) -> None:
    found = run_trial(team_a, held(team_a), ControlGains(damping_Ns_per_m=damping)).stability
    assert found is not None
    assert found.stable is stable
    assert found.stable is (found.growth_per_s < 0)
    assert (found.warning is not None) is warns
    assert 0.5 < found.frequency_Hz < 1.5  # a payload of some 12 kg on three springs of 400 N/m


def test_what_is_hardly_damped_is_warned_of(team_a: TeamScene) -> None:
    found = run_trial(team_a, held(team_a), ControlGains(damping_Ns_per_m=6.5)).stability
    assert found is not None
    assert found.stable
    assert 0 < found.damping_ratio < 0.02
    assert "hardly damped" in str(found.warning)


@pytest.mark.parametrize(("lag_s", "stable"), [(0.005, True), (0.0055, False)])
def test_torques_grow_in_the_trial_as_foretold(
    teams: dict[int, TeamScene], lag_s: float, stable: bool
) -> None:
    """A torque sensor that lags; a tap of micrometres, and what is left of it after one mode is alone."""
    scene = apply_effects(teams[1], [make_effect("torque_lag", {"time_constant_s": lag_s}, 1)])
    motion = held(scene, 280)
    motion.ref_b[5:15] += [1e-6, 2e-6, 0.0]
    log = run_trial(scene, motion)
    assert log.stability is not None
    assert log.stability.stable is stable
    change = np.diff(log.sensed.tau.reshape(2800, 3), axis=0)
    early, late = (np.sqrt(np.mean(change[at : at + 200] ** 2)) for at in (1400, 2400))
    assert np.log(late / early) / 1.0 == pytest.approx(log.stability.growth_per_s, rel=0.05)
    spectrum = np.abs(np.fft.rfft(change[1400:2400, 0]))
    assert np.argmax(spectrum) == pytest.approx(log.stability.frequency_Hz, abs=1.0)  # 1 s: a bin is 1 Hz


def test_robots_that_hold_nothing_are_stable() -> None:
    """Their gimbals stay where they are left, which is no mode that grows."""
    scene = build_free_team(2, (), np.full((2, 3), 0.2))
    found = run_trial(scene, held(scene)).stability
    assert found is not None
    assert found.stable
    assert found.warning is None


def test_the_truth_beside_a_recording_says_it(tmp_path: Path) -> None:
    for damping, stable in ((50.0, True), (5.0, False)):
        done = mocobot.simulate("a", vias=1, gains=ControlGains(damping_Ns_per_m=damping))
        done.write(tmp_path / f"{damping}.parquet")
        control = json.loads((tmp_path / f"{damping}.truth.json").read_text(encoding="utf-8"))["control"]
        assert control["stable"] is stable
        assert set(control) == {"stable", "damping_ratio", "frequency_Hz", "growth_per_s"}
        assert read_truth(tmp_path / f"{damping}.parquet", robots=3).mass_kg == done.truth.mass_kg
        assert "stable" not in (done.metadata.control or {})  # nothing that diagnoses is told


def test_the_command_warns_of_it(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "rec.parquet"
    lag = "torque_lag:robot=2,time_constant=0.006"
    code, text, _ = run(capsys, "simulate", "--payload", "b", "--vias", "1", "--effect", lag, "--out", out)
    assert code == 0
    assert text.splitlines()[0].startswith(f"{out}: ")
    assert text.splitlines()[1].startswith("The control is unstable: a swing of 26 Hz grows")


@pytest.mark.parametrize(
    ("name", "bad", "allowed"),
    [
        ("stiffness_N_per_m", -1.0, "0 to 1e+06"),
        ("damping_Ns_per_m", 1e9, "0 to 100000"),
        ("torque_gain", float("nan"), "0 to 1000"),
        ("take_up_time_constant_s", 0.0, "1e-06 to 3600"),
        ("motor_torque_limit_Nm", True, "0.001 to 100000"),
    ],
)
def test_a_gain_out_of_its_range_is_refused(name: str, bad: float, allowed: str) -> None:
    with pytest.raises(InputError) as refusal:
        replace(ControlGains(), **{name: bad})
    assert str(refusal.value) == f"control.{name} is {bad!r}; it must be a number from {allowed}"

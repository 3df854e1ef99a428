"""Readings of encoders: play against the closed form for a sine, and zeros that differ from trial to trial."""

from types import SimpleNamespace

import numpy as np
import pytest

from effect_cases import example, one_robot
from estimator.errors import InputError
from mocobot_sim.effects import make_effect
from mocobot_sim.scene.scene import build_team
from mocobot_sim.scene.team_index import TeamIndex
from mocobot_sim.trial.trajectories import random_vias
from mocobot_sim.trial.trial import run_trial


def play_of_a_sine(phase: np.ndarray, amplitude: float, half: float) -> np.ndarray:
    """What a play of +-half makes of amplitude sin(phase), from rest in its middle, arc by arc."""
    turns = np.floor((phase + 0.5 * np.pi) / np.pi)  # reversals so far: at pi/2, 3 pi/2, ...
    x, side = amplitude * np.sin(phase), np.where(turns % 2 == 0, 1.0, -1.0)
    held = np.where(turns == 0, 0.0, -side * (amplitude - half))
    return side * np.maximum(side * x - half, side * held)


@pytest.mark.parametrize("half", [0.002, 0.03, 0.0999])
def test_play_of_a_sine_is_that_of_the_closed_form_and_has_its_describing_function(half):
    index = TeamIndex.of(build_team("a").compile())
    (reader,) = make_effect("encoder_play", {"play_rad": 2 * half}, 2, 3).readers(None)
    reader.start(SimpleNamespace(index=index, rate_hz=1000.0))
    amplitude, phase = 0.1, np.linspace(0.0, 6 * np.pi, 60001)
    at, rest, read = index.gimbal_qpos[1, 2], np.arange(200.0), []
    for x in amplitude * np.sin(phase):
        seen = rest.copy()
        seen[at] = x
        reader.read(0, seen)
        read.append(seen[at])
        seen[at] = rest[at]
        np.testing.assert_array_equal(seen, rest)
    np.testing.assert_allclose(read, play_of_a_sine(phase, amplitude, half), rtol=0, atol=1e-9)
    # Its first harmonic over one period, against the describing function of backlash.
    one = slice(40000, 60000)
    u = 1.0 - 2.0 * half / amplitude
    in_phase = (0.5 * np.pi + np.arcsin(u) + u * np.sqrt(1.0 - u * u)) / np.pi
    behind = (u * u - 1.0) / np.pi
    harmonic = 2.0 * np.mean(np.array(read)[one] * np.exp(1j * phase[one])) / amplitude
    np.testing.assert_allclose([harmonic.imag, harmonic.real], [in_phase, behind], rtol=0, atol=1e-5)


@pytest.fixture(scope="module")
def motion(tmp_path_factory):
    scene = one_robot(tmp_path_factory.mktemp("clean"))
    trajectory = random_vias(scene.wrist_home_b, np.random.default_rng(0), 2, box_m=(0.03, 0.03, 0.03))
    return trajectory, run_trial(scene, trajectory)


def test_play_of_a_gimbals_encoder_is_in_the_log_and_moves_nothing(motion, tmp_path):
    trajectory, clean = motion
    log = run_trial(one_robot(tmp_path, example("encoder_play", joint=2, play_rad=3e-3)), trajectory)
    np.testing.assert_array_equal(log.theta, clean.theta)
    np.testing.assert_array_equal(log.sensed.phi, clean.sensed.phi)
    behind = log.sensed.theta - clean.sensed.theta
    assert not behind[:, 0, [0, 2]].any()
    behind = behind[:, 0, 1]
    assert behind.min() == pytest.approx(-1.5e-3, abs=1e-12)
    assert behind.max() == pytest.approx(1.5e-3, abs=1e-12)
    inside = np.abs(behind[1:]) < 1.5e-3 - 1e-12
    assert 0.01 < inside.mean() < 0.9
    np.testing.assert_allclose(np.diff(log.sensed.theta[:, 0, 1])[inside], 0.0, rtol=0, atol=1e-12)


def test_zeros_differ_from_trial_to_trial_and_stay_within_one(motion, tmp_path):
    trajectory, clean = motion
    effect = make_effect("zero_scatter", {"phi_rad": 1e-3, "theta_rad": 2e-3, "draw": 5}, 1)
    scene = one_robot(tmp_path, effect)
    zeros = []
    for trial in (1, 2):
        log = run_trial(scene, trajectory, trial_number=trial)
        read = np.stack(
            [log.sensed.phi[::10, 0] - log.phi[:, 0], log.sensed.theta[::10, 0] - log.theta[:, 0]]
        )
        assert np.ptp(read, axis=1).max() < 1e-12
        np.testing.assert_allclose(read[:, 0], effect.zeros(trial), rtol=0, atol=1e-12)
        zeros.append(read[:, 0])
    assert np.abs(zeros[0] - zeros[1]).min() > 1e-6
    assert np.abs(log.phi - clean.phi).max() > 1e-5, "the controller sees them"


def test_the_scatter_of_zeros_has_the_size_that_was_asked_for():
    effect = make_effect("zero_scatter", {"phi_rad": 1e-3, "theta_rad": 2e-3}, 1)
    zeros = np.array([effect.zeros(trial) for trial in range(4000)])
    np.testing.assert_allclose(zeros.std(axis=(0, 2)), [1e-3, 2e-3], rtol=0.03)
    assert np.abs(np.corrcoef(zeros.reshape(4000, 6).T) - np.eye(6)).max() < 0.07
    other = make_effect("zero_scatter", {"phi_rad": 1e-3, "draw": 1}, 1)
    assert not np.allclose(other.zeros(1)[0], effect.zeros(1)[0])
    with pytest.raises(InputError, match="draw is -1; it must be a whole number of at least 0"):
        make_effect("zero_scatter", {"phi_rad": 1e-3, "draw": -1}, 1)

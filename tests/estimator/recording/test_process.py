"""From joint signals to data points, on exact signals of an analytic motion."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator import signals as process
from estimator.errors import InputError
from estimator.signals import process_recording
from recorded_team import GRASPS, INERTIA, Sines, carry, inertia_by_least_squares
from recordings import metadata, small_recording

PERIODIC = [*np.deg2rad([3.5, 3.5, 3.5]), 0.01, 0.01, 0.01]
RANDOM = [*np.deg2rad([3.0, 3.0, 1.5]), 0.015, 0.015, 0.015]


def carried(kind, seed, duration_s=60.0):
    rng = np.random.default_rng(seed)
    squeeze = Sines.draw(rng, [5.0] * 3, 8, 0.1, 1.5)
    if kind == "periodic":
        return carry(Sines.draw(rng, PERIODIC, 3, 0.3, 0.7), squeeze, duration_s)
    return carry(Sines.draw(rng, RANDOM, 20, 0.1, 1.5), squeeze, duration_s)


def rms(error, reference):
    return np.sqrt(np.mean(error**2) / np.mean(reference**2))


@pytest.fixture(scope="module")
def fast():
    """Motion with content up to 3 Hz."""
    rng = np.random.default_rng(4)
    path = Sines.draw(rng, [*np.deg2rad([2.0, 2.0, 1.0]), 0.01, 0.01, 0.01], 20, 0.2, 3.0)
    return carry(path, Sines.draw(rng, [5.0] * 3, 8, 0.1, 3.0), 20.0)


def test_data_points_are_the_truth_where_the_filter_is_transparent(fast):
    """Cut-off 40 Hz, motion up to 3 Hz: what is left is the error of the method itself."""
    data, keep = process_recording(fast.recording, cutoff_hz=40.0), slice(200, -200)
    assert np.array_equal(data.time, fast.recording.time[keep])
    assert rms(data.twist - fast.twist[keep], fast.twist) < 1e-6
    for part in (slice(0, 3), slice(3, 6)):
        assert rms((data.twist_dot - fast.twist_dot[keep])[..., part], fast.twist_dot[..., part]) < 1e-5
    assert rms((data.wrench - fast.wrench[keep])[..., 3:], fast.wrench[..., 3:]) < 1e-6
    assert rms((data.wrench - fast.wrench[keep])[..., :3], fast.wrench[..., :3]) < 1e-5
    assert np.abs(fast.wrench[..., :3]).max() > 1e-4


def test_blocks_and_robots_do_not_show_in_the_result(fast, monkeypatch):
    """Bit for bit: the whole trial at once, in small blocks, and every robot alone."""
    fields = ("time", "R_bi", "p_bi", "twist", "twist_dot", "wrench")
    monkeypatch.setattr(process, "BLOCK", 10**9)
    whole = process_recording(fast.recording)
    for block in (1, 7, 1000):
        monkeypatch.setattr(process, "BLOCK", block)
        split = process_recording(fast.recording)
        for field in fields:
            assert np.array_equal(getattr(split, field), getattr(whole, field)), (block, field)
    recording = fast.recording
    for robot in range(3):
        parts = {name: getattr(recording, name)[:, [robot]] for name in ("phi", "theta", "tau")}
        alone = process_recording(dataclasses.replace(recording, metadata=metadata(robots=1), **parts))
        for field in fields[1:]:
            assert np.array_equal(getattr(alone, field)[:, 0], getattr(whole, field)[:, robot]), field


def test_poses(fast):
    data, keep = process_recording(fast.recording, cutoff_hz=40.0), slice(200, -200)
    theta = fast.recording.theta[keep]
    expected = Rotation.from_euler("ZYX", theta.reshape(-1, 3)).as_matrix().reshape(data.R_bi.shape)
    assert data.R_bi == pytest.approx(expected, abs=1e-7)
    # The payload is rigid: grasps keep their distance, whatever the base frames.
    tips = [data.p_bi[:, i] @ GRASPS[i][0].T + GRASPS[i][1] for i in range(3)]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        distance = np.linalg.norm(tips[i] - tips[j], axis=1)
        assert distance == pytest.approx(
            np.full(len(distance), np.linalg.norm(GRASPS[i][1] - GRASPS[j][1])), abs=1e-7
        )


def test_meta_data_of_the_result(fast):
    data = process_recording(fast.recording, trim_s=3.0)
    assert (data.rate_hz, data.gravity_mps2, data.robots, data.samples) == (100.0, 9.81, 3, 1400)
    assert data.time[[0, -1]] == pytest.approx([3.0, 16.99])


@pytest.mark.parametrize("seed", range(3))
def test_inertia_bias_of_periodic_motion(seed):
    """The target is 0.02 %; a two-point difference alone would cost 0.1 %."""
    trial = carried("periodic", seed)
    estimate = inertia_by_least_squares(process_recording(trial.recording))
    assert np.linalg.norm(estimate - INERTIA) / np.linalg.norm(INERTIA) < 1e-5


@pytest.mark.parametrize("seed", range(3))
def test_inertia_bias_of_random_motion(seed):
    """Filtered signals obey the nonlinear equations of motion only nearly: part of the method."""
    trial = carried("random", seed)
    estimate = inertia_by_least_squares(process_recording(trial.recording))
    assert np.linalg.norm(estimate - INERTIA) / np.linalg.norm(INERTIA) < 1e-3


def test_every_signal_gets_the_same_filter():
    """Small motion under a low cut-off: gains away from one must cancel between motion and force."""
    rng = np.random.default_rng(1)
    path = Sines.draw(rng, np.array(PERIODIC) / 5, 3, 0.3, 0.7)
    still = Sines.draw(rng, [0.0] * 3, 1, 0.1, 0.2)
    trial = carry(path, still, 60.0)
    data = process_recording(trial.recording, cutoff_hz=1.2)
    assert rms(data.twist_dot - trial.twist_dot[200:-200], trial.twist_dot) > 0.02
    estimate = inertia_by_least_squares(data)
    assert np.linalg.norm(estimate - INERTIA) / np.linalg.norm(INERTIA) < 1e-3


def test_single_robot():
    data = process_recording(small_recording(robots=1))
    assert data.wrench.shape == (200, 1, 6)
    assert np.isfinite(data.wrench).all()


def test_a_motionless_arm_has_no_twist():
    recording = small_recording(ref=False)
    still = dataclasses.replace(
        recording,
        phi=np.full_like(recording.phi, 0.6),
        theta=np.full_like(recording.theta, 0.1),
        tau=5.0 + 1e-9 * recording.tau,  # equal rows would be one reading
    )
    data = process_recording(still)
    assert data.twist == pytest.approx(np.zeros_like(data.twist), abs=1e-11)
    assert data.twist_dot == pytest.approx(np.zeros_like(data.twist_dot), abs=1e-9)


def test_bad_input_is_refused_with_the_recordings_name():
    good = dataclasses.replace(small_recording(rows=401), name="trial.parquet")
    assert process_recording(good).samples == 1
    with pytest.raises(InputError, match=r"^trial.parquet: 401 samples are too few"):
        process_recording(good, trim_s=3.0)
    with pytest.raises(InputError, match=r"^cutoff_hz is 60.0"):
        process_recording(good, cutoff_hz=60.0)
    phi = good.phi.copy()
    phi[3, 0, 0] = np.nan
    with pytest.raises(InputError, match=r"^trial.parquet: column 'omnid1.phi1' is nan"):
        process_recording(dataclasses.replace(good, phi=phi))


def test_the_estimator_does_without_a_simulator():
    code = "import estimator.signals, sys; print('mujoco' in sys.modules, 'dm_control' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]

"""Where friction slides and where it rests, told by encoders whose readings scatter."""

import numpy as np
import pytest
from helpers.team_case import exact

from discrepancy.team.causes import CAUSES
from discrepancy.team.causes.friction import KEPT, _doubtful
from discrepancy.team.linear.noise import QUIET_HZ, QUIET_RAD_PER_S, Noise
from discrepancy.team.linear.signals import TEAM_SMOOTH_HZ, Signals
from estimator.filtering import differentiate
from patchwork import dense

RATE_HZ = 100.0
TIME = np.arange(0.0, 40.0, 1.0 / RATE_HZ)


def read(step: float, sigma: float, angle: np.ndarray, rng: np.random.Generator) -> Signals:
    """Nine angles of two kinds through an encoder, and torques without any noise."""
    noisy = angle[:, None, None] + sigma * rng.standard_normal((len(angle), 3, 3))
    rounded = np.round((noisy + step * rng.uniform(size=(3, 3))) / step) * step if step else noisy
    return Signals(TIME, rounded, rounded.copy(), np.zeros_like(rounded), RATE_HZ)


def moved_and_rested() -> np.ndarray:
    """Of a joint that swings for 20 s, rests, and goes on the other way [rad]."""
    swings = 0.1 * np.sin(2.0 * np.pi * 0.3 * np.minimum(TIME, 20.0))
    return swings - 0.02 * np.clip(TIME - 30.0, 0.0, 8.0)


@pytest.mark.parametrize("sigma_steps", [0.5, 0.8])
@pytest.mark.parametrize("bits", [14, 16, 17])
def test_rates_are_as_quiet_as_they_have_to_be(bits: int, sigma_steps: float) -> None:
    """By Monte Carlo: what noise leaves in a rate behind the cut-off, unless that is at its least."""
    rng = np.random.default_rng(3)
    step = 2.0 * np.pi / 2**bits
    signals = read(step, sigma_steps * step, moved_and_rested(), rng)
    known = Noise.of([signals]).known_to(signals)
    assert known.smooth_hz is not None
    assert np.all(known.smooth_hz[:2] < TEAM_SMOOTH_HZ)
    np.testing.assert_array_equal(known.smooth_hz[2], TEAM_SMOOTH_HZ)
    free = known.smooth_hz[0] > QUIET_HZ
    white = np.hypot(sigma_steps, 1.0 / np.sqrt(12.0)) * step * rng.standard_normal((len(TIME), 3, 3))
    noise = Signals(TIME, white, white, white, RATE_HZ, smooth_hz=known.smooth_hz)
    for robot, joint in np.argwhere(free):
        rate = differentiate(noise.smooth("phi", robot, joint), RATE_HZ)
        assert np.std(rate) == pytest.approx(QUIET_RAD_PER_S, rel=0.25)
    assert free.all() == free.any() == (bits == 17)


def test_readings_that_only_round_are_smoothed_as_usual() -> None:
    step = 2.0 * np.pi / 2**16
    signals = read(step, 0.0, moved_and_rested(), np.random.default_rng(4))
    known = Noise.of([signals]).known_to(signals)
    np.testing.assert_array_equal(known.smooth_hz, TEAM_SMOOTH_HZ)
    np.testing.assert_array_equal(known.smooth("phi", 1, 2), signals.smooth("phi", 1, 2))


@pytest.mark.parametrize("name", ["joint_friction", "gimbal_friction"])
def test_friction_that_is_kept(name: str) -> None:
    """The sign of the rate where a joint moves, from its turn on; at rest that of the motion before; none until one."""
    case, rng = exact(), np.random.default_rng(5)
    time, cause = case.signals.time, CAUSES[name]
    since = np.clip(time - 4.0, 0.0, 5.0)
    swings = -0.1 * np.cos(2.0 * np.pi * 0.3 * since)  # three times from turn to turn
    angle = swings - 0.05 * np.clip(time - 12.0, 0.0, 3.0)
    noisy = angle[:, None, None] + 1e-5 * rng.standard_normal((len(time), 3, 3))
    signals = Signals(time, noisy, noisy, case.signals.tau, RATE_HZ)
    # The case's own noise, which is none, is what is taken off.
    (state, _) = cause._sliding(signals, case.linear, 1, 2, {KEPT: 4e-3})
    expected = np.select(
        [time < 4.0, time < 12.0], [0.0, np.sign(np.sin(0.6 * np.pi * np.minimum(since, 4.9)))], -1.0
    )
    moves = cause.sign * expected
    turns = 4.0 + np.array([0.0, 1.0 / 0.6, 2.0 / 0.6, 8.0])
    near = np.abs(time[:, None] - turns).min(axis=1) < 0.12
    np.testing.assert_array_equal(state[~near], moves[~near])
    for turn in turns[1:3]:  # it turns round within two samples
        here = np.abs(time - turn) < 0.12
        flips = time[here][np.flatnonzero(np.diff(state[here])) + 1]
        assert len(flips) == 1
        assert abs(flips[0] - turn) < 0.021


def test_friction_that_is_kept_never_moves_without_motion() -> None:
    case = exact()
    still = np.full_like(case.signals.phi, 0.3)
    signals = Signals(case.signals.time, still, still, case.signals.tau, RATE_HZ)
    state, _ = CAUSES["gimbal_friction"]._sliding(signals, case.linear, 0, 0, {KEPT: 4e-3})
    np.testing.assert_array_equal(state, 0.0)


def test_what_no_encoder_shows_of_a_turn_is_open() -> None:
    """Friction that gives way by 10 urad is reversed later than one that is kept: by Prandtl's law, step by step."""
    case, cause, shape = exact(), CAUSES["joint_friction"], {KEPT: 4e-3}
    bent, rate = cause._sliding(case.signals, case.linear, 1, 2, shape)
    late, state = np.empty_like(bent), bent[np.flatnonzero(bent)[0]]
    for k, step in enumerate(np.diff(case.signals.phi[:, 1, 2], prepend=case.signals.phi[0, 1, 2])):
        state = late[k] = min(max(state + cause.sign * step / 1e-5, -1.0), 1.0)
    missed = late - bent
    turns = np.flatnonzero(np.diff(bent[bent != 0.0]))
    assert len(turns) > 3
    assert np.abs(missed).max() > 0.5
    left = case.linear.reduction(cause.direction(case.linear, 1, 2) * missed[:, None]).ravel()
    open_ = dense(cause.unknowns(case.linear, 1, 2, shape)).reshape(len(left), -1)
    beside = left - open_ @ np.linalg.lstsq(open_, left, rcond=1e-9)[0]
    assert np.linalg.norm(beside) < 0.1 * np.linalg.norm(left)
    # Where it slides, it is known.
    assert np.mean(_doubtful(bent, rate)) < 0.2

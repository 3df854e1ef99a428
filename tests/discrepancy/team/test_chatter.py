"""Loops that chatter: products of what oscillates have means, and friction turns with it."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.team_case import Case, true_bases, true_shared

from discrepancy.team.causes import CAUSES
from discrepancy.team.linear.noise import Noise
from discrepancy.team.linear.rows import Reduction
from discrepancy.team.linear.signals import TEAM_PRE_HZ, TEAM_SMOOTH_HZ, Signals
from discrepancy.team.linear.start import exact_residual
from discrepancy.team.linear.trial_linear import linearise
from omnid_design import DESIGN
from recorded_team import Sines, carry
from team_case import every_sample

CHATTER_HZ = 27.0
TORQUE_STEP_NM = 0.01


def with_chatter(calm: Sines, amplitude: list[float]) -> Sines:
    """The same signals, and one sine more."""
    last = np.array([amplitude]), np.full((1, len(amplitude)), CHATTER_HZ), np.zeros((1, len(amplitude)))
    parts = zip((calm.amplitude, calm.frequency_hz, calm.phase), last, strict=True)
    return Sines(*(np.concatenate(pair) for pair in parts))


@pytest.fixture(scope="module")
def loud(case: Case) -> Signals:
    """The same carry, but the payload shakes by 0.15 mm, and robots and payload push each other by 15 N, at 27 Hz."""
    path = with_chatter(case.path, [0.0, 0.0, 0.0, 1.5e-4, 0.0, 1.5e-4])
    squeeze = with_chatter(case.squeeze, [15.0, 15.0, 15.0])
    return Signals.of(carry(path, squeeze, len(case.signals.time) / case.signals.rate_hz).recording)


def rows(signals: Signals, reduction: Reduction) -> np.ndarray:
    return exact_residual(signals, true_shared(), true_bases(), DESIGN, reduction)


def test_the_mean_of_a_product_that_chatters_is_in_the_rows(case: Case, loud: Signals) -> None:
    """Exact inverse dynamics: nothing is left of it, where 11 mN and 6 mN m were."""
    before = rows(loud, case.reduction)[:, 12:]
    known = Noise.of([loud]).known_to(loud)
    assert known.chatters
    assert not loud.chatters
    after = rows(known, case.reduction)[:, 12:]
    assert np.abs(before).max() > 0.01
    assert np.sqrt(np.mean(after**2)) < 0.02 * np.sqrt(np.mean(before**2))


def test_slopes_are_those_of_the_slow_motion(case: Case, loud: Signals) -> None:
    known = Noise.of([loud]).known_to(loud)
    expected = every_sample(case.linear.J)
    keep = case.signals.keep
    scale = np.abs(expected[:, keep]).max(axis=1, keepdims=True) + 1e-9

    def off(signals: Signals) -> float:
        linear = linearise(signals, true_shared(), true_bases(), DESIGN, case.reduction, full=True)
        return float(np.abs((every_sample(linear.J) - expected)[:, keep] / scale).max())

    assert off(known) < 0.02
    assert off(loud) > 2.0 * off(known)  # what the usual cut-off lets through


def test_what_does_not_chatter_is_filtered_as_usual(case: Case, loud: Signals) -> None:
    rng = np.random.default_rng(5)

    def read(signals: Signals) -> Signals:
        tau = signals.tau + TORQUE_STEP_NM * rng.standard_normal(signals.tau.shape)
        return replace(signals, tau=np.round(tau / TORQUE_STEP_NM) * TORQUE_STEP_NM)

    calm, shaken = read(case.signals), read(loud)
    healthy = Noise.of([calm, calm])
    assert not healthy.chatters
    assert healthy.known_to(calm).pre_hz == TEAM_PRE_HZ
    both = Noise.of([calm, shaken])
    assert both.chatters
    first, second = both.known_to(calm), both.known_to(shaken)
    np.testing.assert_array_equal(first.smooth_hz, healthy.known_to(calm).smooth_hz)
    assert (first.pre_hz, second.pre_hz) == (TEAM_PRE_HZ, pytest.approx(45.0))
    assert second.smooth_hz is not None
    np.testing.assert_array_equal(second.smooth_hz[1], TEAM_SMOOTH_HZ)  # gimbals hardly turn with it
    np.testing.assert_allclose(second.smooth_hz[2], 45.0)
    slight = replace(calm, tau=calm.tau + 0.01 * (loud.tau - case.signals.tau))
    assert not Noise.of([slight]).chatters


def test_where_samples_are_many_as_much_is_let_through_as_is_needed() -> None:
    rng, time = np.random.default_rng(6), np.arange(0.0, 20.0, 2e-3)
    x = 0.1 * np.sin(2.0 * np.pi * 0.3 * time)[:, None, None] + 1e-3 * rng.standard_normal((len(time), 3, 3))
    tau = x + np.sin(2.0 * np.pi * CHATTER_HZ * time)[:, None, None]
    signals = Signals(time, x, x, tau, 500.0)
    assert Noise.of([signals]).known_to(signals).pre_hz == pytest.approx(2.0 * CHATTER_HZ, rel=0.01)


@pytest.mark.parametrize("share", [0.0, 0.3, -0.8])
def test_friction_turns_with_what_chatters(case: Case, share: float) -> None:
    """Of a sign of v + V sin the mean is 2/pi asin(v/V): hardly any friction is left, and as if it were viscous.

    Of 27 Hz at 100 Hz a difference of sixth order tells 0.90.
    """
    time, V = case.signals.time, 20.0  # [N m/s]
    w = 2.0 * np.pi * CHATTER_HZ / case.signals.rate_hz
    told = 2.0 / w * (0.75 * np.sin(w) - 0.15 * np.sin(2.0 * w) + np.sin(3.0 * w) / 60.0)
    slow = share * V * time
    tau = slow - V / (2.0 * np.pi * CHATTER_HZ) * np.cos(2.0 * np.pi * CHATTER_HZ * time)
    signals = replace(case.signals, tau=np.broadcast_to(tau[:, None, None], (len(time), 3, 3)).copy())
    noise, keep = Noise.of([signals]), signals.keep
    hysteresis, shape = CAUSES["sea_hysteresis"], {"slow_Nm_per_s": 0.2}
    mean = [
        float(np.mean(hysteresis._sliding(one, case.linear, 1, 2, shape)[0][keep]))
        for one in (noise.known_to(signals), signals)
    ]
    assert told == pytest.approx(0.90, abs=0.01)
    assert mean[0] == pytest.approx(-2.0 / np.pi * np.arcsin(share / told), abs=0.02)
    if share:
        assert mean[1] == pytest.approx(-np.sign(share), abs=0.1)  # with the usual cut-off it slides one way

"""Friction of healthy joints at rest is noise: of the tolerance's size, another at every rest, none in motion."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import fftconvolve
from scipy.stats import chi2

from discrepancy.team.linear.rest import Resting
from discrepancy.team.linear.rows import Reduction, Whitening
from team_case import exact

LIMIT_NM = 0.05
JOINT = {"joint_friction": {"coulomb_Nm": LIMIT_NM}}
HOLDS_S, STOPPING_S = ((3.0, 5.5), (7.0, 9.5), (11.0, 13.5)), 0.2


def still(time, holds):
    return np.any([(time >= start) & (time < stop) for start, stop in holds], axis=0)


def trial_with(holds, joints, speed=0.05):
    """The exact trial's derivatives; every joint moves at one speed [rad/s] and 3 N m/s, but some rest in holds."""
    case = exact()
    s = case.signals
    moving = np.ones((*s.phi.shape,))
    moving[np.ix_(still(s.time, holds), *joints)] = 0.0
    slow_down = np.hanning(round(2 * STOPPING_S * s.rate_hz) + 1)[:, None, None]
    moving = fftconvolve(moving, slow_down / slow_down.sum(), mode="same", axes=0)
    travel = np.cumsum(moving, axis=0) / s.rate_hz
    # Only rests are taken from these; what an error does is in the exact trial's derivatives.
    signals = replace(s, phi=speed * travel, theta=speed * travel, tau=3.0 * travel)
    return replace(case.linear, signals=signals)


@pytest.fixture(scope="module")
def one_rest():
    """Joint 2 of robot 2 rests twice, nothing else does."""
    return trial_with(HOLDS_S[:2], ([1], [1]))


def by_rest(trial):
    """What 1 N m at each of the two rests does to the rows, shape (n C, 2)."""
    out = []
    for hold in HOLDS_S[:2]:
        tau = np.zeros((len(trial.signals.time), 3))
        tau[still(trial.signals.time, [(hold[0] + STOPPING_S, hold[1] - STOPPING_S)]), 1] = 1.0
        out.append(trial.of_signals(1, tau=tau).ravel())
    return np.array(out).T


@pytest.mark.parametrize(
    ("tolerances", "moves"),
    [
        (JOINT, "phi"),
        ({"sea_hysteresis": {"friction_Nm": LIMIT_NM}}, "tau"),
    ],
)
def test_draws_are_torques_at_rest_of_the_tolerances_size(one_rest, tolerances, moves):
    others = {name: np.linspace(0.0, 3.0, len(one_rest.signals.time))[:, None, None] * np.ones((1, 3, 3))
              for name in ("phi", "theta", "tau") if name != moves}  # fmt: skip
    trial = replace(one_rest, signals=replace(one_rest.signals, **others))
    draw, rng = Resting(trial, tolerances), np.random.default_rng(2)
    columns = by_rest(trial)
    values = []
    for _ in range(40):
        rows = draw(rng).ravel()
        value = np.linalg.lstsq(columns, rows, rcond=None)[0]
        left = rows - columns @ value
        assert np.linalg.norm(left) < 0.3 * np.linalg.norm(
            rows
        )  # the filter moves the ends of a rest by a sample
        values.append(value)
    squares = np.sum(np.array(values) ** 2, axis=0) / LIMIT_NM**2
    assert np.all(chi2.cdf(squares, 40) > 1e-3)
    assert np.all(chi2.sf(squares, 40) > 1e-3)
    assert abs(np.corrcoef(np.array(values).T)[0, 1]) < 0.5  # another torque at each rest


def test_friction_in_a_gimbal_is_a_moment_alone(one_rest):
    """It shows in the balance of moments, and neither in forces nor in poses."""
    rows = Resting(one_rest, {"gimbal_friction": {"coulomb_Nm": LIMIT_NM}})(np.random.default_rng(1))[0]
    assert not rows[:, :15].any()
    assert 0.05 * LIMIT_NM < np.abs(rows[:, 15:]).max() < 10.0 * LIMIT_NM


def test_healthy_holds_leave_noise_alone():
    """Torques at rest drawn here, through the trial's derivatives: chi-square per number of the holds is one."""
    trial = trial_with(HOLDS_S, (range(3), range(3)), speed=0.01)
    reduction = Reduction.of(trial.signals)
    trial = replace(trial, reduction=reduction)
    assert len(reduction.time) - reduction.moving == 3
    rng, samples = np.random.default_rng(4), len(trial.signals.time)

    def sensors():
        rows = np.zeros((len(reduction.time), 18))
        for i in range(3):
            errors = 1e-4 * rng.standard_normal((2, samples, 3))
            rows += trial.of_signals(i, errors[0], errors[1], 0.01 * rng.standard_normal((samples, 3)))
        return rows

    def friction():
        rows = np.zeros((len(reduction.time), 18))
        for i in range(3):
            tau = np.zeros((samples, 3))
            for hold in HOLDS_S:
                tau[still(trial.signals.time, [hold])] = LIMIT_NM * rng.standard_normal(3)
            rows += trial.of_signals(i, tau=tau)
        return rows

    resting = Resting(trial, JOINT)
    noise = np.array([sensors() for _ in range(40)])
    with_friction = noise + np.array([resting(rng)[0] for _ in noise])
    data = [sensors() + friction() for _ in range(8)]

    def left(draws):
        white = Whitening.of(draws, reduction.moving, uneven=True)
        return np.mean([white(x)[reduction.moving :] ** 2 for x in data])

    assert left(with_friction) == pytest.approx(1.0, abs=0.3)
    assert left(noise) > 10.0

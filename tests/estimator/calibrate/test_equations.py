"""Rows, their noise, and the derivatives of loops, balance and unloaded arms."""

from dataclasses import replace

import numpy as np
import pytest

from calibration_case import PRIOR, differences, exact_trial, instants
from estimator.arm.delta import forward_kinematics, inverse_kinematics, leg_geometry, length_jacobians
from estimator.arm.dynamics import arm_torque
from estimator.arm.unit import AT, COUNT, ArmUnit
from estimator.calibrate import rules
from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.equations import AloneEquations, TrialEquations, pose_derivatives
from estimator.calibrate.prior import Prior
from estimator.calibrate.rows import Rows, Sensing
from estimator.recording.model import Recording
from omnid_design import DESIGN
from recorded_team import STEP_S, Sines, derivatives
from recordings import metadata
from synthetic_team import carry, draw_path, draw_units, load, with_noise


def recording_of(phi, rate_hz=100.0) -> Recording:
    """Two robots whose every channel is the same signal, shape (Q,)."""
    x = np.repeat(np.asarray(phi)[:, None, None], 2, axis=1)
    x = np.repeat(x, 3, axis=2)
    return Recording(np.arange(len(x)) / rate_hz, x, x.copy(), x.copy(), None, metadata(2, rate_hz=rate_hz))


@pytest.mark.parametrize("rate_hz", [50.0, 100.0, 240.0])
def test_a_slow_signal_passes_with_its_derivatives(rate_hz):
    """To a percent, residual and derivatives alike."""
    time = np.arange(round(20 * rate_hz)) / rate_hz
    w = 2 * np.pi * 0.3
    recording = recording_of(0.2 * np.sin(w * time) + 0.4, rate_hz)
    recording.theta[:, 1] = 0.2 * np.cos(w * time)[:, None]  # something always moves
    rows = Rows.of(recording)
    out = rows(rows.s)[:, 0]
    assert len(rows.time) > 50
    assert out[:, 0] == pytest.approx(0.2 * np.sin(w * rows.time) + 0.4, abs=0.002)
    assert out[:, 3] == pytest.approx(0.2 * w * np.cos(w * rows.time), abs=0.002 * w)
    assert out[:, 6] == pytest.approx(-0.2 * w**2 * np.sin(w * rows.time), abs=0.002 * w**2)


def test_noise_in_rows_is_as_the_gain_says_and_independent():
    rng = np.random.default_rng(1)
    time = np.arange(90_000) / 100.0
    quiet = recording_of(0.3 * np.sin(2 * np.pi * 0.2 * time))
    noisy = with_noise(quiet, 1.0, 1.0, rng)
    rows = Rows.of(quiet)
    noise = rows(Rows.of(noisy).s[: len(rows.s)] - rows.s)
    angle, speed, acceleration = (
        noise[..., first : first + 3].reshape(len(noise), -1) for first in (0, 3, 6)
    )
    chains = np.stack([angle, speed, acceleration])
    found = np.einsum("aqc,bqc->ab", chains, chains) / angle.size
    scale = np.sqrt(np.diag(rows.gain))
    n = angle.size
    assert found / np.outer(scale, scale) == pytest.approx(
        rows.gain / np.outer(scale, scale), abs=4 * np.sqrt(2 / n)
    )
    # What varies slowly is averaged over many rows: sums of their correlations count, not one alone.
    correlation = [np.sum(angle[k:] * angle[:-k]) / np.sum(angle**2) for k in range(1, 7)]
    assert np.abs(correlation).max() < 0.03
    assert 1.0 + 2.0 * np.sum(correlation) == pytest.approx(1.0, abs=0.06)


def test_holds_are_one_row_each():
    """Three holds of 4 s: a mean over all of each but its ends."""
    level, time = [], np.arange(0, 21, 0.01)
    for t in time:
        s = np.clip((t % 7.0 - 5.0) / 2.0, 0.0, 1.0)
        level.append(t // 7.0 + s**3 * (10 - 15 * s + 6 * s**2))
    rows = Rows.of(recording_of(0.1 * np.array(level)))
    held = rows(rows.s)[rows.moving :, 0, 0]
    # The first begins before the trimmed two seconds are over, and no hold is complete at the end.
    assert held == pytest.approx([0.0, 0.1, 0.2], abs=1e-6)
    settled = 5.0 - 2 * rules.SETTLING_S
    assert rows.length[rows.moving + 1] / 100.0 == pytest.approx(settled, abs=0.6)
    assert (rows.length[: rows.moving] == 0).all()
    assert rows.moving > 5


def test_a_hold_of_encoders_without_noise_has_one_rounding_error():
    sensing = Sensing(np.full((2, 9), 1e-4), np.zeros((2, 9)))
    time = np.arange(0, 20, 0.01)
    rows = Rows.of(recording_of(np.where(time < 10, 0.1, 0.1 + 0.02 * (time - 10))))
    moving, held = sensing.variances(rows)
    floor = rules.PHI_FLOOR_RAD**2
    resting = rules.AT_REST**2 * floor
    hold = rows.moving  # the first hold
    assert held[hold, 0, 0] == pytest.approx(1e-8 / 12 + resting, rel=1e-9)
    # In motion a joint at 0.02 rad/s makes 200 steps a second: every sample's error is its own.
    assert moving[rows.moving // 2, 0, 0] == pytest.approx(1e-8 / 12 + floor, rel=1e-9)
    dithered = Sensing(np.full((2, 9), 1e-4), np.full((2, 9), 1e-4)).variances(rows)[1]
    length = rows.length[hold]
    assert dithered[hold, 0, 0] == pytest.approx((1e-8 + 1e-8 / 12) / length + resting, rel=1e-9)


def test_sensing_finds_steps_and_noise():
    exact = exact_trial(3)[2]
    rng = np.random.default_rng(4)
    noisy = with_noise(exact.recording, 2e-5, 0.004, rng)
    found = Sensing.of([noisy])
    assert not found.step.any()
    assert found.sigma == pytest.approx(np.tile(np.repeat([2e-5, 2e-5, 0.004], 3), (3, 1)), rel=0.15)


def test_ripple_of_slow_rounding_is_no_noise():
    """A joint of 50 steps a second: its rounding errors are as fast as noise, but no reading goes back."""
    time, step = np.arange(0, 40, 0.01), 1e-4
    slow = 1.3e-3 * np.sin(2 * np.pi * 0.67 * time)

    def found(noise):
        read = slow + noise * step * np.random.default_rng(5).standard_normal(len(time))
        return Sensing.of([recording_of(np.round(read / step) * step)])

    assert found(0.0).step[0, 0] == pytest.approx(step)
    assert found(0.0).sigma[0, 0] < 0.05 * step  # 0.44 of one by its frequencies alone
    assert found(0.5).sigma[0, 0] == pytest.approx(0.5 * step, rel=0.2)


def test_each_joint_has_its_own_rounding_errors_again():
    """Where a cycle is no whole number of samples, a slow joint's readings come again, and a fast one's do not."""
    time, step = np.arange(0, 44, 0.01), 1e-4
    angle = 2 * np.pi * 0.6037 * time
    trial = recording_of(np.round(0.1 * np.sin(angle) / step) * step)
    trial.theta[:] = (np.round(1.2e-3 * np.sin(angle) / step) * step)[:, None, None]
    trial.phi[:, 1] = 0.1 * np.cos(angle)[:, None]  # something always moves
    repeats = Rows.of(trial).repeats
    assert repeats.shape == (2, 9)
    assert np.all(repeats[:, 3:6] > 0.7 * 40 * 0.6037)
    assert np.all(repeats[0, [0, 1, 2, 6, 7, 8]] < 4.0)


@pytest.mark.slow
def test_residual_of_the_truth_has_the_covariance_of_its_rows():
    """Monte Carlo of whole trials: chi2 per number, and NEES of what is constant over a trial."""
    rng = np.random.default_rng(5)
    units, held = draw_units(3, Prior(), rng), load(3, rng)
    exact = carry(units, held, draw_path(held, rng), rng, 12.0)
    chi2, sums = [], []
    for _ in range(60):
        noisy = with_noise(exact.recording, 5e-5, 0.02, rng)
        equations = TrialEquations.of(Rows.of(noisy), Sensing(np.zeros((3, 9)), SIGMA))
        if not chi2:
            claimed = equations.at(units, held.shared, exact.bases).covariance
        residual = equations.residual(units, held.shared, exact.bases)
        chi2.append(np.einsum("qc,qcd,qd->q", residual, np.linalg.inv(claimed), residual).mean() / 18)
        total = residual.sum(axis=0)
        sums.append(total @ np.linalg.solve(claimed.sum(axis=0), total) / 18)
    assert np.mean(chi2) == pytest.approx(1.0, abs=0.05)
    # Accelerations' noise does not sum up: the balance is known better than claimed, never worse.
    assert 0.6 < np.mean(sums) < 1.1


SIGMA = np.tile(np.repeat([5e-5, 5e-5, 0.02], 3), (3, 1))


FREE = np.flatnonzero(PRIOR.factor(1, hold_scale=False).any(axis=1))
BALANCE = slice(-6, None)


def test_nothing_is_left_of_exact_signals():
    units, held, exact = exact_trial(1)
    equations = instants(exact, units)
    residual = equations.residual(units, held.shared, exact.bases)
    assert np.abs(residual[:, :12]).max() < 1e-12
    assert np.abs(residual[:, BALANCE]).max() < 1e-8
    designed = equations.residual(ArmUnit(DESIGN, 0.0 * units.x), held.shared, exact.bases)
    assert np.abs(designed[:, :12]).max() > 0.01
    assert np.abs(designed[:, BALANCE]).max() > 0.5


def test_derivatives_of_the_balance():
    units, held, exact = exact_trial(2)
    equations = instants(exact, units)
    shared = held.shared
    rowed = equations.at(units, shared, exact.bases)

    def by(units=units, shared=shared):
        return equations.residual(units, shared, exact.bases)[:, BALANCE]

    expected = differences(lambda dx: by(units=units.moved(dx.reshape(3, COUNT))), 3 * COUNT, 1e-6)
    expected = expected.reshape(len(expected), 6, 3, COUNT)[..., FREE]
    found = rowed.by_units[:, BALANCE][..., FREE]
    # One-sided steps of a millionth, and the fused motion of the others.
    assert found == pytest.approx(expected, abs=2e-4 * np.abs(expected).max())
    assert (np.abs(expected).max(axis=(0, 1, 2)) > 0.05).all()

    expected = differences(lambda dx: by(shared=shared.moved(dx)), 22, 1e-6)
    assert rowed.by_carried[:, BALANCE] == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())
    assert not rowed.by_bases[:, BALANCE].any()


def test_derivatives_of_averaged_rows_are_taken_at_the_mean():
    """Signals of a row vary: what that leaves is below three percent of the largest."""
    units, held, exact = exact_trial(3)
    rows = Rows.of(exact.recording).take(np.array([5, 15]))
    equations = TrialEquations.of(rows, Sensing.of([exact.recording]))
    found = equations.at(units, held.shared, exact.bases).by_units[:, BALANCE][..., FREE]

    def by(dx):
        return equations.residual(units.moved(dx.reshape(3, COUNT)), held.shared, exact.bases)[:, BALANCE]

    expected = differences(by, 3 * COUNT, 1e-6).reshape(-1, 6, 3, COUNT)[..., FREE]
    for k in range(len(FREE)):
        assert np.abs(found[..., k] - expected[..., k]).max() < 0.03 * np.abs(expected[..., k]).max()


def test_derivatives_by_the_payload_are_averaged_over_a_row():
    units, held, exact = exact_trial(3)
    rows = Rows.of(exact.recording).take(np.array([5, 15]))
    equations = TrialEquations.of(rows, Sensing.of([exact.recording]))
    here = units, held.shared, exact.bases
    found = equations.at(*here, curvature=equations.curvature(*here)).by_carried[:, BALANCE]
    expected = differences(
        lambda dx: equations.residual(units, held.shared.moved(dx), exact.bases)[:, BALANCE], 22, 1e-6
    )
    assert found == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


def with_signals(equations: TrialEquations, change) -> TrialEquations:
    rows = replace(equations.rows, s=equations.rows.s + change)
    return replace(equations, rows=rows, mean=rows.s)


def test_covariance_is_that_of_drawn_noise():
    """Every joint's angle, rate and acceleration have the covariance of a row, channels are independent."""
    units, held, exact = exact_trial(4)
    equations = instants(exact, units, count=3)
    claimed = equations.at(units, held.shared, exact.bases).covariance
    rng, draws = np.random.default_rng(5), 1000
    moving, _ = equations.variances
    gain = np.linalg.cholesky(equations.rows.gain)
    out = []
    for _ in range(draws):
        noise = np.zeros_like(equations.rows.s)
        for first, columns in ((0, slice(0, 3)), (9, slice(3, 6))):
            white = rng.standard_normal((*noise.shape[:2], 3, 3)) @ gain.T
            white = white * np.sqrt(moving[..., columns, None])
            noise[..., first : first + 9] = np.swapaxes(white, -1, -2).reshape(*noise.shape[:2], 9)
        noise[..., 18:] = np.sqrt(moving[..., 6:] * equations.rows.gain[0, 0]) * rng.standard_normal(
            (*noise.shape[:2], 3)
        )
        out.append(with_signals(equations, noise).residual(units, held.shared, exact.bases))
    out = np.array(out)
    for q in range(3):
        scale = np.sqrt(np.diag(claimed[q]))
        found = np.cov(out[:, q].T) / np.outer(scale, scale)
        assert found == pytest.approx(claimed[q] / np.outer(scale, scale), abs=5.0 * np.sqrt(2.0 / draws))


def test_adjustment_is_the_least_that_closes_loops_and_balance():
    units, held, exact = exact_trial(6)
    equations = instants(exact, units)
    rng = np.random.default_rng(7)
    noise = 1e-5 * rng.standard_normal(equations.rows.s.shape)
    spoilt = with_signals(equations, noise)
    rowed = spoilt.at(units, held.shared, exact.bases)
    readings = rowed.adjustment.copy()
    readings[..., 18:] /= 1.0 + units.of("stiffness_ratio")
    mended = with_signals(spoilt, readings)
    left = mended.residual(units, held.shared, exact.bases)
    assert np.abs(left).max() < 1e-3 * np.abs(rowed.residual).max()
    # The least: noise along the model, which no residual shows, is not touched; so adjusting twice changes nothing.
    again = mended.at(units, held.shared, exact.bases).adjustment
    assert np.abs(again).max() < 1e-3 * np.abs(rowed.adjustment).max()
    chi2 = np.einsum("qc,qcd,qd->", rowed.residual, np.linalg.inv(rowed.covariance), rowed.residual)
    moving, _ = equations.variances
    inverse = np.linalg.inv(equations.rows.gain)
    spent = 0.0
    for first, columns in ((0, slice(0, 3)), (9, slice(3, 6))):
        part = rowed.adjustment[..., first : first + 9].reshape(*moving.shape[:2], 3, 3)
        spent += np.sum(np.einsum("qnaj,ab,qnbj->qnj", part, inverse, part) / moving[..., columns])
    spent += np.sum(rowed.adjustment[..., 18:] ** 2 / (moving[..., 6:] * equations.rows.gain[0, 0]))
    assert spent == pytest.approx(chi2, rel=1e-6)


@pytest.mark.parametrize("shift", [0.0, 1e-9])
def test_gimbals_near_zero(shift):
    """At zero, and a hair from it, poses and derivatives are smooth."""
    units, held, exact = exact_trial(8)
    equations = instants(exact, units)
    s = equations.rows.s.copy()
    s[..., 9:18] = shift
    rowed = with_signals(equations, s - equations.rows.s).at(
        ArmUnit(DESIGN, 0.0 * units.x), held.shared, exact.bases
    )
    for part in rowed:
        assert part is None or np.isfinite(part).all()
    assert (np.linalg.eigvalsh(rowed.covariance) > 0).all()


@pytest.mark.parametrize("name", ["radius", "proximal_length", "rod_length"])
def test_length_jacobians(name):
    rng = np.random.default_rng(1)
    unit = draw_units(1, PRIOR, rng)
    unit = ArmUnit(DESIGN, unit.x[0])
    home = np.array([0.0, 0.0, DESIGN.home_height_m])
    phi = inverse_kinematics(home + rng.uniform(-0.08, 0.08, (6, 3)), unit)

    def at(dx):
        x = unit.x.copy()
        x[AT[name]] += dx
        return forward_kinematics(phi, ArmUnit(DESIGN, x))

    which = ["radius", "proximal_length", "rod_length"].index(name)
    found = length_jacobians(leg_geometry(phi, unit), phi, unit)[which]
    assert found == pytest.approx(differences(at, 3, 1e-6), abs=1e-8)


def few_rows(units, exact, count) -> TrialEquations:
    rows = Rows.of(exact.recording)
    chosen = np.linspace(0, len(rows.time) - 1, count).astype(int)
    return TrialEquations.of(rows.take(chosen), Sensing.of([exact.recording]))


def compared(equations, units, shared, bases, within):
    by_units, by_carried, by_bases = pose_derivatives(equations.rows, units, shared, bases)

    def at(units=units, shared=shared, bases=bases):
        return equations.residual(units, shared, bases)[:, :12]

    expected = differences(lambda dx: at(units=units.moved(dx.reshape(3, COUNT))), 3 * COUNT, 1e-6)
    expected = expected.reshape(*by_units.shape[:2], 3, COUNT)
    assert by_units[..., FREE] == pytest.approx(expected[..., FREE], abs=within)
    assert by_carried == pytest.approx(
        differences(lambda dx: at(shared=shared.moved(dx)), 22, 1e-6), abs=within
    )
    assert by_bases == pytest.approx(differences(lambda dx: at(bases=bases.moved(dx)), 8, 1e-6), abs=within)
    assert np.abs(expected[..., AT["rod_length"]]).max() > 0.3


def test_derivatives_are_those_of_the_averaged_residual():
    units, held, exact = exact_trial(4, prior=Prior())
    compared(few_rows(units, exact, 5), units, held.shared, exact.bases, within=2e-7)


def test_derivatives_where_a_calibration_starts():
    """The logarithm of a rotation error of 0.03 rad, and tilts about fixed axes, are right to first order."""
    units, held, exact = exact_trial(2, prior=Prior(tilt_rad=0.003))
    rng = np.random.default_rng(3)
    shared, bases = (
        held.shared.moved(1e-3 * rng.standard_normal(22)),
        exact.bases.moved(1e-3 * rng.standard_normal(8)),
    )
    equations = few_rows(units, exact, 3)
    compared(equations, ArmUnit(DESIGN, 0.5 * units.x), shared, bases, within=0.03)


FREE_MASSES = Prior(arm_mass_ratio=0.05)


def free_trial(units: ArmUnit, rng, duration_s=20.0) -> Recording:
    """Joints that follow sines of their own, nothing in the hands; the dynamics are those that MuJoCo has confirmed."""
    N = len(units.x)
    time = np.arange(round(duration_s * 100)) / 100.0
    path = Sines.draw(rng, [0.12] * 3 * N, 3, 0.1, 0.9)
    x = 0.55 + path(time[:, None] + STEP_S * np.arange(-4, 5))
    phi, phi_dot, phi_ddot = (part.reshape(-1, N, 3) for part in derivatives(x))
    tau = arm_torque(phi, phi_dot, phi_ddot, units)
    theta = np.broadcast_to(rng.uniform(-0.2, 0.2, (N, 3)), phi.shape)
    return Recording(
        time, phi + units.of("phi_zero"), theta + units.of("theta_zero"),
        tau / (1.0 + units.of("stiffness_ratio")) + units.of("tau_zero"), None,
        metadata(N, trial="free"), "free",
    )  # fmt: skip


def test_nothing_is_left_of_exact_torques_and_derivatives_are_right():
    rng = np.random.default_rng(1)
    units = draw_units(2, replace(FREE_MASSES, tilt_rad=0.01), rng)
    recording = free_trial(units, rng, 9.0)
    rows = Rows.of(recording)
    equations = AloneEquations.of(rows.take(np.array([3, 8, 13])), Sensing.of([recording]))
    residual, J, covariance = equations.at(units)
    assert np.abs(residual).max() < 1e-6
    assert np.abs(equations.residual(ArmUnit(DESIGN, 0.0 * units.x))).max() > 0.05
    expected = differences(lambda dx: equations.residual(units.moved(dx.reshape(2, COUNT))), 2 * COUNT, 1e-6)
    expected = expected.reshape(3, 2, 3, 2, COUNT)
    for i in range(2):
        # Taken at a row's mean signals.
        assert J[:, i] == pytest.approx(expected[:, i, :, i], abs=0.02 * np.abs(expected).max())
        assert not expected[:, i, :, 1 - i].any()
    assert (np.linalg.eigvalsh(covariance) > 0).all()


def test_unloaded_arms_give_their_masses():
    """Exact data, masses off by 5 %: with the free trial they are found, without it their common weight is not."""
    rng = np.random.default_rng(2)
    units, held = draw_units(3, FREE_MASSES, rng), load(3, rng)
    carried = [carry(units, held, draw_path(held, rng), rng, 12.0).recording for _ in range(2)]
    free = free_trial(units, rng, 14.0)
    found = calibrate(carried, free=[free], prior=FREE_MASSES)
    masses = np.r_[AT["proximal_mass_ratio"], AT["rod_mass_ratio"], AT["wrist_mass_ratio"]]
    assert np.abs(units.x[:, masses]).max() > 0.08
    assert found.units.x[:, masses] == pytest.approx(units.x[:, masses], abs=5e-3)
    assert found.payloads[0].parameters[0] == pytest.approx(held.mass, rel=2e-4)
    assert found.trials[-1].kind == "free"
    assert found.trials[-1].after[1] < 0.01
    # What the wrist weighs, a payload may weigh instead.
    wrist = AT["wrist_mass_ratio"]
    without = calibrate(carried, prior=FREE_MASSES)
    assert without.sd[:, wrist].min() > 4.0 * found.sd[:, wrist].max()

"""Derivatives, covariance and adjustment of one trial's rows against differences and drawn noise."""

from dataclasses import replace

import numpy as np
import pytest

from calibration_case import PRIOR, differences, exact_trial, instants
from estimator.arm.unit import COUNT, ArmUnit
from estimator.calibrate.equations import TrialEquations
from estimator.calibrate.rows import Rows, Sensing
from omnid_design import DESIGN

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
        assert np.isfinite(part).all()
    assert (np.linalg.eigvalsh(rowed.covariance) > 0).all()

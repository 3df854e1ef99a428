"""What a step of least squares says of a trial that is left out, against a calibration without it."""

import numpy as np
import pytest

from estimator.arm.unit import COUNT, ArmUnit
from estimator.calibrate.calibration import Prior
from estimator.calibrate.equations import TrialEquations
from estimator.calibrate.findings import held_out
from estimator.calibrate.least_squares import CarriedTrial, Given, Unknowns, fit
from estimator.calibrate.rows import Rows, Sensing
from omnid_design import DESIGN
from synthetic_team import carry, draw_path, draw_units, load, with_noise

HELD = Prior(*[0.0] * 7)


def test_held_out_is_what_a_calibration_without_the_trial_says():
    rng = np.random.default_rng(8)
    units, held = draw_units(3, Prior(), rng), load(3, rng)
    exact = [carry(units, held, draw_path(held, rng), rng, 10.0) for _ in range(3)]
    recordings = [with_noise(one.recording, 2e-5, 0.01, rng) for one in exact]
    sensing = Sensing.of(recordings)
    trials = [CarriedTrial(Rows.of(one), 0, sensing) for one in recordings]
    designed = ArmUnit(DESIGN, np.zeros((3, COUNT)))
    bases = tuple(one.bases for one in exact)
    given = Given(trials, Unknowns(designed, (held.shared,), bases), Prior())
    whole = fit(given)
    predicted = held_out(whole)

    for k in range(3):
        rest = fit(given.only([i for i in range(3) if i != k]))
        # Robots and payload are held, the bases alone are moved to where this trial fits best.
        at = rest.point.unknowns
        one = TrialEquations.of(trials[k].rows, sensing)
        shared, base = at.carried[0], whole.point.unknowns.bases[k]
        for _ in range(3):
            rowed = one.at(at.units, shared, base)
            weight = np.linalg.inv(rowed.covariance)
            H = np.einsum("qca,qcd,qdb->ab", rowed.by_bases, weight, rowed.by_bases)
            g = np.einsum("qca,qcd,qd->a", rowed.by_bases, weight, rowed.residual)
            base = base.moved(-np.linalg.solve(H, g))
        # Adjusted signals change the last digits of the weights only.
        residual, covariance = one.residual(at.units, shared, base), one.at(at.units, shared, base).covariance
        for found, rows in zip(predicted[k] or (), (slice(0, 12), slice(12, 18)), strict=True):
            part = residual[:, rows]
            chi2 = np.einsum("qc,qcd,qd->", part, np.linalg.inv(covariance[:, rows, rows]), part) / part.size
            assert found == pytest.approx(chi2, rel=0.03)
            assert found > 0.8


def test_the_only_trial_of_a_payload_cannot_be_held_out():
    rng = np.random.default_rng(9)
    units, held = draw_units(3, Prior(), rng), load(3, rng)
    exact = carry(units, held, draw_path(held, rng), rng, 10.0)
    trial = CarriedTrial(Rows.of(exact.recording), 0, Sensing.of([exact.recording]))
    found = fit(Given([trial], Unknowns(units, (held.shared,), (exact.bases,)), Prior()))
    assert held_out(found) == [None]

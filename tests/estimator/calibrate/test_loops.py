"""Derivatives of the loops in closed form against differences of the residual itself."""

import numpy as np
import pytest

from calibration_case import PRIOR, differences, exact_trial
from estimator.arm.delta import forward_kinematics, inverse_kinematics, leg_geometry, length_jacobians
from estimator.arm.unit import AT, COUNT, ArmUnit
from estimator.calibrate.equations import TrialEquations
from estimator.calibrate.loops import pose_derivatives
from estimator.calibrate.prior import Prior
from estimator.calibrate.rows import Rows
from estimator.calibrate.sensing import Sensing
from omnid_design import DESIGN
from synthetic_team import draw_units

FREE = np.flatnonzero(PRIOR.factor(1, hold_scale=False).any(axis=1))


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


@pytest.mark.parametrize("tilt_rad", [0.0, 0.003])
def test_derivatives_are_those_of_the_averaged_residual(tilt_rad):
    """Away from the solution, where a calibration starts; tilts are turned about fixed axes, right to first order."""
    prior = Prior(tilt_rad=tilt_rad)
    units, held, exact = exact_trial(2, prior=prior)
    rows = Rows.of(exact.recording)
    equations = TrialEquations.of(rows, Sensing.of([exact.recording]))
    rng = np.random.default_rng(3)
    shared = held.shared.moved(1e-3 * rng.standard_normal(22))
    bases = exact.bases.moved(1e-3 * rng.standard_normal(8))
    units = ArmUnit(DESIGN, 0.5 * units.x)
    by_units, by_carried, by_bases = pose_derivatives(rows, units, shared, bases)
    loops = slice(0, 12)

    def of_units(dx):
        return equations.residual(units.moved(dx.reshape(3, COUNT)), shared, bases)[:, loops]

    expected = differences(of_units, 3 * COUNT, 1e-6).reshape(*by_units.shape[:2], 3, COUNT)
    tilts = np.r_[AT["tilt"]]
    rest = np.setdiff1d(FREE, tilts)
    # The rotation error is small, not zero: its logarithm's derivative is the identity to first order in it.
    assert by_units[..., rest] == pytest.approx(expected[..., rest], abs=3e-3 * np.abs(expected).max())
    assert np.abs(by_units[..., rest] - expected[..., rest]).max() < 0.02
    assert by_units[..., tilts] == pytest.approx(expected[..., tilts], abs=0.02)

    expected = differences(lambda dx: equations.residual(units, shared.moved(dx), bases)[:, loops], 22, 1e-6)
    assert by_carried == pytest.approx(expected, abs=0.02)
    expected = differences(lambda dx: equations.residual(units, shared, bases.moved(dx))[:, loops], 8, 1e-6)
    assert by_bases == pytest.approx(expected, abs=0.02)


def test_derivatives_at_the_solution_are_exact():
    units, held, exact = exact_trial(4, prior=Prior())
    rows = Rows.of(exact.recording)
    equations = TrialEquations.of(rows, Sensing.of([exact.recording]))
    by_units, by_carried, by_bases = pose_derivatives(rows, units, held.shared, exact.bases)

    def at(units=units, shared=held.shared, bases=exact.bases):
        return equations.residual(units, shared, bases)[:, :12]

    expected = differences(lambda dx: at(units=units.moved(dx.reshape(3, COUNT))), 3 * COUNT, 1e-6)
    expected = expected.reshape(*by_units.shape[:2], 3, COUNT)
    assert by_units[..., FREE] == pytest.approx(expected[..., FREE], abs=2e-7)
    assert by_carried == pytest.approx(differences(lambda dx: at(shared=held.shared.moved(dx)), 22, 1e-6), abs=2e-7)
    assert by_bases == pytest.approx(differences(lambda dx: at(bases=exact.bases.moved(dx)), 8, 1e-6), abs=2e-7)
    assert np.abs(expected[..., AT["rod_length"]]).max() > 0.3

"""Derivatives of the loops in closed form against differences of the residual itself."""

import numpy as np
import pytest

from calibration_case import PRIOR, differences, exact_trial
from estimator.arm.delta import forward_kinematics, inverse_kinematics, leg_geometry, length_jacobians
from estimator.arm.unit import AT, COUNT, ArmUnit
from estimator.calibrate.calibration import Prior
from estimator.calibrate.equations import TrialEquations, pose_derivatives
from estimator.calibrate.rows import Rows, Sensing
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

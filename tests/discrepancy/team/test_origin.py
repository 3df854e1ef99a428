"""Robots as a calibration found them: signs and places of their deviations in the catalogue's causes."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.team.candidates import every_candidate, origin_of, places_of
from discrepancy.team.causes import CAUSES, default_tolerances
from discrepancy.team.linear.start import Sensed, SignalNoise, exact_residual
from discrepancy.team.linear.trial_linear import linearise
from discrepancy.team.rig import TeamRig
from estimator.arm.unit import COUNT, GROUPS, ArmUnit, true_joints
from team_case import DESIGN, exact
from uncalibrated_team import SPREAD

CANDIDATES = [c for c in every_candidate(3, default_tolerances(), frozenset()) if places_of(c) is not None]
SIZES = np.concatenate([np.full(len(group.entries), SPREAD[group.name]) for group in GROUPS])


@pytest.fixture(scope="module")
def case():
    return exact()


def rows_of(case, x):
    """Rows of the same readings if the robots were so, shape (n, C)."""
    units = ArmUnit(DESIGN, x)
    s = case.signals
    truth = replace(
        s, **dict(zip(("phi", "theta", "tau"), true_joints(units, s.phi, s.theta, s.tau), strict=True))
    )
    return exact_residual(truth, case.shared, case.bases, units, case.reduction)


def team(case, origin=None):
    exact_signals = SignalNoise((np.zeros((3, 21, 18)),) * 2)
    sensed = Sensed(None, (np.copy,), (exact_signals,))
    trials = (case.carried.recording,), sensed, (case.linear,)
    return TeamRig(*trials, default_tolerances(), frozenset(), origin)


@pytest.mark.parametrize("candidate", [c for c in CANDIDATES if c.robot == 2], ids=lambda c: c.label)
def test_a_deviation_of_the_robot_takes_out_what_the_column_says(case, candidate):
    """Every parameter alone, by central differences of the exact residual of robots that are so."""
    cause, place = CAUSES[candidate.cause], places_of(candidate)
    columns = cause.columns(case.linear, candidate.robot - 1, (candidate.joint or 1) - 1, candidate.shape)
    for k, at in enumerate(place[1]):
        x = np.zeros((3, COUNT))
        x[place[0], at] = 0.02 * SIZES[at]
        change = 0.5 * (rows_of(case, x) - rows_of(case, -x))
        expected = -columns[..., k] * x[place[0], at]
        for channels in (slice(0, 12), slice(12, 18)):
            scale = np.abs(expected[:, channels]).max()
            np.testing.assert_allclose(change[:, channels], expected[:, channels], atol=0.02 * scale + 1e-9)
        assert np.abs(expected).max() > 1e-7


@pytest.mark.parametrize(
    "candidate",
    [c for c in CANDIDATES if c.robot == 2 and c.cause in ("link_length", "sea_scale", "sea_bias")],
    ids=lambda c: c.label,
)
def test_columns_are_those_of_arms_as_they_are(case, candidate):
    """Around robots that nobody calibrated, by central differences of the exact residual: its rms, kinds apart."""
    there = SIZES * np.random.default_rng(5).standard_normal((3, COUNT))
    s, units = case.signals, ArmUnit(DESIGN, there)
    true = dict(zip(("phi", "theta", "tau"), true_joints(units, s.phi, s.theta, s.tau), strict=True))
    linear = linearise(replace(s, **true), case.shared, case.bases, units, case.reduction, full=True)
    cause, place = CAUSES[candidate.cause], places_of(candidate)
    columns = cause.columns(linear, candidate.robot - 1, (candidate.joint or 1) - 1, candidate.shape)
    for k, at in enumerate(place[1]):
        step = np.zeros((3, COUNT))
        step[place[0], at] = 1e-3 * SIZES[at]
        change = 0.5 * (rows_of(case, there + step) - rows_of(case, there - step)) / (1e-3 * SIZES[at])
        for channels in (slice(0, 12), slice(12, 18)):
            size = np.linalg.norm(columns[:, channels, k])
            assert np.linalg.norm(change[:, channels] + columns[:, channels, k]) <= 3e-3 * size


@pytest.mark.parametrize("name", ["theta_zero", "sea_bias", "link_length", "base_tilt"])
def test_values_are_counted_from_where_the_robots_were_believed_to_be(case, name):
    """At the origin's value the exact rows are those that are there; away from it, they change by the slope."""
    rng = np.random.default_rng(3)
    origin = ArmUnit(DESIGN, 0.1 * SIZES * rng.standard_normal((3, COUNT)))
    rig = team(case, origin)
    candidate = next(c for c in CANDIDATES if c.cause == name and c.robot == 3)
    (columns,), residual = rig.columns(candidate), rig.whitening[0](rig.linear[0].residual)
    nothing = np.zeros(rig.linear[0].by_shared.shape[2]), [np.zeros(rig.local_unknowns)]
    value = origin_of(candidate, origin)
    np.testing.assert_array_equal(value, origin.x[places_of(candidate)])
    (at,) = rig.residual_there(*nothing, [(candidate, value)])
    np.testing.assert_allclose(at, residual, atol=1e-9)
    step = 1e-3 * candidate.units
    (away,) = rig.residual_there(*nothing, [(candidate, value + step)])
    np.testing.assert_allclose(away - at, -columns @ step, atol=0.02 * np.abs(columns @ step).max())


def test_a_simulation_has_every_healthy_part_once_and_of_less_than_nothing_nothing(case):
    """Robots as designed have theirs as effects, zeros of encoders among them; a cause stands in its kind's place."""
    rig = team(case)
    at = {c.key: c for c in rig.candidates()}
    rubs, healthy, less, lag, zero = (
        at[key]
        for key in (
            ("joint_friction", 2, 1), ("joint_friction", 1, 3), ("joint_friction", 3, 2), ("sensor_lag", 1, 1),
            ("phi_zero", 1, 2),
        )
    )  # fmt: skip
    off = [
        (rubs, np.array([0.001, 0.001])), (healthy, np.array([0.002, -0.001])), (less, np.array([-0.002, -0.001])),
        (lag, np.full(len(lag.parameters), -1e-3)), (zero, np.array([1e-4])),
    ]  # fmt: skip
    unknowns = np.zeros(rig.linear[0].by_shared.shape[2]), np.zeros(rig.local_unknowns)
    effects = rig.simulation(0, *unknowns, [(rubs, np.array([0.06, 0.02]))], off).args[3]
    told = {(e.cause, e.robot, e.joint): e for e in effects}
    assert len(told) == len(effects) == 4
    assert told[rubs.key].coulomb_Nm == 0.06
    assert (told[healthy.key].coulomb_Nm, told[healthy.key].viscous_Nms_per_rad) == (0.002, 0.0)
    assert (told[less.key].coulomb_Nm, told[less.key].viscous_Nms_per_rad) == (0.0, 0.0)
    assert told[zero.key].zero_rad == 1e-4

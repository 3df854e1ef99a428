"""What a calibration is worth: findings, trials left out, shares, and the way down."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from estimator.arm.unit import AT, COUNT, ArmUnit
from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.calibration import GRASPS, INERTIAL
from estimator.calibrate.equations import TrialEquations
from estimator.calibrate.findings import held_out, shares
from estimator.calibrate.least_squares import (
    CarriedTrial,
    Fit,
    Given,
    Layout,
    Quadratic,
    TrialFit,
    Unknowns,
    fit,
)
from estimator.calibrate.prior import Prior
from estimator.calibrate.rows import Rows, Sensing
from estimator.errors import InputError
from estimator.filtering import low_pass
from estimator.recording.model import Recording
from omnid_design import DESIGN
from synthetic_team import Load, carry, draw_path, draw_units, load, with_noise

Team = tuple[ArmUnit, Load, list[Recording]]


@pytest.fixture(scope="module")
def team() -> Team:
    rng = np.random.default_rng(31)
    units, held = draw_units(3, Prior(), rng), load(3, rng)
    return units, held, [_trial(units, held, rng, name) for name in ("first", "second", "third")]


def _trial(units: ArmUnit, held: Load, rng: np.random.Generator, name: str) -> Recording:
    exact = carry(units, held, draw_path(held, rng), rng, 12.0)
    return replace(with_noise(exact.recording, 2e-5, 0.01, rng), name=name)


def test_good_recordings_have_none(team: Team) -> None:
    calibration = calibrate(team[2])
    assert calibration.findings == ()
    assert max(max(trial.after) for trial in calibration.trials) < 1.2
    for trial in calibration.trials:  # six numbers a row of each other robot's flange, and six of the wrench
        assert trial.count[0] == 2 * trial.count[1] > 0


@pytest.mark.parametrize(
    ("channel", "robot", "joint", "size", "said"),
    [
        ("theta", 1, 1, np.deg2rad(0.5), "the encoder of theta_y of omnid2 slipped by 0.5 deg"),
        ("theta", 2, 2, np.deg2rad(0.3), "the encoder of theta_x of omnid3 slipped by 0.3 deg"),
        ("phi", 0, 1, np.deg2rad(0.2), "the encoder of phi2 of omnid1 slipped by 0.2 deg"),
        ("tau", 2, 0, 0.2, "the torque zero of tau1 of omnid3 moved by 0.2 N m"),
    ],
)
def test_a_sensor_that_slipped_in_one_recording_is_named(
    team: Team, channel, robot, joint, size, said
) -> None:
    moved = getattr(team[2][1], channel).copy()
    moved[:, robot, joint] += size
    calibration = calibrate([team[2][0], replace(team[2][1], **{channel: moved}), team[2][2]])
    assert len(calibration.findings) == 1
    assert calibration.findings[0].startswith(f"second contradicts the other recordings: {said}.")


def test_another_payload_under_the_same_label_is_told(team: Team) -> None:
    units, held, recordings = team
    rng = np.random.default_rng(32)
    # Mass and grasps as they were, the mass a little elsewhere: nothing refuses it beforehand.
    elsewhere = replace(held, com=held.com + np.array([0.004, -0.002, 0.006]))
    found = calibrate([*recordings[:2], _trial(units, elsewhere, rng, "other")]).findings
    assert len(found) == 1
    assert found[0].startswith("other contradicts the other recordings: it looks like another payload.")


def test_friction_in_all_recordings_is_no_calibration(team: Team) -> None:
    rubbing = []
    for recording in team[2]:
        tau = recording.tau.copy()
        tau[:, 0, 1] += 0.1 * np.sign(np.gradient(low_pass(recording.phi[:, 0, 1], 100.0, 5.0)))
        rubbing.append(replace(recording, tau=tau))
    found = calibrate(rubbing).findings
    assert len(found) == 1
    assert found[0].startswith("No calibration explains first (")
    assert "mocobot diagnose" in found[0]


@pytest.fixture(scope="module")
def stranger(team: Team) -> Recording:
    """The same payload and other robots."""
    rng = np.random.default_rng(33)
    return _trial(draw_units(3, Prior(), rng), team[1], rng, "stranger")


def test_a_recording_of_other_robots_is_told(team: Team, stranger: Recording) -> None:
    found = calibrate([team[2][0], stranger, team[2][1]]).findings
    assert len(found) == 1
    assert found[0].startswith(
        "stranger contradicts the other recordings: the others fit one team of robots, and it fits another."
    )


def test_robots_in_another_order_are_told(team: Team) -> None:
    """Grasps on a regular triangle stay where they are when the robots go round; the centre of mass does not."""
    order, third = [1, 2, 0], team[2][2]
    turned = replace(
        third, phi=third.phi[:, order], theta=third.theta[:, order], tau=third.tau[:, order], name="turned"
    )
    with pytest.raises(InputError, match=r"contradict each other.*same robots, in the same order"):
        calibrate([*team[2][:2], turned])


def test_what_stays_open_is_said(team: Team) -> None:
    alone = calibrate(team[2][:1])
    scale, theta_x, masses, single = alone.open
    assert "0.67 %" in scale  # 2 % over the root of nine springs
    assert "--known-mass" in scale
    assert "1 deg" in theta_x
    assert "--parallel-flanges" in theta_x
    assert "Where each is known to 5 % only" in masses
    assert "--free" in masses
    assert single.startswith("first: with one recording none can be left out")
    farthest_mm = 1e3 * np.linalg.norm(alone.payloads[0].grasps.p_1i, axis=1).max()
    assert f"up to {farthest_mm * np.deg2rad(1.0):.2g} mm" in theta_x
    held = alone.payloads[0]
    assert f"brings that to {100 * np.sqrt(held.covariance[12, 12]) / held.parameters[0]:.1g} %" in scale
    weighed = calibrate(team[2][:2], known_mass={"": (alone.payloads[0].parameters[0], 0.001)})
    assert not any("--known-mass" in sentence for sentence in weighed.open)
    assert len(weighed.open) == 2


def test_what_is_assumed_to_be_known_does_not_stay_open(team: Team) -> None:
    two = team[2][:2]
    assert len(calibrate(two).open) == 3
    zeros = calibrate(two, prior=Prior(encoder_zero_rad=0.0)).open
    assert not any("theta_x" in sentence for sentence in zeros)
    assert len(zeros) == 2
    masses = calibrate(two, prior=Prior(arm_mass_ratio=0.05)).open
    assert not any("--arm-masses" in sentence for sentence in masses)
    assert len(masses) == 2


def test_a_sensitivity_to_arm_masses_is_that_of_heavier_arms(team: Team) -> None:
    """The sentence's share, from exact recordings of a team whose masses are off one by one."""
    units, held, _ = team
    said = calibrate(team[2][:2]).open[2]
    share = float(said.split("payload's mass is off by ")[1].split(" %")[0])
    rng = np.random.default_rng(34)
    off = []
    for _ in range(6):
        x = units.x.copy()
        x[:, 23:30] += 0.05 * rng.standard_normal((3, 7))
        heavier = ArmUnit(units.design, x)
        recordings = [with_noise(carry(heavier, held, draw_path(held, rng), rng, 12.0).recording, 2e-6, 1e-3, rng)
                      for _ in range(2)]  # fmt: skip
        off.append(100.0 * (calibrate(recordings).payloads[0].parameters[0] / held.mass - 1.0))
    assert 0.5 * share < np.sqrt(np.mean(np.square(off))) < 1.7 * share


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


def test_shares_are_those_of_the_noise() -> None:
    """Least squares of plain rows: the result is M_k e_k summed over recordings, whose noise e_k is white."""
    rng = np.random.default_rng(5)
    layout = Layout(2, 2, 2)
    own = np.arange(layout.size)
    held = np.r_[AT["tilt"], COUNT + np.r_[AT["tilt"]]]
    free = np.setdiff1d(own, held)
    trials = [np.r_[layout.of_units, layout.of_payload(k), layout.of_trial(k)] for k in range(2)]
    trials.append(np.r_[layout.of_units])  # a free one
    rows = [rng.normal(size=(300 + 200 * k, len(index))) for k, index in enumerate(trials)]
    information = np.eye(layout.size)  # a weak prior
    for A, index in zip(rows, trials, strict=True):
        information[np.ix_(index, index)] += A.T @ A
    C = np.zeros((layout.size, layout.size))
    C[np.ix_(free, free)] = np.linalg.inv(information[np.ix_(free, free)])
    parts = [
        Quadratic(index, A.T @ A, np.zeros(len(index)), 0.0, len(A))
        for A, index in zip(rows, trials, strict=True)
    ]
    carried = tuple(TrialFit(part, part, part) for part in parts[:2])
    fields: dict[str, Any] = dict.fromkeys(Fit.__dataclass_fields__)
    fields |= {"layout": layout, "covariance": C, "point": SimpleNamespace(trials=carried, alone=(parts[2],))}
    found = shares(cast(Any, Fit)(**fields))
    assert len(found) == 3
    M = [C[:, index] @ A.T for A, index in zip(rows, trials, strict=True)]
    variance = [np.sum(m**2, axis=1) for m in M]
    grasps, inertial = ([np.r_[of(k)] for k in range(2)] for of in (layout.of_payload, layout.of_inertia))
    kinds = {
        "rod_length": np.r_[AT["rod_length"], COUNT + np.r_[AT["rod_length"]]],
        GRASPS: np.concatenate([at[:-10] for at in grasps]),
        INERTIAL: np.concatenate(inertial),
    }
    for kind, at in kinds.items():
        for share, part in zip(found, variance, strict=True):
            np.testing.assert_allclose(share[kind], np.mean(part[at] / np.diag(C)[at]))
        assert 0.98 < sum(share[kind] for share in found) < 1.0  # the rest is the prior's
    assert "tilt" not in found[0]
    assert found[2][INERTIAL] < 0.1 < found[2]["rod_length"]

"""Recordings that do not belong together, or that something else acts on: a finding says which, and what."""

from dataclasses import replace

import numpy as np
import pytest

from estimator.arm.unit import ArmUnit
from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.calibration import Prior
from estimator.errors import InputError
from estimator.filtering import low_pass
from estimator.recording.model import Recording
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


def test_of_two_recordings_neither_is_the_wrong_one(team: Team, stranger: Recording) -> None:
    found = calibrate([team[2][0], stranger]).findings
    assert len(found) == 1
    assert found[0].startswith("first and stranger contradict each other: without either")


def test_a_recording_of_other_robots_that_rub_fits_no_team(team: Team, stranger: Recording) -> None:
    tau = stranger.tau.copy()
    tau[:, 0, 1] += 0.1 * np.sign(np.gradient(low_pass(stranger.phi[:, 0, 1], 100.0, 5.0)))
    found = calibrate([team[2][0], replace(stranger, tau=tau), team[2][1]]).findings
    assert len(found) == 1
    assert found[0].startswith(
        "stranger contradicts the other recordings: the others fit one team of robots, and it fits none."
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


def test_the_recording_that_fits_worst_is_named(team: Team) -> None:
    """All robots rub in both, and in one of them more."""
    rubbing = []
    for recording, size in zip(team[2][:2], (0.1, 0.3), strict=True):
        tau = recording.tau.copy()
        tau[:, 0, 1] += size * np.sign(np.gradient(low_pass(recording.phi[:, 0, 1], 100.0, 5.0)))
        rubbing.append(replace(recording, tau=tau))
    (found,) = calibrate(rubbing).findings
    assert found.startswith("No calibration explains first (")
    assert "; second (" in found
    assert "most in second" in found

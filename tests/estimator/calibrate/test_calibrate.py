"""Calibrations of exact and noisy teams, of held robots, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.arm.unit import AT, COUNT, ArmUnit
from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.calibration import CalibratedPayload, Calibration
from estimator.calibrate.least_squares import CarriedTrial, Given, Unknowns, fit
from estimator.calibrate.prior import Prior, read_prior
from estimator.calibrate.rows import Rows, Sensing
from estimator.errors import InputError
from estimator.recording.model import Recording
from mocobot_sim.scene.as_built import CalibrationSpread
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import PRESETS, measure
from mocobot_sim.trial.trajectories import random_vias
from mocobot_sim.trial.trial import run_trial
from omnid_design import DESIGN
from payload_mjcf import TWO
from recorded_team import COM, GRASPS, INERTIA, MASS, Sines
from recorded_team import carry as carry_recorded
from recordings import small_recording
from synthetic_team import Load, carry, draw_path, draw_units, load, with_noise


def team(seed, robots=3, prior=None, trials=1, scale=0.0, payloads=1, duration_s=20.0):
    """Exact trials of one team; ``scale`` is the mean of all spring ratios. Trials go round the payloads."""
    rng = np.random.default_rng(seed)
    units = draw_units(robots, prior or Prior(), rng)
    units.x[:, AT["stiffness_ratio"]] += scale
    loads = [load(robots, rng) for _ in range(payloads)]
    if payloads > 1:
        loads[1] = replace(loads[1], mass=0.6 * loads[1].mass, com=loads[1].com + np.array([0.1, -0.1, 0.05]))
    labels = [None] if payloads == 1 else ["first", "second"]
    exact = [
        carry(
            units,
            loads[k % payloads],
            draw_path(loads[0], rng),
            rng,
            duration_s,
            payload=labels[k % payloads],
        )
        for k in range(trials)
    ]
    return units, loads, [replace(one.recording, name=f"trial {k + 1}") for k, one in enumerate(exact)], exact


def payload_error(found: CalibratedPayload, held: Load) -> np.ndarray:
    """Estimate minus truth in the order of its covariance."""
    turned = Rotation.from_matrix(found.grasps.R_1i[1:] @ np.swapaxes(held.R_1i[1:], 1, 2)).as_rotvec()
    shifted = found.grasps.p_1i[1:] - held.p_1i[1:]
    return np.concatenate(
        [np.concatenate([turned, shifted], axis=1).ravel(), found.parameters - held.shared.pi]
    )


@pytest.mark.parametrize("robots", [3, 5])
def test_exact_data_give_the_robots_and_the_payload(robots):
    """Tilted bases, one trial, nothing known beforehand; tolerances of a millionth where robots are off by a degree."""
    prior = Prior(tilt_rad=0.003)
    units, loads, recordings, _ = team(robots, robots, prior)
    found = calibrate(recordings, prior=prior)
    assert found.steps < 9
    payload = found.payloads[0]
    error = payload_error(payload, loads[0])
    grasps = error[:-10].reshape(-1, 6)
    assert np.abs(grasps[:, :3]).max() < 1e-7
    assert np.abs(grasps[:, 3:]).max() < 2e-6
    assert payload.parameters == pytest.approx(loads[0].shared.pi, rel=1e-4, abs=1e-4)
    off = np.abs(found.units.x - units.x) / np.maximum(found.prior_sd, 1e-12)
    held = found.prior_sd == 0
    assert not found.units.x[held].any()
    # What is known to a tenth of the prior is where it was put; the rest stays within its error.
    known = ~held & (found.sd < 0.1 * found.prior_sd)
    assert known.sum() > 0.6 * (~held).sum()
    assert off[known].max() < 5e-3
    assert np.abs(found.units.x - units.x)[~held].max() < 1e-3
    trial = found.trials[0]
    assert trial.before is not None
    assert min(trial.before) > 1e5
    assert max(trial.after) < 1e-3
    assert trial.held_out is None


def test_ten_robots():
    units, loads, recordings, _ = team(1, 10, duration_s=10.0)
    found = calibrate(recordings)
    error = payload_error(found.payloads[0], loads[0])[:-10].reshape(-1, 6)
    assert np.abs(error[:, :3]).max() < 1e-6
    assert np.abs(error[:, 3:]).max() < 1e-4
    assert np.abs(found.units.x - units.x)[:, AT["phi_zero"]].max() < 2e-5
    assert found.payloads[0].parameters[0] == pytest.approx(loads[0].mass, rel=1e-3)


def test_a_held_scale_shrinks_all_that_is_weighed():
    """Springs that are all 3 % stiffer: masses and inertia over 1.03, arms' masses too, and nothing else."""
    scale = 0.03
    units, loads, recordings, _ = team(5, scale=scale)
    found = calibrate(recordings)
    payload = found.payloads[0]
    assert payload.parameters * (1.0 + scale) == pytest.approx(loads[0].shared.pi, rel=2e-3, abs=1e-3)
    assert payload.parameters[0] * (1.0 + scale) == pytest.approx(loads[0].mass, rel=5e-5)
    assert np.abs(payload_error(payload, loads[0])[:-10]).max() < 2e-5
    ratio = (1.0 + units.of("stiffness_ratio")) / (1.0 + scale) - 1.0
    assert found.units.of("stiffness_ratio") == pytest.approx(ratio, abs=2e-4)
    for name in ("proximal_mass_ratio", "rod_mass_ratio", "wrist_mass_ratio"):
        ratio = (1.0 + units.of(name)) / (1.0 + scale) - 1.0
        assert found.units.of(name) == pytest.approx(ratio, abs=1e-3)
    # The derivative says so too.
    assert payload.by_scale[-10] == pytest.approx(loads[0].mass / (1.0 + scale), rel=0.05)
    assert found.scale_sd == pytest.approx(0.02 / 3.0)


def test_a_known_mass_gives_the_scale_and_the_other_payload():
    units, loads, recordings, _ = team(6, scale=0.03, payloads=2, trials=2)
    found = calibrate(recordings, known_mass={"first": (loads[0].mass, 1e-5)})
    assert found.scale_sd == 0.0
    assert found.units.of("stiffness_ratio") == pytest.approx(units.of("stiffness_ratio"), abs=5e-4)
    assert found.units.of("stiffness_ratio").mean() == pytest.approx(0.03, abs=2e-4)
    for payload, held in zip(found.payloads, loads, strict=True):
        assert payload.parameters[0] == pytest.approx(held.mass, rel=5e-5)
        assert payload.parameters == pytest.approx(held.shared.pi, rel=2e-3, abs=1e-3)


@pytest.mark.slow
def test_two_robots(tmp_path):
    """The payload swings between them, so the simulator carries it; errors within four claimed standard errors."""
    units = CalibrationSpread(np.deg2rad(1.0), 0.0, 1e-3, 0.02).draw(2, np.random.default_rng(4))
    scene = build_team(TWO.write(tmp_path), units)
    log = run_trial(scene, random_vias(scene.wrist_home_b, np.random.default_rng(5), vias=24))
    found = calibrate([measure(log, PRESETS["nominal"], np.random.default_rng(6))])
    turn = Rotation.from_rotvec(
        np.outer([unit.theta_zero_rad[2] for unit in units], [1.0, 0.0, 0.0])
    ).as_matrix()
    grasps = found.payloads[0].grasps
    back = turn[0].T
    R, p = back @ scene.X_1i.rotation.as_matrix()[1] @ turn[1], back @ scene.X_1i.translation[1]
    error = np.concatenate([Rotation.from_matrix(grasps.R_1i[1] @ R.T).as_rotvec(), grasps.p_1i[1] - p])
    sd = np.sqrt(np.diag(grasps.covariance))
    assert np.abs(error / sd).max() < 4.0
    assert np.linalg.norm(error[:3]) < np.deg2rad(0.01)
    assert np.linalg.norm(error[3:]) < 2e-3
    assert np.linalg.norm(sd[3:]) < 1e-3


def test_one_robot_and_no_recording_are_refused():
    with pytest.raises(InputError, match="no recording"):
        calibrate([])
    _, _, recordings, _ = team(1, duration_s=8.0)
    one = recordings[0]
    alone = replace(
        one,
        phi=one.phi[:, :1],
        theta=one.theta[:, :1],
        tau=one.tau[:, :1],
        metadata=replace(one.metadata, robots=1),
    )
    with pytest.raises(InputError, match="one robot closes no loop"):
        calibrate([alone])


@pytest.mark.slow
def test_errors_are_as_claimed():
    """NEES of 12 teams drawn from the prior, Gaussian noise: robots and payload inside the 95 % band."""
    prior, teams = Prior(), 12
    nees, chi2, inside = [], [], []
    for seed in range(teams):
        rng = np.random.default_rng([seed, 31])
        units, loads, recordings, exact = team(200 + seed, trials=2, duration_s=14.0)
        noisy = [with_noise(one, 2e-5, 0.01, rng) for one in recordings]
        sensing = Sensing(np.zeros((3, 9)), np.tile(np.repeat([2e-5, 2e-5, 0.01], 3), (3, 1)))
        start = Unknowns(
            ArmUnit(DESIGN, np.zeros((3, COUNT))), (loads[0].shared,), tuple(one.bases for one in exact)
        )
        found = fit(Given([CarriedTrial(Rows.of(one), 0, sensing) for one in noisy], start, prior))
        at, factor = found.layout.of_units, prior.factor(3, hold_scale=True)
        back = np.linalg.pinv(factor)
        z = back @ (found.point.unknowns.units.x - units.x).ravel()
        covariance = back @ found.covariance[at, at] @ back.T
        robots = z @ np.linalg.solve(covariance, z)
        at = found.layout.of_payload(0)
        error = payload_error(found.payload(0, None), loads[0])
        sd = np.sqrt(np.diag(found.covariance[at, at]))
        correlation = found.covariance[at, at] / np.outer(sd, sd)
        nees.append([robots, (error / sd) @ np.linalg.solve(correlation, error / sd)])
        inside.append(np.concatenate([np.abs(z / np.sqrt(np.diag(covariance))), np.abs(error / sd)]) < 1.96)
        chi2.append([one.all.c / one.all.count for one in found.point.trials])
    mean, size = np.mean(nees, axis=0), np.array([60, 22])
    assert np.all(np.abs(mean / size - 1.0) < 1.96 * np.sqrt(2.0 / (size * teams)))
    assert 0.93 < np.mean(inside) < 0.97
    # A hundredth of the variance is the floor under every sensor's noise; unknowns take up a twentieth.
    assert 0.85 < np.mean(chi2) < 1.0


DESIGNED = Prior().scaled(0.0)


@pytest.fixture(scope="module")
def recording() -> Recording:
    """9 s of three robots exactly as designed, whose torques are read in steps of 1 mN m."""
    rng = np.random.default_rng(4)
    path = Sines.draw(rng, [0.06] * 3 + [0.02] * 3, 6, 0.1, 1.0)
    exact = carry_recorded(path, Sines.draw(rng, [4.0] * 3, 6, 0.1, 1.0), 9.0).recording
    return replace(exact, tau=np.round(exact.tau, 3))


@pytest.fixture(scope="module")
def designed(recording: Recording) -> Calibration:
    return calibrate([recording], prior=DESIGNED)


def carried(found: Calibration) -> np.ndarray:
    """Positions of grasps 2 and 3, then the inertial parameters."""
    return np.concatenate([found.payloads[0].grasps.p_1i[1:].ravel(), found.payloads[0].parameters])


def test_robots_held_as_designed_give_the_payload(designed: Calibration) -> None:
    found = designed.payloads[0]
    assert not designed.units.x.any()
    np.testing.assert_allclose(found.grasps.p_1i, [p for _, p in GRASPS], atol=2e-5)
    np.testing.assert_allclose(found.grasps.R_1i, [R for R, _ in GRASPS], atol=2e-5)
    np.testing.assert_allclose(found.parameters[:4], [MASS, *(MASS * COM)], rtol=5e-4)
    about_1 = INERTIA + MASS * (COM @ COM * np.eye(3) - np.outer(COM, COM))
    np.testing.assert_allclose(found.parameters[[4, 7, 9]], np.diag(about_1), rtol=1e-3)


def test_errors_of_held_robots_go_on_to_the_payload(recording: Recording, designed: Calibration) -> None:
    """Held elsewhere, the payload comes out elsewhere; the covariance predicts by how much."""
    moved = np.zeros((3, COUNT))
    moved[1, AT["phi_zero"]] = [6e-5, -3e-5, 0.0]
    moved[2, AT["rod_length"]] = [0.0, 1e-5, 0.0]
    moved[0, AT["stiffness_ratio"]] = [0.0, 0.0, 1.5e-4]
    there = calibrate([recording], robots=replace(designed, units=designed.units.moved(moved)))
    uncertain = replace(designed, covariance=np.outer(moved, moved))
    held = calibrate([recording], robots=uncertain)
    np.testing.assert_array_equal(there.units.x, moved)
    np.testing.assert_array_equal(held.covariance, uncertain.covariance)

    change = carried(there) - carried(designed)
    sd_before, sd = (
        np.sqrt(
            np.r_[
                np.diag(c.payloads[0].covariance)[[3, 4, 5, 9, 10, 11]],
                np.diag(c.payloads[0].covariance)[12:],
            ]
        )
        for c in (designed, held)
    )
    predicted = np.sqrt(sd**2 - sd_before**2)
    large = np.abs(change) > 0.05 * np.abs(change).max()
    np.testing.assert_allclose(predicted[large], np.abs(change)[large], rtol=0.03)


def named(name: str, **changes: Any) -> Recording:
    return replace(small_recording(**changes), name=name)


A, B, FREE = named("a"), named("b"), named("unloaded", trial="free", payload=None)
OTHER = replace(A.metadata.design, rod_mass_kg=0.3)


@pytest.mark.parametrize(
    ("carrying", "free", "said"),
    [
        ([], [], "no recording with a payload was given"),
        ([A, FREE], [], "unloaded is of robots that hold nothing; give it as a free recording"),
        ([A], [B], "b is a random trial of a payload; a free recording is of robots that hold nothing"),
        ([A, named("b", payload="x")], [], "a does not say which payload it is of, and others do; name it"),
        ([A, named("b", robots=2)], [], "b has 2 robots and a has 3; a calibration is of the same robots"),
        ([A], [named("u", robots=2, trial="free")], "u has 2 robots and a has 3; a calibration is of the same robots"),
        ([A, named("b", design=OTHER)], [], "b and a differ in design; a calibration is of the same robots"),
        ([named("one", robots=1)], [], "one: one robot closes no loop; two or more that carry one payload are needed"),
    ],
)  # fmt: skip
def test_what_does_not_belong_together(carrying: list[Recording], free: list[Recording], said: str) -> None:
    with pytest.raises(InputError) as error:
        calibrate(carrying, free)
    assert str(error.value).startswith(said)


@pytest.fixture(scope="module")
def exact() -> Recording:
    rng = np.random.default_rng(4)
    path = Sines.draw(rng, [0.06] * 3 + [0.02] * 3, 6, 0.1, 1.0)
    return replace(carry_recorded(path, Sines.draw(rng, [4.0] * 3, 6, 0.1, 1.0), 6.0).recording, name="exact")


@pytest.mark.parametrize(
    ("known", "said"),
    [
        ({"x": (1.0, 0.1)}, "known mass of payload 'x': the recordings are of ''"),
        *[
            (
                {"": given},
                rf"known mass of payload '' is {given[0]} \+- {given[1]} kg; both must be greater than 0",
            )
            for given in ((0.0, 0.1), (-1.0, 0.1), (np.inf, 0.1), (11.0, 0.0), (11.0, -0.1), (11.0, np.nan))
        ],
    ],
)
def test_masses_that_cannot_be(exact: Recording, known: dict[str, tuple[float, float]], said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}"):
        calibrate([exact], known_mass=known)


def test_motion_that_determines_nothing(exact: Recording) -> None:
    still = {name: np.repeat(getattr(exact, name)[:1], 600, axis=0) for name in ("phi", "theta", "tau")}
    rng = np.random.default_rng(1)
    noisy = {name: values + 1e-5 * rng.standard_normal(values.shape) for name, values in still.items()}
    with pytest.raises(InputError, match=r"^nothing can be estimated from these recordings: rotation R_12"):
        calibrate([replace(exact, time=np.arange(600) / 100.0, **noisy)])


def written(folder: Path, text: str) -> Path:
    path = folder / "prior.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_what_is_given_and_defaults_for_the_rest(tmp_path: Path) -> None:
    read = read_prior(written(tmp_path, "geometry_m = 2e-3\ntilt_rad = 0.0035\narm_mass_ratio = 0\n"))
    assert read == Prior(geometry_m=2e-3, tilt_rad=0.0035)
    assert read_prior(written(tmp_path, "")) == Prior()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("geometry_mm = 1", r"unknown key 'geometry_mm' \(did you mean 'geometry_m'\?\); the keys are encoder_"),
        ("geometry_m = 1", "geometry_m is 1; it must be a standard deviation from 0 to 0.05 m$"),
        ("encoder_zero_rad = -0.01", "encoder_zero_rad is -0.01; it must be a standard deviation from 0 to 0.35 rad$"),
        ("stiffness_ratio = 2", "stiffness_ratio is 2; it must be a standard deviation from 0 to 0.5$"),
        ("tau_zero_Nm = nan", "tau_zero_Nm is nan; it must be a standard deviation from 0 to 5 N m$"),
        ("tilt_rad = true", "tilt_rad is True; it must be"),
        ("arm_mass_ratio = '10 %'", "arm_mass_ratio is '10 %'; it must be"),
        ("geometry_m 1", r"not a readable prior of a calibration \("),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=rf"prior\.toml: {said}"):
        read_prior(written(tmp_path, text))


def test_the_mean_of_all_springs_is_held_and_the_arms_weigh_more_or_less_together() -> None:
    """What a prior means, by draws of it."""
    factor = Prior(arm_mass_ratio=0.1).factor(2, hold_scale=True)
    draws = factor @ np.random.default_rng(2).standard_normal((factor.shape[1], 4000))
    x = draws.T.reshape(-1, 2, COUNT)
    springs = x[:, :, AT["stiffness_ratio"]]
    np.testing.assert_allclose(springs.mean(axis=(1, 2)), 0.0, atol=1e-15)
    np.testing.assert_allclose(springs.std(axis=0), 0.02 * np.sqrt(5 / 6), rtol=0.05)
    wrists = x[:, :, AT["wrist_mass_ratio"]][..., 0]
    assert np.mean(wrists[:, 0] * wrists[:, 1]) == pytest.approx(0.05**2, rel=0.25)
    assert wrists.std() == pytest.approx(np.hypot(0.1, 0.05), rel=0.05)

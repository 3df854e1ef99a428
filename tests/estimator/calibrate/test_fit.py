"""Calibrations of synthetic teams: exact data give the truth, noisy data errors as claimed."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.arm.unit import AT, COUNT, ArmUnit
from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.calibration import CalibratedPayload, Prior
from estimator.calibrate.least_squares import CarriedTrial, Given, Unknowns, fit
from estimator.calibrate.rows import Rows, Sensing
from estimator.errors import InputError
from mocobot_sim.scene.as_built import CalibrationSpread
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import PRESETS, measure
from mocobot_sim.trial.trajectories import random_vias
from mocobot_sim.trial.trial import run_trial
from omnid_design import DESIGN
from payload_mjcf import TWO
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

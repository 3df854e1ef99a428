"""Hold detection, mass and centre of mass."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.estimate.grasps import estimate_grasps
from estimator.estimate.leftover import Steps
from estimator.estimate.statics import estimate_com, estimate_mass
from estimator.signals import GraspData, Hold, find_holds
from rigid_body_data import GRAVITY, make_body, moving, still

TILTS = [(0, 0), (0.08, 0), (-0.08, 0), (0, 0.08), (0, -0.08), (0.05, 0.05)]
NOISE = {"twist_noise": 1e-3, "linear_noise": 2e-4, "wrench_noise": 0.07}  # 0.02 N after the filter


def force_record(force, rate=100.0):
    """One robot at rest that feels the given forces in its base frame, shape (Q, 3)."""
    Q = len(force)
    wrench = np.zeros((Q, 1, 6))
    wrench[:, 0, 3:] = force
    return GraspData(
        time=np.arange(Q) / rate,
        R_bi=np.tile(np.eye(3), (Q, 1, 1, 1)),
        p_bi=np.zeros((Q, 1, 3)),
        twist=np.zeros((Q, 1, 6)),
        twist_dot=np.zeros((Q, 1, 6)),
        wrench=wrench,
        rate_hz=rate,
        gravity_mps2=GRAVITY,
    )


def slow_noise(rng, Q, std):
    """Noise below 5 Hz of the given standard deviation, shape (Q, 3)."""
    spectrum = np.fft.rfft(rng.normal(size=(Q, 3)), axis=0)
    spectrum[np.fft.rfftfreq(Q, 0.01) > 5.0] = 0
    x = np.fft.irfft(spectrum, Q, axis=0)
    return std * x / x.std()


def exact_hold(body, R_w1, rng, bias=0.0, noise=0.0):
    """A hold in exact equilibrium, with optional force errors: constant ones and batch noise."""
    N = len(body.p_1i)
    f = rng.normal(0, 10, (N, 3))
    m = rng.normal(0, 1, (N, 3))
    weight = R_w1.T @ np.array([0, 0, body.mass * GRAVITY])  # in {1}
    f[0] = weight - f[1:].sum(axis=0)
    m[0] = np.cross(body.p_1c, weight) - m[1:].sum(axis=0) - np.cross(body.p_1i, f).sum(axis=0)
    f = f + bias * rng.normal(size=f.shape)
    wrench = np.concatenate([np.einsum("iba,ib->ia", body.R_1i, x) for x in (m, f)], axis=1)
    batches = wrench + noise * rng.normal(size=(12, *wrench.shape)) * [0, 0, 0, 1, 1, 1]
    yaw = Rotation.from_rotvec(rng.uniform(-3, 3, N)[:, None] * [0, 0, 1]).as_matrix()
    R_bi = yaw @ (R_w1 @ body.R_1i)
    return Hold(0.0, 6.0, R_bi, batches.mean(axis=0), batches)


def exact_grasps(body):
    estimate, _ = estimate_grasps([moving(body, 5)])
    return estimate


def tilted(tilts=TILTS):
    return [Rotation.from_euler("ZYX", [0.3, pitch, roll]).as_matrix() for roll, pitch in tilts]


# ---- hold detection -----------------------------------------------------------------------------------------


def test_without_noise_the_criterion_is_the_papers():
    rng = np.random.default_rng(0)
    knots = np.cumsum(rng.normal(0, 0.012, (40, 3)), axis=0)
    t = np.arange(6000) / 100
    # Piecewise linear, so that the second difference is zero except at the kinks.
    force = np.column_stack([np.interp(t, np.linspace(0, 60, 40), knots[:, k]) for k in range(3)])
    force[1500:2600] = force[1500]
    force[4000:4590] = force[4000]  # 5.9 s are not enough by themselves
    inside = np.zeros(len(t), dtype=bool)
    for first in range(len(t) - 600):
        window = force[first : first + 601]
        if np.all(window.max(axis=0) - window.min(axis=0) <= 0.02):
            inside[first : first + 601] = True
    found = np.zeros(len(t), dtype=bool)
    holds = find_holds(force_record(force))
    for hold in holds:
        found[round(hold.start_s * 100) : round(hold.end_s * 100) + 1] = True
    assert inside.any()
    assert not inside.all()
    assert np.sum(inside & ~found) == 0
    assert np.sum(found & ~inside) == 0


@pytest.mark.parametrize("N", [1, 3])
@pytest.mark.parametrize("options", [{}, NOISE], ids=["exact", "noise"])
def test_all_holds_are_found_and_the_motion_between_is_not(N, options):
    data = still(make_body(N), TILTS, seconds=8.0, travel=2.0, **options)
    holds = find_holds(data)
    assert len(holds) == len(TILTS)
    for k, hold in enumerate(holds):
        assert hold.start_s == pytest.approx(10 * k, abs=0.6)
        assert hold.end_s == pytest.approx(10 * k + 8, abs=0.6)
        assert 11 <= len(hold.batches) <= 17
        assert hold.robots == N


@pytest.mark.parametrize("noise", [0.0, 0.016])
@pytest.mark.parametrize(
    "shape",
    [
        lambda t: 0.015 * t,  # creep: 0.09 N in a window
        lambda t: 0.3 * np.sin(2 * np.pi * 0.05 * t),
        lambda t: 0.3 * np.sin(2 * np.pi * 1.0 * t),  # a running mean of 1 s does not see this one
        lambda t: 5 * np.sin(2 * np.pi * 0.3 * t),
        lambda t: 1.0 * np.exp(-t / 10) + 0.004 * (20 - t),  # settling that never ends
    ],
    ids=["creep", "slow", "1Hz", "motion", "settling"],
)
def test_slow_motion_is_no_hold(noise, shape):
    t = np.arange(2000) / 100
    force = slow_noise(np.random.default_rng(1), len(t), 1.0) * noise + shape(t)[:, None] * [0.2, 0.3, 1.0]
    assert find_holds(force_record(force)) == []


def test_vibration_that_looks_like_noise_is_rejected_by_the_encoders():
    t = np.arange(1000) / 100
    data = force_record(0.5 * np.sin(2 * np.pi * 4.9 * t)[:, None] * np.ones(3))
    data.twist[:, 0, 5] = 0.02 * np.cos(2 * np.pi * 4.9 * t)
    assert find_holds(data) == []


# ---- mass and centre of mass --------------------------------------------------------------------------------


@pytest.mark.parametrize("N", [1, 2, 5])
def test_exact_holds_give_exact_mass_and_centre_of_mass(N):
    body, rng = make_body(N), np.random.default_rng(N)
    holds = [exact_hold(body, R, rng) for R in tilted()]
    mass = estimate_mass(holds, GRAVITY)
    assert mass.mass == pytest.approx(body.mass, abs=1e-12)
    assert mass.se < 1e-9
    com, report = estimate_com(holds, mass, exact_grasps(body), GRAVITY)
    assert report.determined
    np.testing.assert_allclose(com.p_1c, body.p_1c, atol=1e-10)


def test_the_paper_s_record_end_to_end():
    body = make_body(3)
    holds = find_holds(still(body, TILTS, **NOISE))
    mass = estimate_mass(holds, GRAVITY)
    com, _ = estimate_com(holds, mass, exact_grasps(body), GRAVITY)
    assert abs(mass.mass - body.mass) < 0.003
    assert np.linalg.norm(com.p_1c - body.p_1c) < 3e-3


def test_one_hold_is_enough_for_the_mass():
    body = make_body(3)
    mass = estimate_mass([exact_hold(body, tilted()[1], np.random.default_rng(0))], GRAVITY)
    assert mass.mass == pytest.approx(body.mass, abs=1e-12)


def test_grasp_moments_enter_the_centre_of_mass():
    body, rng = make_body(2), np.random.default_rng(0)
    holds = [exact_hold(body, R, rng) for R in tilted()]
    for hold in holds:
        hold.wrench[:, :3] = 0
    com, _ = estimate_com(holds, estimate_mass(holds, GRAVITY), exact_grasps(body), GRAVITY)
    assert com is None or np.linalg.norm(com.p_1c - body.p_1c) > 1e-3


@pytest.mark.parametrize("bias", [0.0, 0.01])
def test_standard_errors_of_mass_and_com_against_sampling(bias):
    """Batch noise alone, and with force errors that are constant in a hold but differ between holds."""
    body, grasps = make_body(3), exact_grasps(make_body(3))
    estimates, claims = [], []
    for seed in range(300):
        rng = np.random.default_rng(seed)
        holds = [exact_hold(body, R, rng, bias=bias, noise=0.02) for R in tilted()]
        mass = estimate_mass(holds, GRAVITY)
        com, _ = estimate_com(holds, mass, grasps, GRAVITY)
        estimates.append([mass.mass, *com.p_1c])
        claims.append([mass.se**2, *np.diag(com.covariance)[1:]])
        assert com.covariance[0, 0] == pytest.approx(mass.se**2)
    ratio = np.sqrt(np.mean(claims, axis=0)) / np.std(estimates, axis=0)
    assert np.all(np.abs(ratio - 1) < 0.25), ratio
    assert np.all(np.abs(np.mean(estimates, axis=0) - [body.mass, *body.p_1c]) < 4 * np.std(estimates) / 17)


STEP_N = 0.25
STEPS = Steps(1e-4, 1e-4, 0.05, 0.2, 5.0, force_N=STEP_N, read_hz=100.0, still_rad2=np.zeros(1))


@pytest.mark.parametrize(("noise", "least", "most"), [(0.0, 0.85, 1.15), (0.1, 0.7, 1.2), (1.0, 0.8, 1.25)])
def test_one_hold_of_coarse_readings(noise: float, least: float, most: float) -> None:
    """The error of the mean over the standard error, whether noise averages the rounding out or not."""
    rng, ratios = np.random.default_rng(4), []
    for _ in range(150):
        force = np.array([0.0, 0.0, 20.0]) + rng.uniform(0.0, STEP_N, 3)
        read = np.round((force + noise * STEP_N * rng.normal(size=(900, 3))) / STEP_N) * STEP_N
        holds = [STEPS.of_hold(hold) for hold in find_holds(force_record(read))]
        if holds:  # noise near a step may look like a change
            mass = estimate_mass(holds, GRAVITY)
            ratios.append((mass.mass - force[2] / GRAVITY) / mass.se)
    assert len(ratios) > 80
    assert least < np.sqrt(np.mean(np.square(ratios))) < most


def test_tilts_that_rest_on_one_reading_make_grasps_uncertain() -> None:
    grasps = exact_grasps(make_body(3))
    rng, variances, found = np.random.default_rng(7), np.array([1e-6, 4e-6, 0.0]), []
    for _ in range(1000):
        first, *others = Rotation.from_rotvec(rng.normal(size=(3, 3)) * np.sqrt(variances)[:, None])
        errors = []
        for R, p, own in zip(grasps.R_1i[1:], grasps.p_1i[1:], others, strict=True):
            read = first.inv() * Rotation.from_matrix(R) * own
            errors += [*(Rotation.from_matrix(R) * read.inv()).as_rotvec(), *(p - first.inv().apply(p))]
        found.append(errors)
    expected = grasps.rounded(variances).covariance - grasps.covariance
    np.testing.assert_allclose(np.cov(np.transpose(found)), expected, atol=0.12 * expected.max())

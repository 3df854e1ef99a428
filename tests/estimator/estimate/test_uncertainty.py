"""Standard errors, and what the data determine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.errors import InputError
from estimator.estimate.consistency import (
    balance_flags,
    check_agreement,
    check_disagreement_is_noise,
    check_rigid,
    wrench_balance,
)
from estimator.estimate.grasps import GraspEstimate, estimate_grasps, single_robot
from estimator.estimate.inertia import estimate_inertia
from estimator.estimate.joint import estimate_joint
from estimator.estimate.statics import estimate_com, estimate_mass
from estimator.estimate.uncertainty import (
    StepReport,
    combination,
    cross_information,
    judge,
    norm_se,
    numerical_jacobian,
    standard_errors,
    window_covariance,
    window_normals,
    windows,
)
from estimator.signals import find_holds
from estimator.so3 import rotvec_covariance
from rigid_body_data import GRAVITY, RATE, body_pose, low_passed_noise, make_body, make_data, moving, still
from test_statics import exact_grasps, exact_hold


def coloured(rng, colour, Q):
    if colour == "white":
        return rng.normal(size=Q)
    noise = low_passed_noise(rng, (Q, 1), 1.0)[:, 0]
    return np.gradient(noise, 1 / RATE) if colour == "blue" else noise


def regression(rng, colour):
    """A fit to coloured noise alone; returns it, our covariance and the textbook one."""
    Q = 2000
    t = np.arange(Q) / RATE
    X = np.stack([np.sin(3.0 * t), np.cos(2.2 * t), np.sin(4.1 * t + 1)], axis=1)
    noise = coloured(rng, colour, Q)
    theta, *_ = np.linalg.lstsq(X, noise, rcond=None)
    r = noise - X @ theta
    ours = window_covariance(*window_normals(X[:, None], r[:, None], windows(Q, RATE)))
    textbook = np.linalg.inv(X.T @ X) * (r @ r) / (Q - 3)
    return theta, np.diag(ours), np.diag(textbook)


@pytest.mark.parametrize("colour", ["white", "5 Hz", "blue"])
def test_covariance_of_a_short_fit_with_coloured_noise(colour):
    rng = np.random.default_rng(0)
    runs = [regression(rng, colour) for _ in range(500)]
    scatter = np.std([run[0] for run in runs], axis=0)
    claimed = np.sqrt(np.mean([run[1] for run in runs], axis=0))
    textbook = np.sqrt(np.mean([run[2] for run in runs], axis=0))
    assert np.all(np.abs(claimed / scatter - 1) < 0.15)
    wrong = textbook / scatter
    expected = {"white": (0.9, 1.1), "5 Hz": (0.2, 0.5), "blue": (1.1, 5.0)}[colour]
    assert np.all((expected[0] < wrong) & (wrong < expected[1]))  # why the textbook formula will not do


def test_few_windows_for_many_parameters():
    """Six seconds and eight parameters: what the fit takes away of the noise is given back."""
    rng = np.random.default_rng(1)
    t = np.arange(600) / RATE
    X = np.stack([np.sin(2 * np.pi * f * t + k) for k, f in enumerate(np.arange(1, 9) / 3.1)], axis=1)
    estimates, claims = [], []
    for _ in range(400):
        noise = low_passed_noise(rng, (600, 1), 1.0)[:, 0]
        theta, *_ = np.linalg.lstsq(X, noise, rcond=None)
        r = noise - X @ theta
        claims.append(np.diag(window_covariance(*window_normals(X[:, None], r[:, None], windows(600, RATE)))))
        estimates.append(theta)
    ratio = np.sqrt(np.mean(claims, axis=0)) / np.std(estimates, axis=0)
    assert np.all(np.abs(ratio - 1) < 0.2), ratio
    assert abs(np.mean(ratio) - 1) < 0.08  # 0.81 without the correction


def test_numerical_jacobian():
    A = np.arange(6.0).reshape(2, 3)
    J = numerical_jacobian(lambda x: A @ x + (x @ x) * np.ones(2), np.array([1.0, -2.0, 0.5]))
    np.testing.assert_allclose(J, A + 2 * np.array([1.0, -2.0, 0.5]), atol=1e-8)
    assert numerical_jacobian(lambda x: A[0], np.zeros(0)).shape == (3, 0)


@pytest.mark.parametrize("angle", [0.0, 1e-8, 0.3, 2.0, 3.0])
def test_covariance_of_a_rotation_vector(angle):
    R = Rotation.from_rotvec(angle * np.array([0.6, 0.0, 0.8]))
    rng = np.random.default_rng(1)
    root = rng.normal(0, 0.005, (3, 3))
    samples = (Rotation.from_rotvec(rng.normal(size=(20000, 3)) @ root.T) * R).as_matrix()
    claimed = np.sqrt(np.diag(rotvec_covariance(R.as_matrix(), root @ root.T)))
    np.testing.assert_allclose(np.std(Rotation.from_matrix(samples).as_rotvec(), axis=0), claimed, rtol=0.05)


def noisy(data, rng, angular, linear, force):
    """A copy with low-passed noise in rates, velocities and wrenches, as filtered sensors have."""
    Q, N = data.samples, data.robots
    e = low_passed_noise(rng, (Q, N, 6), 1.0) * np.repeat([angular, linear], 3)
    f = low_passed_noise(rng, (Q, N, 6), force) * np.repeat([0.2, 1.0], 3)
    return replace(
        data,
        twist=data.twist + e,
        twist_dot=data.twist_dot + np.gradient(e, 1 / data.rate_hz, axis=0),
        wrench=data.wrench + f,
    )


def summary(grasps, mass, com, inertia):
    """Everything reported, with its claimed standard error."""
    values, errors = [mass.mass, *com.p_1c], [mass.se, *np.sqrt(np.diag(com.covariance)[1:])]
    for i, j in ((1, 2), (2, 3), (3, 1)):
        pair = grasps.pair(i, j)
        values += [*pair.axis_angle_rad, *pair.p_ij, np.linalg.norm(pair.p_ij)]
        errors += [*pair.axis_angle_se_rad, *pair.p_se_m, pair.distance_se_m]
    values += [np.linalg.norm(com.p_1c)]
    errors += [norm_se(com.p_1c, com.covariance[1:, 1:])]
    order = ([0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2])
    values += [*inertia.inertia[order], *inertia.principal.moments, *inertia.principal.axis_angle_rad]
    errors += [*np.sqrt(np.diag(inertia.covariance)), *inertia.principal.moments_se]
    errors += [*inertia.principal.axis_angle_se_rad]
    return values, errors


@pytest.mark.slow
@pytest.mark.parametrize("dominant", ["encoders", "torques"])
def test_every_standard_error_against_the_scatter(dominant):
    """The whole chain, staged and joint, 110 repetitions: claimed within a quarter of the scatter.

    Noise of the rates, or of the forces, dominates in turn, so that no part of the propagation can hide.
    """
    body = make_body(3)
    motion = moving(body, 24)
    holds = still(body, [(0, 0), (0.08, 0), (-0.08, 0), (0, 0.08), (0, -0.08)], seconds=7.5, travel=1.5)
    noise = (1e-3, 2.5e-4, 0.005) if dominant == "encoders" else (2e-4, 5e-5, 0.1)
    runs = {"staged": [], "joint": []}
    for seed in range(110):
        rng = np.random.default_rng(seed)
        trial = noisy(motion, rng, *noise)
        grasps, _ = estimate_grasps([trial])
        found = find_holds(noisy(holds, rng, *noise))
        assert len(found) == 5
        mass = estimate_mass(found, GRAVITY)
        com, _ = estimate_com(found, mass, grasps, GRAVITY)
        upstream = com.own_covariance[1:, 1:], com.grasp_jacobian
        inertia, _ = estimate_inertia([trial], grasps, com.p_1c, upstream)
        runs["staged"].append(summary(grasps, mass, com, inertia))
        joint, _ = estimate_joint([trial], grasps)
        runs["joint"].append(summary(grasps, joint.mass, joint.com, joint.inertia))
    for method, results in runs.items():
        values, errors = np.array(results).transpose(1, 0, 2)
        ratio = np.sqrt(np.mean(errors**2, axis=0)) / np.std(values, axis=0, ddof=1)
        assert ratio.shape == (38,)
        assert np.all(ratio > 0.75), (method, np.round(ratio, 2))
        # Errors of the grasps leave moments that go with the tilt. Besides being propagated they count as
        # noise of the staged inertia: on the safe side, where the encoders' noise dominates.
        most = np.full(38, 1.25)
        if method == "staged" and dominant == "encoders":
            most[26:] = 1.5
        assert np.all(ratio < most), (method, np.round(ratio, 2))


NOISE = {"twist_noise": 1e-3, "linear_noise": 2e-4, "wrench_noise": 0.05}
NO_MOTION = {"angle_amplitude": (0, 0, 0), "shift_amplitude": (0, 0, 0)}


def about(axis, duration=20.0, **options):
    """Rotation about one axis of {1} only; axis is 0, 1 or 2."""
    amplitude = np.zeros(3)
    amplitude[axis] = 0.1
    return moving(make_body(3), duration, pose_options={"angle_amplitude": tuple(amplitude)}, **options)


@pytest.mark.parametrize("options", [{}, NOISE], ids=["exact", "noise"])
@pytest.mark.parametrize("shift", [0.0, 0.05])
def test_no_rotation_determines_no_grasp(options, shift):
    pose = {"angle_amplitude": (0, 0, 0), "shift_amplitude": (shift,) * 3}
    estimate, reports = estimate_grasps([moving(make_body(3), 20, pose_options=pose, **options)])
    assert estimate is None
    rotation = [report for report in reports if report.step.startswith("rotation")]
    assert len(rotation) == 2
    assert all(report.rank == 0 for report in rotation)


@pytest.mark.parametrize("options", [{}, NOISE], ids=["exact", "noise"])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_one_axis_leaves_that_axis_open(options, axis):
    estimate, reports = estimate_grasps([about(axis, **options)])
    assert estimate is None
    rotation = next(report for report in reports if report.step == "rotation R_12")
    position = next(report for report in reports if report.step == "position p_12")
    assert [weak.direction for weak in rotation.weak] == [f"about {'xyz'[axis]} of {{1}}"]
    assert rotation.rank == 2
    assert abs(rotation.weak[0].vector[axis]) > 0.99
    # Without noise in the velocities the position is open along the axis too; with it the test is on rates.
    if not options:
        assert [weak.direction for weak in position.weak] == [f"along {'xyz'[axis]} of {{1}}"]
        assert rotation.condition > 1e6


def test_two_axes_are_enough_for_the_grasps():
    data = moving(make_body(3), 20, pose_options={"angle_amplitude": (0.1, 0.1, 0)}, **NOISE)
    estimate, _ = estimate_grasps([data])
    assert estimate is not None


@pytest.mark.parametrize("amplitude", [1e-3, 1e-6])
def test_tiny_exact_motion_is_fine(amplitude):
    body = make_body(3)
    pose = {"angle_amplitude": (amplitude,) * 3, "shift_amplitude": (amplitude,) * 3}
    data = moving(body, 20, pose_options=pose)
    grasps, _ = estimate_grasps([data])
    assert grasps is not None
    np.testing.assert_allclose(grasps.p_1i, body.p_1i, atol=1e-7)
    inertia, _ = estimate_inertia([data], grasps, body.p_1c)
    np.testing.assert_allclose(inertia.inertia, body.inertia, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("N", [1, 3])
def test_noise_alone_has_no_inertia(N):
    body = make_body(N)
    data = moving(body, 20, pose_options=NO_MOTION, **NOISE)
    estimate, report = estimate_inertia([data], exact_grasps(body), body.p_1c)
    assert estimate is None
    assert report.weak


def test_one_axis_leaves_five_inertia_directions_partly_open():
    body = make_body(3)
    estimate, report = estimate_inertia([about(2, **NOISE)], exact_grasps(body), body.p_1c)
    assert estimate is None
    assert report.rank == 3  # Ixz, Iyz and Izz act on a rotation about z
    open_directions = np.array([weak.vector for weak in report.weak])
    np.testing.assert_allclose(np.abs(open_directions[:, [2, 4, 5]]), 0, atol=0.05)
    assert {"Ixx", "Ixy", "Iyy"} >= {
        name for weak in report.weak for name in weak.direction.split() if "I" in name
    }


@pytest.mark.parametrize(("N", "difference"), [(1, 0.0), (3, 0.0), (3, 1e-5)])
def test_two_holds_of_the_same_tilt_leave_the_vertical_open(N, difference):
    body, rng = make_body(N), np.random.default_rng(0)
    tilts = [
        Rotation.from_euler("zx", [yaw, roll]).as_matrix() for yaw, roll in ((0, 0.0), (1.0, difference))
    ]
    holds = [exact_hold(body, R, rng, bias=0.005, noise=0.02) for R in tilts]
    com, report = estimate_com(holds, estimate_mass(holds, GRAVITY), exact_grasps(body), GRAVITY)
    assert com is None
    assert [weak.direction for weak in report.weak] == ["along z of {1}"]
    assert "tilt" in report.weak[0].reason


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_two_holds_of_different_tilt_are_enough(noise):
    body, rng = make_body(3), np.random.default_rng(1)
    tilts = [Rotation.from_euler("x", roll).as_matrix() for roll in (0.0, 0.1)]
    holds = [exact_hold(body, R, rng, noise=noise) for R in tilts]
    com, report = estimate_com(holds, estimate_mass(holds, GRAVITY), exact_grasps(body), GRAVITY)
    assert report.determined
    assert np.linalg.norm(com.p_1c - body.p_1c) < 1e-10 + 0.3 * noise


def test_tilts_that_differ_less_than_the_robots_agree_do_not_count():
    body, rng = make_body(3), np.random.default_rng(2)
    holds = [exact_hold(body, R, rng) for R in (np.eye(3), Rotation.from_euler("x", 2e-3).as_matrix())]
    for hold in holds:
        hold.R_bi[:] = Rotation.from_rotvec(rng.normal(0, 3e-3, (3, 3))).as_matrix() @ hold.R_bi
    com, report = estimate_com(holds, estimate_mass(holds, GRAVITY), exact_grasps(body), GRAVITY)
    assert com is None
    assert report.noise > 3e-4


def test_cross_information_is_the_normal_matrix_of_the_cross_product():
    vectors = np.random.default_rng(0).normal(size=(30, 3))
    total = np.zeros((3, 3))
    for a in vectors:
        columns = np.column_stack([np.cross(a, e) for e in np.eye(3)])
        total += columns.T @ columns
    np.testing.assert_allclose(cross_information(vectors), total / 30)


def test_rounding_error_is_no_excitation():
    """One oblique axis without noise: the smallest eigenvalue is rounding error, of either sign."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        vectors = rng.normal(size=(100, 1)) * rng.normal(size=3)
        information = cross_information(vectors)
        assert judge("s", ("x", "y", "z"), information, 0.0, unit="", reason="").rank == 2


def test_judge_reports_values_rank_condition_and_words():
    report = judge("step", ("u", "v"), np.diag([4.0, 0.01]), 0.05, unit="m", reason="because")
    assert report.singular_values == pytest.approx((2.0, 0.1))
    assert report.condition == pytest.approx(20)
    assert report.rank == 1
    assert not report.determined
    (weak,) = report.weak
    assert weak.vector == pytest.approx((0, 1))
    assert str(weak) == "step, 1.00 v: because (signal 0.1 m, noise 0.05 m)"
    assert judge("step", ("u", "v"), np.diag([4.0, 0.01]), 0.03, unit="m", reason="").determined
    oblique = np.array([1, 1, 1]) / np.sqrt(3)
    information = np.eye(3) - np.outer(oblique, oblique)
    report = judge("step", ("x", "y", "z"), information, 0.1, unit="m", reason="", words="along", frame="{1}")
    assert report.weak[0].direction == "along (0.58, 0.58, 0.58) of {1}"


def test_holds_within_a_recording_are_no_motion():
    """Hours of standing still do not hide the motion between the holds, nor make up for none."""
    body = make_body(3)
    estimate, _ = estimate_grasps([still(body, [(0, 0), (0.08, 0), (0, 0.08)], **NOISE)])
    assert estimate is not None
    t = np.arange(round(20 * RATE)) / RATE
    data = make_data(body, body_pose(t, **NO_MOTION), t, **NOISE)
    assert estimate_grasps([data])[0] is None


def grasps(
    turn_deg: float = 0.0, shift_m: float = 0.0, sd: float = 0.0, sd_rad: float = 0.0
) -> GraspEstimate:
    """Three robots; the second is held a little otherwise."""
    R = Rotation.from_rotvec([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.5, 0.0, 0.0]]).as_matrix()
    p = np.array([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [1.5, 0.0, 0.0]])
    R[1] = R[1] @ Rotation.from_rotvec([0.0, np.deg2rad(turn_deg), 0.0]).as_matrix()
    p[1, 0] += shift_m
    covariance = np.kron(np.eye(2), np.diag(np.r_[np.full(3, sd_rad**2), np.full(3, sd**2)]))
    return GraspEstimate(
        R, p, covariance, np.zeros((3, 3)), np.zeros((3, 3)), np.full(3, 0.1), np.full(3, 0.2)
    )


def disagree(*each: GraspEstimate) -> str | None:
    try:
        check_agreement([f"trial {k + 1}" for k in range(len(each))], each)
    except InputError as error:
        return str(error)
    return None


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"turn_deg": 4.9}, None),
        ({"turn_deg": 5.2}, "R_12 differs by 5 deg"),
        ({"shift_m": 0.149}, None),  # 5 cm and 5 cm per metre
        ({"shift_m": 0.151}, "p_12 differs by 0.15 m"),
        # Five standard errors: sqrt(3 + 3) times that of a component of either.
        ({"shift_m": 0.24, "sd": 0.02}, None),
        ({"shift_m": 0.25, "sd": 0.02}, "p_12 differs by 0.25 m"),
        ({"turn_deg": 12.0, "sd_rad": np.deg2rad(1.0)}, None),
        ({"turn_deg": 12.5, "sd_rad": np.deg2rad(1.0)}, "R_12 differs by 12 deg"),
    ],
)
def test_two_recordings_of_the_same_grasps(other: dict[str, float], said: str | None) -> None:
    errors = {name: value for name, value in other.items() if name.startswith("sd")}
    found = disagree(grasps(**errors), grasps(**other))
    about = f"trial 1 and trial 2 disagree with each other about the grasps ({said}); are they of the same payload"
    assert found == (said and f"{about} and grasps?")


def test_the_recording_that_stands_out_is_named() -> None:
    found = disagree(grasps(), grasps(), grasps(turn_deg=20.0))
    assert found is not None
    assert found.startswith(
        "trial 3 disagrees with the other recordings about the grasps (R_12 differs by 20 deg); are"
    )


@pytest.mark.parametrize(("i", "j"), [(1, 2), (1, 3), (2, 3)])
def test_exchanged_robots_are_named(i: int, j: int) -> None:
    order = np.arange(3)
    order[[i - 1, j - 1]] = order[[j - 1, i - 1]]
    plain = grasps()
    R, p = plain.R_1i[order], plain.p_1i[order]
    exchanged = replace(plain, R_1i=R[0].T @ R, p_1i=(p - p[0]) @ R[0])
    found = disagree(plain, exchanged, plain)
    assert found is not None
    assert found.startswith("trial 2 disagrees with the other recordings about the grasps (")
    assert found.endswith(f"as if the columns of robots {i} and {j} were exchanged")


def rigid(angular: float = 0.0, linear: float = 0.0, moving_mps: float = 0.2) -> list[str]:
    """Robots 1 and 3 leave something of their twists unexplained."""
    residuals = np.zeros((2, 3, 3))
    residuals[0, [0, 2], [2, 0]], residuals[1, [0, 2], [2, 0]] = angular, linear
    found = replace(
        grasps(), angular_residual_rms=residuals[0], linear_residual_rms=residuals[1],
        linear_motion_rms=np.full(3, moving_mps),
    )  # fmt: skip
    return check_rigid("trial", found)


def test_twists_of_one_rigid_body() -> None:
    """Beyond a tenth of 0.1 rad/s and of 0.2 m/s a flag, beyond a half an error."""
    assert rigid() == rigid(angular=0.0099) == rigid(linear=0.0199) == []
    said = "trial: robots 1 and 3 do not move like one rigid body ({} % of their motion is unexplained)"
    assert rigid(angular=0.0103) == rigid(linear=0.0206) == [said.format(10) + "."]
    assert rigid(angular=0.049) == rigid(linear=0.098) == [said.format(49) + "."]
    for errors in ({"angular": 0.051}, {"linear": 0.102}):
        with pytest.raises(
            InputError, match=r"rigid body \(51 % of their motion .*check their columns and units"
        ):
            rigid(**errors)
    # Where the first frame hardly moves, its distance of 1.5 m turns: 0.15 m/s.
    assert rigid(linear=0.0149, moving_mps=0.01) == []
    assert rigid(linear=0.0153, moving_mps=0.01) == [said.format(10) + "."]
    still = replace(grasps(), angular_motion_rms=np.zeros(3), linear_motion_rms=np.zeros(3))
    assert check_rigid("trial", still) == []


def test_what_robots_at_rest_disagree_by() -> None:
    """Encoder noise below 1 cm/s and the like is want of motion, and more is not."""

    def step(name: str, noise: float, unit: str) -> StepReport:
        return StepReport(name, ("x",), unit, (0.0,), noise, ())

    from estimator.signals import STILL_RATE_RADPS, STILL_SPEED_MPS

    for name, unit, limit in (
        ("rotation R_13", "rad/s per rad", STILL_RATE_RADPS), ("position p_13", "m/s per m", STILL_SPEED_MPS),
    ):  # fmt: skip
        check_disagreement_is_noise("trial", [step(name, 0.99 * limit, unit)])
        with pytest.raises(
            InputError, match=rf"robots 1 and 3 .* by {1.01 * limit:.2g} {unit.split(' per')[0]} rms"
        ):
            check_disagreement_is_noise("trial", [step(name, 1.01 * limit, unit)])


@pytest.mark.parametrize(
    ("force", "moment", "flags"),
    [
        (0.049, 0.099, []),
        (0.0512, None, ["5 % of its weight"]),
        (0.3, 0.101, ["30 % of its weight", "0.1 m elsewhere"]),
        (0.0, 0.25, ["0.25 m elsewhere"]),
    ],
)
def test_balance_of_wrenches(force: float, moment: float | None, flags: list[str]) -> None:
    """A twentieth of the weight, and of it times the grasps' span of 2 m."""
    found = balance_flags("trial", force, moment, grasps())
    assert len(found) == len(flags)
    assert all(flag in said for flag, said in zip(flags, found, strict=True))


def test_the_lever_of_one_robot_is_a_metre() -> None:
    assert balance_flags("trial", 0.0, 0.049, single_robot()) == []
    assert len(balance_flags("trial", 0.0, 0.051, single_robot())) == 1
    values = single_robot().to_dict()
    assert values.pop("pairs") == values.pop("covariance") == []
    assert values.pop("angular_motion_radps") == values.pop("linear_motion_mps") == [0.0]
    assert values == {"angular_residual_radps": [[0.0]], "linear_residual_mps": [[0.0]]}


def test_balance_of_what_is_known() -> None:
    """Exact wrenches leave nothing over; a mass or a centre of mass that is off leaves what it is off by."""
    body = make_body(3)
    data, held = moving(body, 20), exact_grasps(body)
    inertia, _ = estimate_inertia([data], held, body.p_1c)
    assert inertia is not None
    force, moment = wrench_balance(data, held, body.mass, body.p_1c, inertia)
    assert force < 1e-6
    assert moment is not None
    assert moment < 1e-6
    heavier, without = wrench_balance(data, held, body.mass / 0.9, body.p_1c, None)
    assert heavier == pytest.approx(0.1, rel=0.01)  # of the weight that was assumed
    assert without is None
    off = body.p_1c + np.array([0.0, 0.02, 0.0])
    _, moment = wrench_balance(data, held, body.mass, off, inertia)
    assert moment is not None
    assert 0.017 < moment < 0.0202  # the lever's part across gravity


# What is determined


def judged(values: list[float], noise: float, **options: float) -> StepReport:
    return judge(
        "step", ("a", "b", "c"), np.diag(np.square(values)), noise, unit="N", reason="why", **options
    )


def test_three_times_the_noise_is_determined() -> None:
    assert judged([1.0, 0.5, 0.301], 0.1).rank == 3
    assert judged([1.0, 0.5, 0.299], 0.1).rank == 2
    assert judged([1.0, 0.5, 0.3], 0.0, floor=0.31).rank == 2
    assert judged([1.0, 1e-7, 2e-8], 0.0).rank == 2  # no digits are left of the last
    assert judged([1.0, 0.5, 0.0], 0.0).condition == float("inf")
    assert judged([1.0, 0.5, 0.0], 0.0).to_dict()["condition"] is None
    assert judged([1.0, 0.5, 0.25], 0.0).to_dict()["condition"] == pytest.approx(4.0)


def test_a_direction_in_words() -> None:
    assert combination(np.array([-0.6, 0.8, 0.0]), "abc") == "0.80 b -0.60 a"
    assert combination(np.array([0.29, 0.31, -0.905]), "abc") == "-0.91 c +0.31 b"

    def words(vector: list[float]) -> str:
        unit = np.array(vector) / np.linalg.norm(vector)
        report = judge(
            "step",
            "xyz",
            np.eye(3) - np.outer(unit, unit),
            0.1,
            unit="m",
            reason="why",
            words="along",
            frame="{1}",
        )
        return report.weak[0].direction

    assert words([0.0, -1.0, np.tan(np.deg2rad(9.5))]) == "along y of {1}"
    assert words([0.15, -1.0, 0.11]) == "along (-0.15, 0.98, -0.11) of {1}"  # 10.5 degrees off it


# Standard errors


@pytest.mark.parametrize("samples", [200, 3000])
@pytest.mark.parametrize("first", [0, 70])
def test_windows_weigh_all_samples_alike(samples: int, first: int) -> None:
    sums, squares = np.zeros(samples + first), np.zeros(samples + first)
    for window in windows(samples, 100.0, first=first):
        sums[window.part] += window.weights
        squares[window.part] += window.weights**2
    assert np.all(sums[:first] == 0.0)
    np.testing.assert_allclose(sums[first:], 2.0)
    np.testing.assert_allclose(squares[first:], 1.5)


def test_windows_are_four_seconds_or_a_sixth() -> None:
    assert max(len(window.weights) for window in windows(3000, 100.0)) == 400
    assert max(len(window.weights) for window in windows(1200, 100.0)) == 200


def test_errors_of_lengths() -> None:
    covariance = np.diag([4.0, 9.0, 16.0])
    assert norm_se(np.array([0.0, 0.0, 2.0]), covariance) == pytest.approx(4.0)
    assert norm_se(np.array([3.0, 4.0, 0.0]), covariance) == pytest.approx(np.sqrt(0.36 * 4 + 0.64 * 9))
    assert norm_se(np.zeros(3), covariance) == pytest.approx(np.sqrt(29.0))
    np.testing.assert_allclose(standard_errors(np.diag([4.0, -1e-20])), [2.0, 0.0])


def test_an_inertia_whose_errors_are_large_is_not_told() -> None:
    body = make_body(3)
    held, reasons = exact_grasps(body), {}
    for noise_N in (1.0, 2.0, 6.0):
        found, report = estimate_inertia([moving(body, 6, wrench_noise=noise_N)], held, body.p_1c)
        assert (found is None) == bool(report.weak)
        reasons[noise_N] = {weak.reason.partition(" (")[0] for weak in report.weak}
    assert reasons == {
        1.0: set(),
        2.0: {"its standard error is as large as a third of the inertia"},
        6.0: {"the moments do not follow the motion"},
    }


def test_noise_of_one_hold_is_that_within_it() -> None:
    """Moments of force errors at the grasps; the mean over many draws, in closed form."""
    body = make_body(3)
    held, noise = exact_grasps(body), []
    for seed in range(60):
        hold = exact_hold(body, np.eye(3), np.random.default_rng(seed), noise=0.02)
        mass = estimate_mass([hold], GRAVITY)
        _, report = estimate_com([hold], mass, held, GRAVITY)
        noise.append(report.noise * mass.mass * GRAVITY)
    expected = np.sum(2.0 * np.sum(body.p_1i**2, axis=1)) * 0.02**2 / len(hold.batches) / 3.0
    assert np.mean(np.square(noise)) == pytest.approx(expected, rel=0.12)


def test_standard_error_of_a_length():
    covariance = np.diag([0.01, 0.04, 0.09])
    assert norm_se(np.array([0.0, 5.0, 0.0]), covariance) == pytest.approx(0.2)
    assert norm_se(np.array([3.0, 4.0, 0.0]), covariance) == pytest.approx(np.sqrt(0.36 * 0.01 + 0.64 * 0.04))
    assert norm_se(np.zeros(3), covariance) > 0


def test_norm_se_of_next_to_nothing():
    """Rounding can make the variance of the distance of two identical robots negative."""
    assert norm_se(np.array([1.0, 0.0, 0.0]), np.diag([-1e-30, 1.0, 1.0])) == 0.0

"""How much recordings of one payload may differ, number by number: grasps and residuals made by hand."""

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
)  # fmt: skip
from estimator.estimate.grasps import GraspEstimate, single_robot
from estimator.estimate.inertia import estimate_inertia
from estimator.estimate.statics import estimate_com, estimate_mass
from estimator.estimate.uncertainty import StepReport, combination, judge, norm_se, standard_errors, windows
from rigid_body_data import GRAVITY, make_body, moving
from test_statics import exact_grasps, exact_hold


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
    assert judged([1.0, 0.5, 0.3], 0.1, factor=2.0).rank == 3
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

"""The pipeline: methods, wrong data, undetermined data, JSON, report."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.errors import InputError
from estimator.estimate.consistency import Trial
from estimator.estimate.payload import (
    Method,
    estimate_from_trials,
    estimate_payload,
)
from estimator.estimate.result import PayloadEstimate, format_estimate
from estimator.signals import GraspData
from recorded_team import COM, GRASPS, INERTIA, MASS, Sines, carry
from rigid_body_data import make_body, moving, still

NOISE = {"twist_noise": 3e-4, "linear_noise": 1e-4, "wrench_noise": 0.05}
TILTS = [(0, 0), (0.08, 0), (-0.08, 0), (0, 0.08), (0, -0.08), (0.05, 0.05)]
BODY = make_body(3)


def trial(kind, data=None, name=None, payload="box", seed=1, body=BODY):
    if data is None:
        data = still(body, TILTS, **NOISE) if kind == "static" else moving(body, 40, seed=seed, **NOISE)
    return Trial(name or f"{kind}{seed}", kind, payload, data)


def team(body=BODY):
    return [
        trial("random", seed=1, body=body),
        trial("periodic", seed=2, body=body),
        trial("static", seed=3, body=body),
    ]


def exchanged(data, i, j, what=("R_bi", "p_bi", "twist", "twist_dot", "wrench")):
    order = np.arange(data.robots)
    order[[i, j]] = order[[j, i]]
    return replace(data, **{name: getattr(data, name)[:, order] for name in what})


def assert_true(estimate, body=BODY, sigmas=5.0):
    assert abs(estimate.mass.mass - body.mass) < sigmas * estimate.mass.se
    assert np.all(np.abs(estimate.p_1c - body.p_1c) < sigmas * estimate.p_1c_se_m)
    moments, se = estimate.inertia.principal.moments, estimate.inertia.principal.moments_se
    assert np.all(np.abs(moments - np.linalg.eigvalsh(body.inertia)) < sigmas * se)
    assert np.all(se < 0.02 * moments)
    np.testing.assert_allclose(estimate.grasps.p_1i, body.p_1i, atol=1e-3)


# ---- methods ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("N", [1, 2, 3, 5])
@pytest.mark.parametrize("method", ["auto", "joint"])
def test_any_number_of_robots(N, method):
    body = make_body(N)
    estimate = estimate_from_trials(team(body), method)
    assert estimate.method == ("staged" if method == "auto" else "joint")
    assert_true(estimate, body)
    assert estimate.flags == ()
    assert estimate.undetermined == ()
    assert [r.holds for r in estimate.recordings] == [0, 0, 6]
    assert [r.inertia is None for r in estimate.recordings] == [False, False, True]
    assert estimate.payload == "box"
    assert estimate.robots == N


def test_without_holds_the_estimate_is_joint():
    estimate = estimate_from_trials(team()[1:2])
    assert estimate.method == "joint"
    assert_true(estimate)
    with pytest.raises(InputError, match="static holds"):
        estimate_from_trials(team()[:2], "staged")


def test_one_hold_leaves_the_rest_to_the_joint_method():
    estimate = estimate_from_trials([team()[0], trial("static", still(BODY, TILTS[:1], **NOISE))])
    assert estimate.method == "joint"
    assert_true(estimate)


def test_holds_alone_give_mass_and_centre_of_mass_by_the_motion_between_them():
    estimate = estimate_from_trials([team()[2]])
    assert estimate.method == "staged"
    assert abs(estimate.mass.mass - BODY.mass) < 5 * estimate.mass.se
    assert np.linalg.norm(estimate.p_1c - BODY.p_1c) < 5 * np.linalg.norm(estimate.p_1c_se_m)


def test_joint_signals_pass_through_the_whole_chain():
    rng = np.random.default_rng(0)
    path = Sines.draw(rng, [*np.deg2rad([3.5, 3.5, 3.5]), 0.01, 0.01, 0.01], 3, 0.3, 0.7)
    carried = carry(path, Sines.draw(rng, [5.0] * 3, 8, 0.1, 1.5), 40.0)
    estimate = estimate_payload([carried.recording])
    assert estimate.mass.mass == pytest.approx(MASS, rel=1e-3)
    np.testing.assert_allclose(estimate.p_1c, COM, atol=1e-3)
    np.testing.assert_allclose(estimate.inertia.inertia, INERTIA, atol=0.02)
    for k, (R_1i, p_1i) in enumerate(GRASPS):
        np.testing.assert_allclose(estimate.grasps.R_1i[k], R_1i, atol=1e-5)
        np.testing.assert_allclose(estimate.grasps.p_1i[k], p_1i, atol=1e-4)


# ---- data that do not determine everything ------------------------------------------------------------------


def still_trial(seed=0, **options):
    return Trial("rest", "static", None, still(BODY, [(0.0, 0.0)], seconds=10.0, **(NOISE | options)))


def test_no_motion_leaves_the_mass():
    estimate = estimate_from_trials([still_trial()])
    assert abs(estimate.mass.mass - BODY.mass) < 0.01
    assert estimate.grasps is None
    assert estimate.p_1c is None
    assert estimate.inertia is None
    steps = {weak.step for weak in estimate.undetermined}
    assert {"rotation R_12", "rotation R_13"} <= steps
    assert "not determined" in format_estimate(estimate)


# ---- data that are wrong ------------------------------------------------------------------------------------


def test_mixed_payloads_and_teams_are_errors():
    with pytest.raises(InputError, match=r"b is of payload 'y' and a of 'x'"):
        estimate_from_trials([trial("random", name="a", payload="x"), trial("random", name="b", payload="y")])
    two = trial("random", name="b", body=make_body(2))
    with pytest.raises(InputError, match="b has 2 robots and a has 3"):
        estimate_from_trials([trial("random", name="a"), two])
    other = replace(trial("random").data, gravity_mps2=1.62)
    with pytest.raises(InputError, match="gravity"):
        estimate_from_trials([trial("random", name="a"), trial("random", other, name="b")])


@pytest.mark.parametrize("which", [0, 1, 2])
def test_exchanged_robots_in_one_of_three_recordings_are_named(which):
    trials = team()
    trials[which] = replace(trials[which], data=exchanged(trials[which].data, 0, 2))
    message = f"{trials[which].name} disagrees with the other.*robots 1 and 3 were exchanged"
    with pytest.raises(InputError, match=message):
        estimate_from_trials(trials)


def test_another_payload_under_the_same_name_is_an_error():
    trials = [*team(), trial("random", name="intruder", body=make_body(3, seed=9))]
    with pytest.raises(InputError, match=r"intruder disagrees.*same payload and grasps"):
        estimate_from_trials(trials)


def test_a_heavier_payload_in_the_same_grasps_shows_only_where_masses_are_compared():
    heavier = replace(BODY, mass=1.2 * BODY.mass, inertia=1.2 * BODY.inertia)
    trials = [trial("random", payload=None), trial("static", payload=None, name="other", body=heavier)]
    assert estimate_from_trials(trials).mass is None  # the forces do not add up to one payload
    assert estimate_from_trials(trials, withhold=False).mass is not None
    low, high = BODY.mass, 1.2 * BODY.mass
    message = (
        rf"^random1 says {low:.1f}\d kg and other says {high:.1f}\d kg; recordings must be of one payload"
    )
    with pytest.raises(InputError, match=message):
        estimate_from_trials(trials, compare_masses=True)


def test_an_exchange_in_the_only_recording_is_a_renumbering():
    data = exchanged(team()[1].data, 1, 2)
    estimate = estimate_from_trials([Trial("x", "periodic", None, data)])
    straight = estimate_from_trials([Trial("x", "periodic", None, team()[1].data)])
    np.testing.assert_allclose(estimate.grasps.p_1i[[0, 2, 1]], straight.grasps.p_1i, atol=1e-8)
    np.testing.assert_allclose(estimate.inertia.inertia, straight.inertia.inertia, atol=1e-6)


def test_a_loose_grasp_is_flagged():
    data = team()[0].data
    rng = np.random.default_rng(0)
    wobble = np.zeros((data.samples, 3))
    for f in (0.9, 1.3):
        wobble += 0.04 * np.sin(2 * np.pi * f * data.time[:, None] + rng.uniform(0, 6, 3))
    data.twist[:, 2, 3:] += wobble
    estimate = estimate_from_trials([Trial("loose", "random", None, data), team()[2]])
    assert any("robots 1 and 3 do not move like one rigid body" in flag for flag in estimate.flags)
    assert not any("robots 1 and 2" in flag for flag in estimate.flags)


def wrong_wrench(data, change):
    wrench = data.wrench.copy()
    change(wrench)
    return replace(data, wrench=wrench)


def flip(wrench):
    wrench[:, 2] *= -1


def swap(wrench):
    wrench[:, [1, 2]] = wrench[:, [2, 1]]


@pytest.mark.parametrize("change", [flip, swap])
def test_wrong_torques_in_one_recording_are_flagged_there(change):
    trials = team()
    trials[0] = replace(trials[0], data=wrong_wrench(trials[0].data, change))
    estimate = estimate_from_trials(trials)
    flagged = [flag for flag in estimate.flags if "forces do not add up" in flag]
    assert flagged
    assert all(flag.startswith("random1") for flag in flagged)


def test_all_torques_reversed_is_an_error():
    def reverse(wrench):
        wrench *= -1

    with pytest.raises(InputError, match="check the sign of the torques"):
        estimate_from_trials([replace(t, data=wrong_wrench(t.data, reverse)) for t in team()])


# ---- JSON and report ----------------------------------------------------------------------------------------


def everything(value):
    if isinstance(value, dict):
        for item in value.values():
            yield from everything(item)
    elif isinstance(value, list):
        for item in value:
            yield from everything(item)
    else:
        yield value


def assert_same(a, b):
    if isinstance(a, dict):
        assert a.keys() == b.keys()
        for key in a:
            assert_same(a[key], b[key])
    elif isinstance(a, list):
        assert len(a) == len(b)
        for x, y in zip(a, b, strict=True):
            assert_same(x, y)
    elif isinstance(a, float):
        assert a == pytest.approx(b, rel=1e-9, abs=1e-12)
    else:
        assert a == b


@pytest.mark.parametrize("trials", [team, lambda: [still_trial()]], ids=["full", "mass only"])
def test_json_round_trip_is_strict_and_complete(trials):
    estimate = estimate_from_trials(trials())
    values = estimate.to_dict()
    text = json.dumps(values, allow_nan=False)
    leaves = list(everything(values))
    assert len(leaves) > 20
    assert all(type(leaf) in (str, int, float, bool, type(None)) for leaf in leaves)
    assert all(math.isfinite(leaf) for leaf in leaves if isinstance(leaf, float))
    again = PayloadEstimate.from_dict(json.loads(text))
    assert_same(again.to_dict(), values)
    assert again.flags == estimate.flags
    assert again.undetermined == estimate.undetermined


def test_json_keys_and_units():
    values = estimate_from_trials(team()).to_dict()
    assert values["mass"].keys() == {"m_kg", "m_se_kg", "residual_N"}
    pair = values["grasps"]["pairs"][2]
    assert (pair["i"], pair["j"]) == (2, 3)
    np.testing.assert_allclose(pair["p_m"], BODY.R_1i[1].T @ (BODY.p_1i[2] - BODY.p_1i[1]), atol=1e-3)
    assert pair["distance_m"] == pytest.approx(np.linalg.norm(pair["p_m"]))
    angle = np.linalg.norm(pair["R_axis_angle_deg"])
    assert np.cos(np.deg2rad(angle)) == pytest.approx(
        (np.trace(BODY.R_1i[1].T @ BODY.R_1i[2]) - 1) / 2, abs=1e-3
    )
    inertia = values["inertia"]
    np.testing.assert_allclose(inertia["I_b_kgm2"], BODY.inertia, atol=0.05)
    np.testing.assert_allclose(inertia["R_1c_axis_angle_deg"], [1.0, -2.0, 30.0], atol=0.5)
    assert [r["trial"] for r in values["recordings"]] == ["random", "periodic", "static"]


@pytest.mark.parametrize(
    "spoil",
    [
        lambda d: d.update(format="other"),
        lambda d: d.update(version=2),
        lambda d: d.pop("mass"),
        lambda d: d["inertia"].pop("principal_kgm2"),
        lambda d: d["grasps"].update(covariance=[1.0]),
    ],
    ids=["format", "version", "mass", "principal", "covariance"],
)
def test_a_spoilt_estimate_is_an_error(spoil):
    values = estimate_from_trials(team()[:1]).to_dict()
    spoil(values)
    with pytest.raises(InputError, match="estimate"):
        PayloadEstimate.from_dict(values)


def test_report_shows_values_errors_and_doubts():
    estimate = estimate_from_trials(team())
    text = format_estimate(estimate)
    for part in (
        "[[Payload (box)]]",
        "p_23 z:",
        "|p_12|:",
        "Ixy in {b}:",
        "principal 3:",
        "R_1c z:",
        "kg m^2",
    ):
        assert part in text
    line = next(line for line in text.splitlines() if line.strip().startswith("m:"))
    value, error = line.split()[1], line.split()[3]
    assert float(value) == pytest.approx(estimate.mass.mass, abs=float(error))
    assert float(error) == pytest.approx(estimate.mass.se, rel=0.1)
    assert "[[Flags]]" not in text
    assert "[[Not determined]]" in format_estimate(estimate_from_trials([still_trial()]))


@cache
def whole():
    """Three exact robots that squeeze the payload while they turn it."""
    rng = np.random.default_rng(11)
    path = Sines.draw(rng, np.r_[np.full(3, 0.06), np.full(3, 0.02)], 3, 0.2, 0.8)
    return carry(path, Sines.draw(rng, np.full(3, 8.0), 3, 0.2, 0.8), 14.0).recording


def part(robots, control=None):
    recording = whole()
    channels = {name: getattr(recording, name)[:, robots] for name in ("phi", "theta", "tau")}
    metadata = replace(recording.metadata, robots=len(robots), control=control)
    return replace(recording, **channels, metadata=metadata)


def nothing_told(estimate):
    return estimate.mass is estimate.p_1c is estimate.inertia is None


@pytest.mark.parametrize("robot", [0, 1, 2])
def test_one_of_three_robots_tells_no_mass(robot):
    estimate = estimate_payload([part([robot])])
    assert nothing_told(estimate)
    assert estimate.recordings[0].inertia is None
    assert estimate.flags[0].startswith(
        "Mass, centre of mass and inertia are withheld: the forces of this robot"
    )
    assert estimate.flags[0] in format_estimate(estimate)
    assert format_estimate(estimate).startswith("[[Payload]]  1 robot, ")
    assert "robots apart" not in format_estimate(estimate)
    assert estimate_payload([part([robot])], withhold=False).mass is not None


def test_a_lone_robot_that_carries_all_keeps_its_numbers():
    body = make_body(1)
    trial = Trial(
        "alone", "random", None, moving(body, 40, twist_noise=3e-4, linear_noise=1e-4, wrench_noise=0.05)
    )
    estimate = estimate_from_trials([trial])
    assert abs(estimate.mass.mass - body.mass) < 5 * estimate.mass.se


LITTLE_NOISE = {"twist_noise": 1e-4, "linear_noise": 2e-5, "wrench_noise": 0.05}
FOUR_TILTS = ((0.0, 0.0), (0.08, 0.0), (0.0, 0.08), (-0.06, 0.05))
METHODS: tuple[Method, ...] = ("joint", "staged")


@cache
def trials() -> tuple[GraspData, GraspData]:
    """Motion, and holds."""
    body = make_body(3)
    return moving(body, 14, seed=3, **LITTLE_NOISE), still(body, FOUR_TILTS, 7.0, seed=4, **LITTLE_NOISE)


def estimated(data: Sequence[GraspData], method: Method) -> PayloadEstimate:
    every = [Trial(f"trial {k}", "random", None, each) for k, each in enumerate(data)]
    return estimate_from_trials(every, method)


@cache
def plain(method: Method) -> PayloadEstimate:
    return estimated(trials(), method)


def same(
    found: PayloadEstimate,
    expected: PayloadEstimate,
    *,
    mass: float = 1.0,
    length: float = 1.0,
    rtol: float = 1e-5,
) -> None:
    """Equal in units of a mass and a length."""

    def close(a: object, b: object, factor: float = 1.0) -> None:
        b = factor * np.asarray(b)
        np.testing.assert_allclose(a, b, rtol=rtol, atol=rtol * float(np.abs(b).max()))

    for estimate in (found, expected):
        assert estimate.mass is not None
        assert estimate.inertia is not None
        assert estimate.p_1c_se_m is not None
        assert estimate.grasps is not None
    assert found.method == expected.method
    close(found.mass.mass, expected.mass.mass, mass)
    close(found.mass.se, expected.mass.se, mass)
    close(found.p_1c, expected.p_1c, length)
    close(found.p_1c_se_m, expected.p_1c_se_m, length)
    close(found.inertia.inertia, expected.inertia.inertia, mass * length**2)
    close(found.inertia.covariance, expected.inertia.covariance, mass**2 * length**4)
    close(found.grasps.R_1i, expected.grasps.R_1i)
    close(found.grasps.p_1i, expected.grasps.p_1i, length)
    scale = np.tile(np.repeat([1.0, length], 3), found.robots - 1)
    close(found.grasps.covariance / np.outer(scale, scale), expected.grasps.covariance)
    assert [step.step for step in found.steps] == [step.step for step in expected.steps]
    assert [step.rank for step in found.steps] == [step.rank for step in expected.steps]
    for a, b in zip(found.recordings, expected.recordings, strict=True):
        assert a.holds == b.holds
        close(a.force_residual, b.force_residual)
        assert (a.moment_residual_m is None) == (b.moment_residual_m is None)
        if a.moment_residual_m is not None:
            close(a.moment_residual_m, b.moment_residual_m, length)


@pytest.mark.parametrize("method", METHODS)
def test_bases_that_stand_elsewhere(method: Method) -> None:
    turn = Rotation.from_rotvec([[0.0, 0.0, 2.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.5]]).as_matrix()
    data = [
        replace(each, R_bi=turn @ each.R_bi, p_bi=(turn @ each.p_bi[..., None])[..., 0] + [1.0, -2.0, 0.3])
        for each in trials()
    ]
    same(estimated(data, method), plain(method))


@pytest.mark.parametrize("method", METHODS)
def test_forces_in_other_units(method: Method) -> None:
    data = [replace(each, wrench=1.5 * each.wrench) for each in trials()]
    # Holds begin and end by newtons.
    same(estimated(data, method), plain(method), mass=1.5, rtol=1e-5 if method == "joint" else 0.05)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("order", [(0, 2, 1), (1, 0, 2)])
def test_robots_with_other_numbers(method: Method, order: tuple[int, ...]) -> None:
    at = list(order)
    data = [
        replace(
            each, R_bi=each.R_bi[:, at], p_bi=each.p_bi[:, at], twist=each.twist[:, at],
            twist_dot=each.twist_dot[:, at], wrench=each.wrench[:, at],
        )
        for each in trials()
    ]  # fmt: skip
    found, expected = estimated(data, method), plain(method)
    assert found.grasps is not None
    assert expected.grasps is not None
    assert found.mass is not None
    assert expected.mass is not None
    assert found.p_1c is not None
    assert expected.p_1c is not None
    rtol = 1e-5 if order[0] == 0 else 0.05  # the linear part of twists is weighed in the frame of robot 1
    assert found.mass.mass == pytest.approx(expected.mass.mass, rel=1e-4)
    assert found.mass.se == pytest.approx(expected.mass.se, rel=rtol)
    for i in range(3):
        for j in range(3):
            if i != j:
                a, b = found.grasps.pair(i + 1, j + 1), expected.grasps.pair(at[i] + 1, at[j] + 1)
                np.testing.assert_allclose(a.p_ij, b.p_ij, atol=1e-4)
                np.testing.assert_allclose(a.R_ij, b.R_ij, atol=1e-4)
                np.testing.assert_allclose(a.p_se_m, b.p_se_m, rtol=max(rtol, 1e-4))
                np.testing.assert_allclose(a.axis_angle_se_rad, b.axis_angle_se_rad, rtol=max(rtol, 1e-4))
    first = expected.grasps
    c = first.R_1i[at[0]].T @ (expected.p_1c - first.p_1i[at[0]])
    np.testing.assert_allclose(found.p_1c, c, atol=1e-4)


def test_a_recording_in_two_parts() -> None:
    """Nothing but the edges of windows and of holds changes where the parts are given one by one."""
    (whole, _), half = trials(), trials()[0].samples // 2

    def part(rows: slice) -> GraspData:
        names = ("time", "R_bi", "p_bi", "twist", "twist_dot", "wrench")
        return replace(whole, **{name: getattr(whole, name)[rows] for name in names})

    found = estimated([part(slice(0, half)), part(slice(half, None))], "joint")
    expected = estimated([whole], "joint")
    assert found.mass is not None
    assert expected.mass is not None
    assert found.grasps is not None
    assert expected.grasps is not None
    assert found.mass.mass == pytest.approx(expected.mass.mass, rel=1e-9)
    np.testing.assert_allclose(found.grasps.p_1i, expected.grasps.p_1i, rtol=1e-9, atol=1e-9)
    assert found.p_1c == pytest.approx(expected.p_1c, rel=1e-6)
    assert 0.5 < found.mass.se / expected.mass.se < 2.0


@pytest.mark.parametrize(("rest_s", "tells"), [(9.0, True), (11.0, False)])
def test_recordings_at_rest_half_of_the_time_tell_no_inertia(rest_s: float, tells: bool) -> None:
    body = make_body(3)
    moves, rests = (
        moving(body, 10, seed=3, **LITTLE_NOISE),
        still(body, FOUR_TILTS[:1], rest_s, seed=4, **LITTLE_NOISE),
    )
    names = ("R_bi", "p_bi", "twist", "twist_dot", "wrench")
    both = {name: np.concatenate([getattr(moves, name), getattr(rests, name)]) for name in names}
    time = np.arange(len(both["twist"])) / moves.rate_hz
    found = estimated([*trials(), replace(moves, time=time, **both)], "staged")
    assert [record.inertia is not None for record in found.recordings] == [True, False, tells]
    assert [record.holds for record in found.recordings] == [0, 4, 1]

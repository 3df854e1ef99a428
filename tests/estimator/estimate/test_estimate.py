"""The pipeline: methods, wrong data, undetermined data, JSON, report."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from estimator.errors import InputError
from estimator.estimate.consistency import Trial
from estimator.estimate.payload import check_one_payload, estimate_from_trials, estimate_payload, mass_alone
from estimator.estimate.result import PayloadEstimate, format_estimate
from estimator.estimate.statics import MassEstimate
from estimator.signals import find_holds
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


def test_unknown_method():
    with pytest.raises(InputError, match="method is 'best'"):
        estimate_from_trials(team()[:1], "best")


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


def test_nothing_at_all_is_an_error():
    pose = {"angle_amplitude": (0.05, 0, 0)}
    data = moving(BODY, 20, pose_options=pose, **NOISE)
    with pytest.raises(InputError, match=r"nothing can be estimated.*about x of \{1\}"):
        estimate_from_trials([Trial("one axis", "random", None, data)], "auto")
    with pytest.raises(InputError, match="nothing can be estimated jointly"):
        estimate_from_trials([Trial("one axis", "random", None, data)], "joint")


def test_no_recording_is_an_error():
    with pytest.raises(InputError, match="no recording"):
        estimate_payload([])


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


def test_exchanged_robots_in_one_of_two_recordings_name_both():
    trials = team()[:2]
    trials[0] = replace(trials[0], data=exchanged(trials[0].data, 1, 2))
    with pytest.raises(InputError, match=r"random1 and periodic2 disagree.*robots 2 and 3 were exchanged"):
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


def test_one_payload_has_one_mass_by_each_recording_alone():
    """The mass that is compared is that of an estimate from the recording alone, to the last bit."""
    trials = [*team(), still_trial()]
    estimate = estimate_from_trials(trials, compare_masses=True)
    for one, record in zip(trials, estimate.recordings, strict=True):
        alone = estimate_from_trials([one])
        assert mass_alone(one.data, find_holds(one.data), record.grasps) == alone.mass


def test_masses_are_compared_by_share_and_by_error():
    def masses(*values):
        return [(f"r{k}", m and MassEstimate(*m, 0.0)) for k, m in enumerate(values)]

    check_one_payload(masses((10.0, 0.01), None, (10.49, 0.01)))
    check_one_payload(masses((10.0, 0.1), (11.1, 0.1)))
    check_one_payload(masses(None, None))
    with pytest.raises(
        InputError, match=r"^r2 says 10\.00 kg and r0 says 10\.60 kg; recordings must be of one"
    ):
        check_one_payload(masses((10.6, 0.01), None, (10.0, 0.01)))
    with pytest.raises(InputError, match=r"r0 says 10.00 kg and r1 says 11.30 kg"):
        check_one_payload(masses((10.0, 0.1), (11.3, 0.1)))


def test_an_exchange_in_the_only_recording_is_a_renumbering():
    data = exchanged(team()[1].data, 1, 2)
    estimate = estimate_from_trials([Trial("x", "periodic", None, data)])
    straight = estimate_from_trials([Trial("x", "periodic", None, team()[1].data)])
    np.testing.assert_allclose(estimate.grasps.p_1i[[0, 2, 1]], straight.grasps.p_1i, atol=1e-8)
    np.testing.assert_allclose(estimate.inertia.inertia, straight.inertia.inertia, atol=1e-6)


@pytest.mark.parametrize("channel", [slice(0, 3), slice(3, 6)], ids=["gimbal", "delta"])
def test_half_exchanged_columns_are_not_one_rigid_body(channel):
    data = team()[0].data
    twist = data.twist.copy()
    twist[:, [0, 1], channel] = twist[:, [1, 0], channel]
    with pytest.raises(InputError, match=r"random1: robots . and . do not move like one rigid body"):
        estimate_from_trials([replace(team()[0], data=replace(data, twist=twist))])


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


@pytest.mark.parametrize("change", [flip, swap])
def test_wrong_torques_everywhere_are_seen(change):
    estimate = estimate_from_trials([replace(t, data=wrong_wrench(t.data, change)) for t in team()])
    doubts = [*estimate.flags, *(str(weak) for weak in estimate.undetermined)]
    assert any("torques" in doubt for doubt in doubts)


def test_all_torques_reversed_is_an_error():
    def reverse(wrench):
        wrench *= -1

    with pytest.raises(InputError, match="check the sign of the torques"):
        estimate_from_trials([replace(t, data=wrong_wrench(t.data, reverse)) for t in team()])


def test_an_impossible_inertia_is_flagged():
    body = replace(BODY, inertia=np.diag([1.0, 1.5, 3.5]))
    estimate = estimate_from_trials(team(body))
    assert any("exceeds the sum" in flag for flag in estimate.flags)


def test_equal_moments_are_reported_without_axes():
    body = replace(BODY, inertia=np.diag([2.0, 2.0, 3.0]))
    estimate = estimate_from_trials(team(body))
    assert estimate.inertia.principal.R_1c is None
    assert any("axes are not determined" in flag for flag in estimate.flags)
    assert PayloadEstimate.from_dict(estimate.to_dict()).inertia.principal.R_1c is None
    assert "R_1c:" in format_estimate(estimate)


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


def test_recordings_of_the_same_name_are_told_apart():
    estimate = estimate_from_trials([trial("random", name="a", seed=1), trial("random", name="a", seed=2)])
    assert [r.name for r in estimate.recordings] == ["a", "a (2)"]


def test_no_percentages_of_what_may_be_zero():
    """A component may be zero where its vector is not, and a value within its error of zero has no share."""
    estimate = estimate_from_trials(team())
    lines = format_estimate(estimate).splitlines()
    components = [line for line in lines if line.split(":")[0].rsplit(" ", 1)[-1] in ("x", "y", "z")]
    assert len(components) > 15
    assert not any("%" in line for line in components)
    assert all("%" in line for line in lines if line.strip().startswith(("m:", "|p_")))
    doubtful = replace(estimate, mass=MassEstimate(0.02, 0.011, 0.0))
    (mass,) = (line for line in format_estimate(doubtful).splitlines() if line.strip().startswith("m:"))
    assert "0.020 +- 0.011 kg" in mass
    assert "%" not in mass

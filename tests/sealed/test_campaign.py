"""Sets of the sealed campaign and their scores."""

import os
from dataclasses import replace

import numpy as np
import pytest

from discrepancy.team.causes import CAUSES
from hidden import Schedule
from mocobot.campaign.summary import interval
from mocobot_sim.effects import EFFECTS
from scoring import log_score
from sealed import campaign, sets
from sealed.limits import BACKGROUNDS, LIMITS, limit_over_nominal, tolerated
from sealed.payload import MassDrift, MassOfTrials
from sealed.score import score
from sealed.sets import (
    CATALOGUE,
    FORMS,
    KINDS,
    LISTED,
    NOWHERE,
    OTHER,
    UNLISTED,
    family,
    generate,
    largest,
    plan,
)
from sealed.tables import misses, tables

TINY = Schedule(randoms=1, vias=1, periodic_s=None, hold_s=None)


def test_there_are_enough_forms_and_each_has_an_answer_or_a_law():
    assert len(UNLISTED) >= 14
    assert all(form.answer is not None for form in LISTED)
    assert all(form.answer is None for form in UNLISTED)
    assert set(LIMITS) == set(FORMS)
    assert not set(FORMS) & set(EFFECTS)
    assert {form.answer for form in LISTED} <= set(CAUSES)


def test_successive_seeds_hide_every_cause_once():
    for kind, pool in (("single", CATALOGUE), ("forms", OTHER), ("unlisted", NOWHERE)):
        first = len(pool) * 3
        names = [plan(kind, seed, "x1").names[0] for seed in range(first, first + len(pool))]
        assert sorted(names) == sorted(pool), kind


def test_plans_keep_to_what_can_be_hidden():
    for seed in range(60):
        for kind in KINDS:
            request = plan(kind, seed)
            assert request == plan(kind, seed)
            assert len({family(name) for name in request.names if name != "pushes"}) == len(
                [name for name in request.names if name != "pushes"]
            )
            for name, factor in zip(request.names, request.factors, strict=True):
                assert 2.0 <= factor <= 20.0
                assert factor <= largest(name, request.background)


def test_what_is_asked_for_by_name_is_as_large_as_a_trial_runs_with():
    """Where that is less than what is drawn otherwise."""
    most = largest("turning_grasp", "x10")
    assert most < 2.0
    assert plan("forms", 0, "x10", None, "turning_grasp").factors == (pytest.approx(most),)


def test_limits_follow_the_background():
    """A zero is limited by its tolerance, a slosh by noise alone."""
    assert [limit_over_nominal("phi_zero", b) for b in BACKGROUNDS] == pytest.approx(
        [1, 2.86, 9.4, 1], rel=0.05
    )
    assert [limit_over_nominal("slosh", b) for b in BACKGROUNDS] == [1.0] * 4
    x1, x3, x10, uncalibrated = (limit_over_nominal("payload_tether", b) for b in BACKGROUNDS)
    assert x1 < x3 < x10
    assert x1 < uncalibrated


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "parameter"), [("grasp_play", "contact_m_per_N"), ("base_compliance", "relaxation_s")]
)
def test_what_is_known_is_what_the_simulation_has(name, parameter):
    """A grasp gives way behind its play as it would without; a spring follows as its mass lets it."""
    _, truth = generate(replace(plan("single", 11, "x10", 2.0, name), schedule=TINY))
    (effect,) = truth["effects"]
    own = [e for e in truth["background"] if e["cause"] == "grasp_flex" and e["robot"] == effect["robot"]]
    assert effect["parameters"][parameter] == 0.0
    known = effect["answer"]["known"][parameter]
    if name == "grasp_play":
        assert known == own[0]["parameters"]["compliance_m_per_N"] > 0.0
    else:  # critically damped
        mass_kg = effect["answer"]["known"]["mass_kg"]
        stiffness = 1.0 / effect["parameters"]["compliance_m_per_N"]
        assert 36.0 < mass_kg < 200.0, "the robot's 35 kg, and the spring's own"
        assert known == pytest.approx(2.0 * np.sqrt(mass_kg / stiffness), rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "parameter", "other"),
    [("torque_skew", "delay_s", "torque_lag"), ("torque_lag", "time_constant_s", "torque_skew")],
)
def test_torques_are_as_late_as_log_and_sensors_make_them(name, parameter, other):
    _, truth = generate(replace(plan("single", 11, "x1", 2.0, name), schedule=TINY))
    (effect,) = truth["effects"]
    (own,) = [e for e in truth["background"] if e["cause"] == other and e["robot"] == effect["robot"]]
    (late,) = own["parameters"].values()
    assert late != 0.0
    assert effect["answer"]["known"][parameter] == effect["parameters"][parameter] + late


def test_a_wider_background_has_the_same_draws():
    one, ten = (tolerated(b, 3, np.random.default_rng(5)) for b in ("x1", "x10"))
    assert [type(effect) for effect in one] == [type(effect) for effect in ten]
    zeros = [[e.zero_rad for e in team if e.cause == "phi_zero"] for team in (one, ten)]
    np.testing.assert_allclose(zeros[1], 10.0 * np.array(zeros[0]), rtol=1e-12)
    spread = tolerated("uncalibrated", 3, np.random.default_rng(5))
    assert not {effect.cause for effect in spread} & {
        "phi_zero",
        "theta_zero",
        "link_length",
        "sea_scale",
        "sea_bias",
    }


@pytest.mark.slow
def test_same_seed_same_bits(tmp_path):
    """Recordings and truth, of a team with everything a little off and an effect of another form."""
    request = replace(plan("forms", 3, "x3", 4.0, "driven_lugre"), schedule=TINY)
    truths = [sets.simulate(request, tmp_path / name) for name in "ab"]
    assert truths[0] == truths[1] == sets.truth_of(request, tmp_path / "a")
    files = [sets.recordings_of(request, tmp_path / name) for name in "ab"]
    assert len(files[0]) == 1
    assert [f.read_bytes() for f in files[0]] == [f.read_bytes() for f in files[1]]
    assert sets.kept(tmp_path / "a") == [request]
    other = sets.simulate(replace(request, seed=4), tmp_path / "c")
    assert other["background"] != truths[0]["background"]
    (effect,) = truths[0]["effects"]
    assert effect["answer"]["cause"] == "joint_friction"
    assert effect["form"] is True


def _effect(cause="joint_friction", robot=2, joint=1, **known):
    known = known or {"coulomb_Nm": 0.05, "viscous_Nms_per_rad": 0.02}
    answer = {"cause": cause, "robot": robot, "joint": joint, "known": known}
    return {
        "cause": cause,
        "robot": robot,
        "joint": joint,
        "parameters": known,
        "answer": answer,
        "law": None,
    }


def _named(cause="joint_friction", robot=2, joint=1, probability=None, alternatives=(), told=(), **values):
    values = values or {"coulomb_Nm": (0.051, 0.001), "viscous_Nms_per_rad": (0.02, 0.002)}
    parameters = {name: {"value": value, "se": se} for name, (value, se) in values.items()}
    return {
        "cause": cause, "family": CAUSES[cause].family, "robot": robot, "joint": joint, "parameters": parameters,
        "alternatives": list(alternatives), "probability": probability, "name": cause, "told": list(told),
    }  # fmt: skip


def _result(
    effects,
    named,
    verdict="explained",
    kind="single",
    factor=4.0,
    names=None,
    background="x1",
    drawn=(),
    laws=(),
):
    names = [effect["cause"] for effect in effects] if names is None else names
    return {
        "key": f"1_{kind}", "engine": "e", "error": None, "cpu_s": 10.0, "peak_gb": 0.5, "law_scores": list(laws),
        "set": {"kind": kind, "names": names, "factors": [factor] * len(names), "background": background},
        "verdict": {"verdict": verdict, "causes": named, "gain": None, "residual": {"chi2_per_n": 1.0}},
        "truth": {
            "effects": effects, "background": list(drawn), "gimbal_axes_1": np.tile(np.eye(3), (3, 1, 1)).tolist()
        },
    }  # fmt: skip


def test_a_right_cause_is_right_and_its_error_is_counted():
    scored = score(_result([_effect()], [_named(probability=0.95)]))
    (one,) = scored.scores
    assert one.right
    assert scored.whole
    assert one.error == pytest.approx(0.02)
    np.testing.assert_allclose(one.deviations, [1.0, 0.0], atol=1e-9)
    assert scored.stated == ((0.95, True),)


@pytest.mark.parametrize(
    ("named", "family", "member", "place"),
    [
        (_named(joint=2), True, True, False),
        (_named("sea_hysteresis", probability=0.6), True, False, False),
        (_named("sea_bias"), False, False, False),
        (
            _named(
                "sea_hysteresis",
                alternatives=[{"cause": "joint_friction", "robot": 2, "joint": 1, "ambiguous": True}],
            ),
            True,
            False,
            True,
        ),
    ],
)
def test_a_wrong_cause_is_wrong(named, family, member, place):
    scored = score(_result([_effect()], [named]))
    (one,) = scored.scores
    assert (one.family, one.member, one.place) == (family, member, place)
    assert scored.whole is place
    assert all(not right for _, right in scored.stated)


def test_parallel_gimbals_are_one_place():
    effect = _effect("gimbal_friction", 1, 1)
    assert score(_result([effect], [_named("gimbal_friction", 3, 1)])).whole
    assert not score(_result([effect], [_named("gimbal_friction", 1, 2)])).whole


def test_a_mass_is_right_in_its_trials_and_at_its_size():
    """Put on from trial 3, or leaking out; where it sits is no part of its size."""
    put_on, leak = MassOfTrials(3, 0.02), MassDrift(-1e-3)
    named = {"mass_kg": (0.021, 1e-3), "rate_kgps": (0.0, None), "trial": (3, None), "last_trial": (0, None)}

    def scored(form, **other):
        effect = _effect("payload_mass", None, None, **form.known())
        return score(_result([effect], [_named("payload_mass", None, None, **(named | other))]))

    assert scored(put_on).whole
    assert scored(put_on).scores[0].error == pytest.approx(0.05)
    assert scored(put_on).scores[0].deviations == pytest.approx((1.0,))
    assert not scored(put_on, trial=(2, None)).whole
    assert not scored(put_on, last_trial=(3, None)).whole
    assert not scored(leak).whole
    drift = {"mass_kg": (0.0, None), "rate_kgps": (-1.1e-3, 1e-4), "trial": (1, None)}
    assert scored(leak, **drift).scores[0].error == pytest.approx(0.1)
    assert scored(leak, **drift).whole
    assert not scored(put_on, **drift).whole
    effect = _effect("payload_mass", None, None, **put_on.known(), point_x_m=0.3)
    away = _result([effect], [_named("payload_mass", None, None, **named, point_x_m=(0.1, 0.1))])
    assert score(away).scores[0].error == pytest.approx(0.05)
    assert score(away).scores[0].deviations == pytest.approx((1.0, -2.0))


def test_of_two_effects_each_gets_its_own_and_a_stranger_is_an_extra():
    effects = [_effect(), _effect("sea_bias", 1, 3, bias_Nm=0.1)]
    bias = _named("sea_bias", 1, 3, bias_Nm=(0.1, 0.01))
    assert score(_result(effects, [bias, _named()], kind="pairs")).whole
    scored = score(_result(effects, [_named(), _named("push", None, None, probability=0.8)], kind="pairs"))
    assert [one.right for one in scored.scores] == [True, False]
    assert [item["cause"] for item in scored.extras] == ["push"]
    assert scored.stated == ((0.8, False),)


def test_nothing_hidden_and_nothing_named():
    assert score(_result([], [], "consistent", "clean")).whole
    assert score(_result([], [], "miscalibrated", "clean")).whole
    assert not score(_result([], [], "unexplained", "clean")).whole
    assert not score(_result([], [_named()], "explained", "clean")).whole


def test_what_a_wide_background_drew_is_neither_an_alarm_nor_a_miss():
    """A friction of twelve tolerances, named at its size, in a clean set; of another joint, it is an alarm."""
    drawn = [_effect(joint=1, coulomb_Nm=0.05, viscous_Nms_per_rad=0.024)]
    named = _named(probability=0.9, viscous_Nms_per_rad=(0.02, 0.002), coulomb_Nm=(0.051, 0.001))
    there = score(_result([], [named], "explained", "clean", background="x10", drawn=drawn))
    assert (there.extras, len(there.grounded), there.stated) == ((), 1, ((0.9, True),))
    elsewhere = score(_result([], [{**named, "joint": 2}], "explained", "clean", drawn=drawn))
    assert (len(elsewhere.extras), elsewhere.grounded, elsewhere.stated) == (1, (), ((0.9, False),))
    # Hidden and drawn at one place: it answers for what was hidden.
    both = score(_result([_effect()], [named], drawn=drawn))
    assert both.scores[0].right
    assert not both.grounded
    # So it does about an axis that is the hidden one's, where the background drew some friction as well.
    rubs = [_effect("gimbal_friction", 3, 1, coulomb_Nm=0.002, viscous_Nms_per_rad=0.02)]
    found = _named("gimbal_friction", 3, 1, coulomb_Nm=(0.05, 0.001), viscous_Nms_per_rad=(0.03, 0.01))
    parallel = score(_result([_effect("gimbal_friction", 1, 1)], [found], drawn=rubs))
    assert parallel.scores[0].right
    assert not parallel.grounded


def test_a_told_set_that_something_unlisted_is_in_names_none():
    rival = {"cause": "joint_friction", "robot": 2, "joint": 1, "ambiguous": True}
    told = [{"cause": "sea_hysteresis"}, {"cause": "joint_friction"}]
    named = _named("sea_hysteresis", alternatives=[rival], told=told, probability=0.6)
    assert score(_result([_effect()], [named])).whole
    named = _named(
        "sea_hysteresis", alternatives=[rival], told=[*told, {"cause": "unlisted"}], probability=0.6
    )
    assert not score(_result([_effect()], [named])).whole


UNLISTED_ONE = {"cause": "unlisted", "name": "something unlisted", "probability": 0.95}


def test_what_nobody_lists_is_right_where_it_is_located():
    effect = _effect() | {"cause": "cross_talk", "law": {"of": "tau reading"}}
    effect["answer"] = {"cause": None, "robot": 2, "joint": 1, "known": {}}
    for which, named, whole, certain in (
        ((0,), [UNLISTED_ONE], True, 0),
        ((), [UNLISTED_ONE], False, 1),
        ((), [], False, 0),
        ((), [_named(probability=0.95)], False, 1),
        ((0,), [UNLISTED_ONE, _named(probability=0.5)], False, 0),
        ((0, 1), [UNLISTED_ONE, UNLISTED_ONE], True, 0),
        ((0,), [UNLISTED_ONE, UNLISTED_ONE], False, 1),
    ):
        law = {"which": which, "formula": False}
        scored = score(_result([effect], named, "unexplained", "unlisted", laws=[law]))
        assert (scored.whole, scored.certain, scored.right) == (whole, certain, int(bool(which)))


def test_something_unlisted_beside_a_listed_cause_is_wrong():
    scored = score(_result([_effect()], [_named(probability=0.99), UNLISTED_ONE], "partly_explained"))
    assert scored.scores[0].right
    assert not scored.whole
    assert scored.certain == 1


def test_a_left_out_cause_is_nobodys():
    """It is right where something is told as unlisted, or the verdict stays open."""
    wrong = _result([_effect()], [_named("sea_hysteresis", probability=0.4)], kind="left-out")
    assert not score(wrong).scores[0].listed
    assert not score(wrong).whole
    assert score(_result([_effect()], [UNLISTED_ONE], kind="left-out")).whole
    assert score(_result([_effect()], [], "unexplained", kind="left-out")).whole


def test_tables_and_misses_of_a_small_campaign():
    results = [
        _result([], [], "consistent", "clean", names=[]),
        _result([], [_named(probability=0.5)], "explained", "clean", names=[], background="x10"),
        *(_result([_effect()], [_named(probability=p)]) for p in (0.6, 0.8, 0.95, 0.95)),
        _result([_effect()], [_named(joint=3, probability=0.95)], background="uncalibrated"),
        _result([_effect()], [], "consistent", factor=2.0)
        | {"error": "Traceback\nValueError: no", "cpu_s": 70.0},
    ]
    text = tables(results)
    assert (
        "| clean | 2 | - | - | 1 (1 .. 99 %) | 0 | -0.693 (1) | 1.00 | 10.0, 10.0 | 0.50, 0.50 | 0 |" in text
    )
    told = np.mean(np.log([0.6, 0.8, 0.95, 0.95, 0.05]))
    single = f"| single | 6 | 4 of 6 | - | 4 (22 .. 96 %) | 1 | {told:.3f} (5) | 1.00 | 10.0, 70.0 | 0.50, 0.50 | 1 |"
    assert single in text
    assert "| uncalibrated with a fault | 1 | 0 of 1 |" in text
    assert "| 50 to 70 % | 2 | 55.0 % | 1 (1 .. 99 %) |" in text
    assert "1 x ValueError: no" in text
    assert len(misses(results).splitlines()) == 3


def test_what_is_wrong_with_certainty_costs_no_more_than_a_thousandth():
    assert log_score([(1.0, False)]) == pytest.approx(np.log(1e-3))
    assert log_score([(0.8, True), (0.3, False)]) == pytest.approx(np.mean(np.log([0.8, 0.7])))


def test_interval_of_none_is_clopper_and_pearsons():
    """1 - 0.025^(1/n)."""
    assert interval(0, 20) == pytest.approx((0.0, 1.0 - 0.025 ** (1 / 20)))
    assert interval(20, 20) == pytest.approx((0.025 ** (1 / 20), 1.0))


def test_simulation_and_diagnosis_are_apart(tmp_path, monkeypatch):
    """The peak memory of a diagnosis is that of its process: a simulation must not count."""
    done = tmp_path / "done"
    note = lambda what: done.open("a").write(f"{what} {os.getpid()}\n")  # noqa: E731
    monkeypatch.setattr(campaign.sets, "is_simulated", lambda request, out: done.exists())
    monkeypatch.setattr(campaign, "_simulate", lambda request, out: note("simulate"))
    monkeypatch.setattr(campaign, "_diagnose", lambda *rest, **how: note("diagnose"))
    campaign.simulate_and_diagnose([plan("clean", 0)], campaign.How(tmp_path))
    (first, one), (second, other) = (line.split() for line in done.read_text().splitlines())
    assert (first, second) == ("simulate", "diagnose")
    assert len({one, other, str(os.getpid())}) == 3


def test_a_diagnosis_that_takes_too_long_is_given_up(tmp_path, monkeypatch):
    """It has a result, and the sets after it have theirs."""

    def verdict_on(trials, excluded, *, closed_loop):
        while True:
            sum(range(10000))

    truth = _result([], [])["truth"]
    monkeypatch.setattr(campaign, "verdict_on", verdict_on)
    monkeypatch.setattr(campaign.sets, "is_simulated", lambda request, out: True)
    monkeypatch.setattr(campaign.sets, "truth_of", lambda request, out: truth)
    how = campaign.How(tmp_path, cpu_s=1)
    campaign.diagnose_all([plan("clean", 0), plan("clean", 1)], how)
    results = sets.read(how.path)
    assert len(results) == 2
    assert all("TimeoutError" in result["error"] for result in results)
    assert all(result["cpu_s"] > 0.9 for result in results)

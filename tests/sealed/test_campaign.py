"""Sets of the sealed campaign and their scores."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.team.causes import CAUSES
from hidden import Schedule
from mocobot_sim.effects import EFFECTS
from sealed import sets
from sealed.limits import LIMITS
from sealed.score import score
from sealed.sets import FORMS, LISTED, UNLISTED, generate, plan

TINY = Schedule(randoms=1, vias=1, periodic_s=None, hold_s=None)


def test_there_are_enough_forms_and_each_has_an_answer_or_a_law():
    assert len(UNLISTED) >= 14
    assert all(form.answer is not None for form in LISTED)
    assert all(form.answer is None for form in UNLISTED)
    assert set(LIMITS) == set(FORMS)
    assert not set(FORMS) & set(EFFECTS)
    assert {form.answer for form in LISTED} <= set(CAUSES)


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

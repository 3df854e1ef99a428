"""Scores of what is told as unlisted: what is right counts as right, and what is not does not."""

import numpy as np
import pytest

from discrepancy.team.laws import places_of
from sealed.score import FORMULAS, PLACES, SHAPES, VARIABLES, score_laws
from sealed.sets import OUTSIDE, UNLISTED
from team_case import exact

NAMES = {form.cause for form in (*UNLISTED, *OUTSIDE)}
TORQUE = "reading of the torque sensor of driven joint {} of robot 2"
TORQUE_1 = TORQUE.format(1)
EFFECT = {
    "cause": "quadratic_reading",
    "parameters": {"per_Nm": 0.002},
    "law": {"of": "tau reading", "place": {"robot": 2, "joint": 1}},
}


def test_every_unlisted_effect_can_be_scored():
    assert set(FORMULAS) >= NAMES
    # What slides on a spring is no function of what is recorded; a neighbour is named by its number.
    assert NAMES - {"shifting_load"} <= set(SHAPES)
    assert NAMES - {"shifting_load", "cross_talk"} <= set(VARIABLES)


def test_places_are_called_as_verdicts_call_them():
    known = {place.title.replace("{", "").replace("}", "") for place in places_of(1)}
    known.add("torque in driven joint")
    for words in PLACES.values():
        for word in words:
            plain = word.replace(" {joint}", "").removesuffix(" of robot {robot}")
            assert any(name.startswith(plain) for name in known), word


def unlisted(place=TORQUE_1, signal="tau_2_1", law=None):
    kind = f"something unlisted by its {signal}"
    return {"cause": "unlisted", "kind": kind, "place": place, "law": law}


def law(recording, function="square", of="tau_2_1", factor=1.0, offset=0.0):
    time = recording.time[::20] - recording.time[0]
    values = factor * 0.002 * recording.tau[::20, 1, 0] ** 2 + offset
    return {
        "place": "tau reading", "function": function, "of": of, "times": None, "numbers": {},
        "traces": [{"time_s": time.tolist(), "law": [values.tolist()]}],
    }  # fmt: skip


def scored(monkeypatch, *causes):
    monkeypatch.setattr("sealed.score.read_recording", lambda path: exact().carried.recording)
    truth = {"effects": [EFFECT], "gimbal_axes_1": np.tile(np.eye(3), (3, 1, 1)).tolist()}
    (one,) = score_laws({"truth": truth, "verdict": {"causes": list(causes)}}, ["one"])
    return one


def test_what_is_located_without_a_formula(monkeypatch):
    one = scored(monkeypatch, unlisted())
    assert (one.which, one.located, one.formula, one.size) == ((0,), True, False, None)
    assert not scored(monkeypatch, unlisted(signal="tau_2_2")).located
    assert not scored(monkeypatch, unlisted(place=TORQUE.format(2))).place
    assert not scored(monkeypatch).located


def test_the_nearest_of_several_counts(monkeypatch):
    one = scored(monkeypatch, unlisted(place=TORQUE.format(3)), unlisted())
    assert (one.which, one.located) == ((1,), True)


def test_a_force_is_one_law_for_each_axis(monkeypatch):
    """Each is held against its own component."""
    recording = exact().carried.recording
    monkeypatch.setattr("sealed.score.read_recording", lambda path: recording)
    along = {"along_x_m": 0.6, "along_y_m": 0.0, "along_z_m": -0.8}
    effect = {
        "cause": "growing_push", "parameters": {"rate_Nps": 0.05} | along,
        "law": {"of": "force on the payload, in the world", "place": {}},
    }  # fmt: skip
    time = recording.time[::20] - recording.time[0]
    told = [
        unlisted(
            f"force and moment on the payload, in the world force {axis}", "time",
            {"place": "force on payload", "targets": [f"payload_force_{axis}"], "function": "spline", "of": "time",
             "times": None, "numbers": {},
             "traces": [{"time_s": time.tolist(), "law": [(factor * 0.05 * time).tolist()]}]},
        )
        for axis, factor in (("x", 0.6), ("z", 0.8))
    ]  # fmt: skip
    truth = {"effects": [effect], "gimbal_axes_1": []}
    scores = [
        score_laws({"truth": truth, "verdict": {"causes": each}}, ["one"])[0] for each in (told, told[1:])
    ]
    assert [(one.which, one.formula) for one in scores] == [((0, 1), True), ((0,), False)]


def test_the_hidden_law_itself(monkeypatch):
    """A constant is a zero, and does not count."""
    one = scored(monkeypatch, unlisted(law=law(exact().carried.recording, offset=3.0)))
    assert (one.located, one.formula) == (True, True)
    assert one.size == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("how", "right", "size"),
    [
        ({"function": "spline", "factor": 1.1}, True, 0.1),
        ({"function": "spline", "factor": 1.3}, False, 0.3),
        ({"factor": 1.3}, True, 0.3),
        ({"factor": -1.0}, True, 2.0),
    ],
)
def test_a_curve_that_is_like_it_and_one_that_is_not(monkeypatch, how, right, size):
    one = scored(monkeypatch, unlisted(law=law(exact().carried.recording, **how)))
    assert one.formula is right
    assert one.size == pytest.approx(size, abs=1e-9)


def test_a_law_of_another_signal_is_not_located(monkeypatch):
    one = scored(monkeypatch, unlisted(law=law(exact().carried.recording, of="tau_2_2")))
    assert one.place
    assert not one.located


def test_of_two_hidden_effects_each_has_its_own(monkeypatch):
    other = {**EFFECT, "law": {"of": "tau reading", "place": {"robot": 2, "joint": 2}}}
    truth = {"effects": [EFFECT, other], "gimbal_axes_1": []}
    scores = score_laws({"truth": truth, "verdict": {"causes": [unlisted()]}}, [])
    assert [one.located for one in scores] == [True, False]


@pytest.mark.parametrize(
    ("place", "right"), [("gimbal axis 3 of robot 2", True), ("gimbal axis 3 of robot 1", False)]
)
def test_held_readings_are_located_by_their_place(monkeypatch, place, right):
    law_of = {"of": "theta reading", "place": {"robot": 2, "joint": 3}}
    monkeypatch.setitem(EFFECT, "cause", "dropouts_theta")
    monkeypatch.setitem(EFFECT, "law", law_of)
    cause = {"cause": "unlisted", "kind": "held readings", "place": place, "law": None}
    assert scored(monkeypatch, cause).located == right

"""Scores of laws: what is right counts as right, and what is not does not."""

import numpy as np
import pytest

from sealed.law_score import FORMULAS, PLACES, VARIABLES, score_laws
from sealed.law_truth import SHAPES, instants
from sealed.registry import OUTSIDE, UNLISTED
from team_case import exact

NAMES = {form.cause for form in (*UNLISTED, *OUTSIDE)}
EFFECT = {
    "cause": "quadratic_reading",
    "parameters": {"per_Nm": 0.002},
    "law": {"of": "tau reading", "place": {"robot": 2, "joint": 1}},
}

DRAG = {
    "cause": "drag", "family": "environment", "robot": None, "joint": None, "law": None,
    "parameters": {
        "coefficient_Ns_per_m": {"value": 0.93, "se": 0.06}, "turning_Nms_per_rad": {"value": 0.02, "se": 0.01}
    },
}  # fmt: skip


def test_every_unlisted_effect_can_be_scored():
    assert set(FORMULAS) == NAMES
    # What slides on a spring is no function of what is recorded; a neighbour is named by its number.
    assert set(SHAPES) == NAMES - {"shifting_load"}
    assert set(VARIABLES) == NAMES - {"shifting_load", "cross_talk"}
    assert len(PLACES) == 9


def scored(
    monkeypatch,
    function="square",
    of="tau_2_1",
    place="tau reading",
    joint=1,
    factor=1.0,
    offset=0.0,
    background=(),
):
    recording = exact().carried.recording
    monkeypatch.setattr("sealed.law_score.read_recording", lambda path: recording)
    at = instants(recording)
    values = factor * 0.002 * recording.tau[at, 1, 0] ** 2 + offset
    law = {"place": place, "function": function, "of": of, "times": None, "numbers": {}}
    cause = {
        "cause": "law",
        "robot": 2,
        "joint": joint,
        "law": law,
        "explained": {"in_sample": 0.5, "held_out": 0.4},
    }
    series = [[{"time_s": recording.time[at].tolist(), "values": [values.tolist()]}]]
    verdict = {"causes": [cause, DRAG], "law_series": series}
    truth = {"effects": [EFFECT], "background": background}
    (one,) = score_laws({"truth": truth, "verdict": verdict}, ["one"])
    return one


def test_the_hidden_law_itself(monkeypatch):
    one = scored(monkeypatch, offset=3.0)  # a constant is a zero, and does not count
    assert (one.place, one.variable, one.formula, one.beside) == (True, True, True, 1)
    assert one.amplitude == pytest.approx(0.0, abs=1e-9)
    assert one.held_out == pytest.approx(0.8)


def test_a_curve_that_is_like_it_and_one_that_is_not(monkeypatch):
    assert scored(monkeypatch, function="spline", factor=1.1).formula
    assert not scored(monkeypatch, function="spline", factor=1.3).formula
    assert scored(monkeypatch, factor=1.3).amplitude == pytest.approx(0.3, abs=1e-9)
    assert scored(monkeypatch, factor=-1.0).amplitude == pytest.approx(2.0, abs=1e-9)


def test_wrong_places_and_signals(monkeypatch):
    assert not scored(monkeypatch, of="tau_2_2").variable
    elsewhere = scored(monkeypatch, joint=2)
    assert (elsewhere.stated, elsewhere.place, elsewhere.formula, elsewhere.amplitude) == (
        True,
        False,
        False,
        None,
    )
    assert not scored(monkeypatch, place="phi reading").place


def test_nothing_stated():
    truth = {"effects": [EFFECT], "background": []}
    (one,) = score_laws({"truth": truth, "verdict": {"causes": [DRAG], "law_series": []}}, [])
    assert (one.stated, one.place, one.beside) == (False, False, 1)


def test_instants_leave_out_the_ends():
    recording = exact().carried.recording
    at = instants(recording)
    assert recording.time[at[0]] == pytest.approx(2.0)
    assert recording.time[at[-1]] <= recording.time[-1] - 2.0 + 1e-9
    assert np.ptp(np.diff(at)) == 0


def test_what_the_background_drew_is_not_wrong(monkeypatch):
    """A drag of 18 tolerances is there; one of two is within them, and one of half the size is another."""
    for size, wrong in ((0.9, 0), (0.1, 1), (0.45, 1)):
        drawn = {"cause": "drag", "parameters": {"coefficient_Ns_per_m": size, "turning_Nms_per_rad": 0.001}}
        one = scored(monkeypatch, background=[drawn])
        assert (one.beside, one.grounded) == (wrong, 1 - wrong)


def test_of_two_hidden_effects_each_has_its_score():
    other = {**EFFECT, "cause": "warming_zero"}
    truth = {"effects": [EFFECT, other], "background": []}
    scores = score_laws({"truth": truth, "verdict": {"causes": [], "law_series": []}}, [])
    assert [one.stated for one in scores] == [False, False]

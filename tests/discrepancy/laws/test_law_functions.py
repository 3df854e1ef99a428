"""The dictionary's functions against the simulator's, which are written apart, and against closed forms."""

import numpy as np
import pytest

from discrepancy.laws.candidate import candidate_of, law_steps, refined
from discrepancy.laws.dictionary import nearby, of_own, terms_at
from discrepancy.laws.functions import FUNCTIONS, knots_of
from discrepancy.team.laws.place import Place
from discrepancy.laws.term import Term
from discrepancy.team.laws.variable import TIME, Variable
from mocobot_sim.laws.functions import FUNCTIONS as SIMULATED
from mocobot_sim.laws.functions import Inside

RATE_HZ = 1000.0
ANGLE = Variable("phi_1_1", "angle", "phi", "rad", "angle")
TORQUE = Variable("tau_1_1", "torque", "tau", "N m", "torque")
NUMBERS = {
    "sign": {"slow": 0.3}, "above": {"knee": 0.2}, "below": {"knee": -0.1}, "beyond": {"knee": 0.4},
    "sine": {"times": 7.0}, "hum": {"frequency_hz": 1.3}, "warming": {"time_s": 3.0}, "play": {"half_width": 0.2},
    "lag": {"time_s": 0.2}, "second_order": {"frequency_hz": 1.1, "damping": 0.3},
}  # fmt: skip


def signal():
    t = np.arange(0.0, 12.0, 1.0 / RATE_HZ)
    return 0.2 + np.sin(2.0 * np.pi * 0.3 * t) + 0.4 * np.sin(2.0 * np.pi * 0.77 * t + 1.0)


@pytest.mark.parametrize("name", [name for name in FUNCTIONS if name != "spline"])
def test_both_say_the_same(name):
    """One sample after the other as it is simulated, and all at once."""
    x, numbers = np.abs(signal()) if name == "warming" else signal(), NUMBERS.get(name, {})
    columns = FUNCTIONS[name].of(x, RATE_HZ, numbers)
    number, second = [*numbers.values(), 0.0, 0.0][:2]
    phases = (0.0, np.pi / 2.0) if columns.shape[1] == 2 else (0.0,)
    for column, phase in zip(columns.T, phases, strict=True):
        step = SIMULATED[name](Inside(number, second, phase, 1.0 / RATE_HZ))
        np.testing.assert_allclose(column, [step(value) for value in x], atol=0.02 * np.abs(column).max())


def test_a_curve_runs_through_its_knots_and_is_held_outside():
    numbers = knots_of(-1.0, 2.5)
    knots = -1.0 + 0.5 * np.arange(8)
    heights = np.array([1.0, 2.0, -1.0, 0.0, 3.0, 1.0, 1.0, -2.0])
    x = np.linspace(-3.0, 5.0, 301)
    curve = FUNCTIONS["spline"].of(x, RATE_HZ, numbers) @ heights
    np.testing.assert_allclose(curve, np.interp(x, knots, heights), atol=1e-12)
    simulated = [SIMULATED["first_hat"], *[SIMULATED["hat"]] * 6, SIMULATED["last_hat"]]
    for k, made in enumerate(simulated):
        step = made(Inside(float(knots[k]), 0.5, 0.0, 1e-3))
        np.testing.assert_allclose(
            FUNCTIONS["spline"].of(x, RATE_HZ, numbers)[:, k], [step(v) for v in x], atol=1e-12
        )


def test_a_sine_of_any_phase_is_a_sum_of_its_two_columns():
    x = signal()
    columns = FUNCTIONS["sine"].of(x, RATE_HZ, {"times": 5.0})
    np.testing.assert_allclose(columns @ [np.cos(0.7), np.sin(0.7)], np.sin(5.0 * x + 0.7), atol=1e-12)


def test_a_product():
    values = {"phi_1_1": signal(), "tau_1_1": np.linspace(1.0, 3.0, len(signal()))}
    term = Term("square", ANGLE, {}, TORQUE)
    found = term.values(lambda v: values[v.name], RATE_HZ)
    np.testing.assert_allclose(found[:, 0], values["phi_1_1"] ** 2 * values["tau_1_1"])
    assert term.variables == ("phi_1_1", "tau_1_1")


def test_what_is_tried_at_a_place():
    place = Place("tau reading", 1, 1, ("tau_1_1",), ("",), "N m", "reading", (ANGLE, TORQUE))
    other = Variable("tau_1_2", "", "", "N m", "torque")
    terms = terms_at(place, [TIME, ANGLE, TORQUE, other], lambda v: signal())
    said = {(term.function, term.variables) for term in terms}
    for wanted in [
        ("linear", ("tau_1_2",)), ("warming", ("time", "tau_1_1")), ("sine", ("phi_1_1",)),
        ("play", ("tau_1_1",)), ("constant", ("time",)), ("spline", ("phi_1_1",)),
    ]:  # fmt: skip
        assert wanted in said
    assert not [term for term in terms if set(term.numbers) != set(term.law.numbers)]


def test_nearby_numbers_stay_possible():
    for variable in (ANGLE, TORQUE):
        for term in of_own(variable, signal()):
            for finer in (False, True):
                for near in nearby(term, finer=finer):
                    assert set(near.numbers) == set(term.numbers)
                    assert near.numbers != term.numbers
                    assert np.isfinite(near.values(lambda v: signal(), RATE_HZ)).all()


def test_a_signal_that_stands_still_has_no_curve():
    assert "spline" not in {term.function for term in of_own(ANGLE, np.ones(100))}


def test_a_warming_that_is_over_before_the_rows_begin_is_a_constant():
    """Rows begin two seconds after a trial: of a time constant of 0.6 s a thirtieth is left to come."""
    place = Place("tau reading", 1, 1, ("tau_1_1",), ("",), "N m", "reading")
    law = candidate_of(place, Term("warming", TIME, {"time_s": 2.5}), 1.0, 1)
    short = law.in_shape({"time_s": 0.6})
    assert (short.term.numbers, short.shape) == ({"time_s": 2.0}, {"time_s": 2.0})
    assert law.in_shape({"time_s": 7.0}).term.numbers == {"time_s": 7.0}
    assert min(c.shape["time_s"] for c in refined(law, finer=False)) == 2.0
    # At the least the slope is one-sided.
    ((less, more, difference),) = law_steps(short)
    assert (less.shape["time_s"], more.shape["time_s"]) == (2.0, pytest.approx(2.04))
    assert difference == pytest.approx(0.04)

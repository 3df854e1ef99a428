"""Formulas of curves whose law is known: the law is told, with its numbers within their errors."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import rankdata

from discrepancy.formulas.formula import KNOTS, Curve, Formula, Kind, formula_of
from discrepancy.formulas.law import Law, Of
from estimator.arrays import Array
from mocobot_sim.functions import FUNCTIONS, Inside

SAMPLES, ROWS, TERMS, PRIOR = 4000, 1600, 7, 25.0
LOUD = 0.03
"""Noise of a row, of functions of about unit size."""
SIGMAS = 4.0
Function = Callable[[Array], Array]


def fitted(f: Function, kind: Kind = "other", *, constant: bool = False) -> Curve:
    """What noisy rows at some samples say of a function's cosines; a constant beside is unknown unless it is told."""
    rng = np.random.default_rng(3)
    x = np.sin(np.linspace(0.0, 90.0, SAMPLES)) * rng.uniform(0.5, 1.5) + 0.1 * rng.standard_normal(SAMPLES)
    x = np.tile(np.linspace(0.0, 30.0, SAMPLES // 4), 4) if kind == "time" else x
    basis = np.cos(np.pi * np.outer((rankdata(x) - 0.5) / SAMPLES, np.arange(TERMS + 1)))
    at = rng.choice(SAMPLES, ROWS)
    X, y = basis[at], f(x[at]) + LOUD * rng.standard_normal(ROWS)
    covariance = np.linalg.inv(X.T @ X / LOUD**2 + np.eye(TERMS + 1) / PRIOR)
    mean, own = covariance @ X.T @ y / LOUD**2, slice(int(not constant), None)
    prior = np.full(TERMS + 1, PRIOR)[own]
    return Curve(x, basis[:, own], mean[own], covariance[own, own], prior, kind)


def spring(x: Array) -> Array:
    return -0.8 * x**3


LAWS: dict[str, tuple[Function, Kind, dict[str, float]]] = {
    "linear": (lambda x: 0.3 * x, "other", {"amplitude": 0.3}),
    "square": (lambda x: 0.3 * x**2, "other", {"amplitude": 0.3}),
    "cube": (spring, "other", {"amplitude": -0.8}),
    "signed_square": (lambda x: 0.43 * x * np.abs(x), "other", {"amplitude": 0.43}),
    "absolute": (lambda x: -0.5 * np.abs(x), "other", {"amplitude": -0.5}),
    "sign": (lambda x: 0.2 * np.sign(x), "other", {"amplitude": 0.2}),
    "above": (lambda x: -0.6 * np.maximum(x - 0.2, 0.0), "other", {"amplitude": -0.6, "knee": 0.2}),
    "beyond": (lambda x: 0.9 * (x - np.clip(x, -0.4, 0.4)), "other", {"amplitude": 0.9, "knee": 0.4}),
    "sine": (lambda x: 0.3 * np.sin(5.0 * x + 0.9), "angle", {"amplitude": 0.3, "phase_rad": 0.9, "times": 5}),
    "warming": (lambda t: 0.5 * (1.0 - np.exp(-t / 9.0)), "time", {"amplitude": 0.5, "time_s": 9.0}),
    "step": (lambda t: 0.4 * (t > 12.0), "time", {"amplitude": 0.4}),
}  # fmt: skip


@pytest.mark.parametrize("constant", [False, True])
@pytest.mark.parametrize("name", LAWS)
def test_a_law_is_told_with_its_numbers(name: str, constant: bool) -> None:
    """Whether or not the data tell a constant beside it."""
    f, kind, true = LAWS[name]
    formula = formula_of(fitted(f, kind, constant=constant))
    assert formula.function == name
    for number, value in true.items():
        found, se = formula.parameters[number]
        assert abs(found - value) < SIGMAS * (se or 1e-12), number


def test_a_constant_alone_is_told() -> None:
    """It has no function of the signal."""
    formula = formula_of(fitted(lambda x: np.full_like(x, 0.2), constant=True))
    value, se = formula.parameters["amplitude"]
    assert formula.function == "constant"
    assert abs(value - 0.2) < SIGMAS * (se or 0.0)


def test_two_terms_are_told_where_one_is_not_enough() -> None:
    """Dry friction and a spring that hardens."""
    formula = formula_of(fitted(lambda x: 0.2 * np.sign(x) - 0.5 * x**3))
    assert set(formula.function.split(" + ")) == {"sign", "cube"}


def test_a_curve_that_is_no_formula_is_told_by_its_knots() -> None:
    """It goes up and down by no rule: values at knots are the curve's."""
    curve = replace(fitted(spring), mean=np.array([0.3, -0.5, 0.6, 0.5, -0.6, 0.5, 0.4]))
    formula = formula_of(curve)
    assert formula.function == "spline"
    knots = formula.numbers["low"] + formula.numbers["step"] * np.arange(KNOTS)
    told = [formula.parameters[f"at_knot_{k + 1}"] for k in range(KNOTS)]
    assert np.allclose([value for value, _ in told], curve.at(knots)[0])
    assert np.allclose([se for _, se in told], curve.at(knots)[1])


@pytest.mark.parametrize("name", ["cube", "beyond", "sine", "step"])
def test_pieces_are_the_simulators(name: str) -> None:
    """Functions of one amplitude each add up to the formula."""
    f, kind, _ = LAWS[name]
    curve = fitted(f, kind)
    formula, x = formula_of(curve), curve.x[:200]
    total = np.zeros(len(x))
    for piece in formula.pieces():
        inside = Inside(piece["number"], piece["second"], piece["phase_rad"], 0.01)
        step = FUNCTIONS[piece["function"]](inside)
        total += piece["amplitude"] * np.array([step(value) for value in x])
    assert np.allclose(total, formula.at(x))


def law_of(formula: Formula, unit: str, of_unit: str) -> Law:
    """A law of a torque reading."""
    of = Of("phi_rate_1_2", "rate of driven joint 2 of robot 1", "v", of_unit)
    return Law("tau reading", 1, 2, "tau_1_2", unit, of, None, formula)


def test_a_sentence_has_place_formula_and_signal() -> None:
    """In units that are easy to read."""
    formula = formula_of(fitted(lambda x: 0.43 * x * np.abs(x)))
    law = law_of(formula, "N m", "rad/s")
    value, se = formula.parameters["amplitude"]
    assert law.sentence("It") == (
        f"It is off by {value:.4f} +- {se:.4f} N m/(rad/s)^2 v |v|, v the rate of driven joint 2 of robot 1 [rad/s]"
    )
    told = law.to_dict()
    assert told["formula"] == "a v |v|"
    assert told["targets"] == ["tau_1_2"]
    assert told["units"] == {"amplitude": "N m/(rad/s)^2"}

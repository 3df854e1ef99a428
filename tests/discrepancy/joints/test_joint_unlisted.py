"""What no table lists at a joint is told by a formula of its signal."""

from __future__ import annotations

import numpy as np
import pytest

from discrepancy.formulas.law import Law
from discrepancy.joints.causes import JointSignals, Span
from discrepancy.joints.unlisted import basis, every, law_of
from estimator.arrays import Array

SAMPLES, LOUD = 3000, 0.02
SPAN = Span(1.0, 1.0, 1.0, 1.0, 0.0, 60.0)


def signals(seed: int) -> JointSignals:
    """A joint that moves to and fro, at speeds that have nothing to do with where it is."""
    rng, t = np.random.default_rng(seed), np.linspace(0.0, 60.0, SAMPLES)
    q, v = 0.8 * np.sin(0.7 * t + seed) + 0.1 * rng.standard_normal(SAMPLES), 1.5 * np.sin(1.9 * t)
    load = 4.0 + 3.0 * np.sin(0.31 * t)
    return JointSignals(q, v, np.gradient(v, t), np.sign(v), load, load, load, load, t, SPAN)


def told(name: str, error: Array, own: JointSignals, before: JointSignals) -> Law:
    """The law by noisy values of an error, without the direction that it turns with."""
    X = basis(name, every(name, [own], [before]))
    X1 = np.column_stack([X, np.ones(SAMPLES)])  # a constant is a cause of its own
    y = error + LOUD * np.random.default_rng(5).standard_normal(SAMPLES)
    prior = np.ones(X1.shape[1])
    covariance = np.linalg.inv(X1.T @ X1 / LOUD**2 + np.diag(1.0 / prior))
    mean, k = covariance @ X1.T @ y / LOUD**2, slice(0, -1)
    return law_of(name, 2, [False] * 3, [own], [before], (mean[k], covariance[k, k], prior[k]))


def test_a_ripple_of_the_position() -> None:
    """Its periods in a turn, amplitude and phase."""
    own = signals(1)
    law = told("position", 0.3 * np.sin(5.0 * own.q + 0.4), own, signals(2))
    assert (law.target, law.of.name, law.times, law.unit) == ("torque_3", "q_3", None, "N m")
    assert (law.formula.function, law.formula.numbers) == ("sine", {"times": 5.0})
    assert law.formula.parameters["amplitude"][0] == pytest.approx(0.3, abs=0.01)
    assert law.formula.parameters["phase_rad"][0] == pytest.approx(0.4, abs=0.03)


def test_drag_that_grows_with_the_square_of_the_speed() -> None:
    """It turns with the direction of motion."""
    own = signals(1)
    law = told("speed", 0.2 * own.v**2, own, signals(2))
    assert law.times is not None
    assert law.times.name == "direction_3"
    assert law.to_dict()["formula"] == "(a |v|^2) sign(v)"
    assert law.to_dict()["units"] == {"amplitude": "N m/(rad/s)^2"}


def test_a_sensor_that_reads_some_of_the_joint_before() -> None:
    """A share of that torque."""
    own, before = signals(1), signals(2)
    law = told("neighbour's torque", 0.05 * before.asked, own, before)
    assert (law.of.name, law.formula.function) == ("torque_2", "linear")
    assert law.formula.parameters["amplitude"][0] == pytest.approx(0.05, abs=0.002)


def test_an_error_of_a_reading_is_an_angle() -> None:
    """Of the position itself."""
    own = signals(1)
    law = told("reading", 0.3 * np.cos(own.q), own, signals(2))
    assert (law.place, law.target, law.unit) == ("joint position", "position_3", "rad")

"""When an event acted, and how it grew: found wherever a search begins, with errors that tell how far off it is."""

from dataclasses import dataclass

import numpy as np
import pytest
from helpers.fake_rig import CHANNELS, RATE_HZ, ROWS, FakeRig
from scipy.stats import chi2, norm

from discrepancy.candidate import Candidate, Parameter, Transient
from discrepancy.inference.search import search
from discrepancy.inference.shape.best_event import Elements
from discrepancy.inference.shape.best_shape import covariance_with_shape

SMOOTH_S, FORCE = 0.06, np.array([12.0, -8.0])
SEEDS = range(25)


def window(when):
    """Share of an event at every row, behind a Gaussian filter, in closed form."""
    since = np.arange(ROWS) / RATE_HZ - when.start_s
    left = since - when.duration_s + when.ramp_s
    if not when.ramp_s:
        return norm.cdf(since / SMOOTH_S) - norm.cdf(left / SMOOTH_S)
    corners = (since, since - when.ramp_s, left, left - when.ramp_s)
    a, b, c, d = (x * norm.cdf(x / SMOOTH_S) + SMOOTH_S * norm.pdf(x / SMOOTH_S) for x in corners)
    return (a - b - c + d) / when.ramp_s


def push(start_s, duration_s, ramp_s=0.0):
    when = Transient(1, start_s, duration_s, ramp_s)
    numbers = tuple(Parameter(f"p{k}", 0.0, 1.0) for k in range(2))
    return Candidate("push", "push", None, None, numbers, when.shape, when)


@dataclass
class Pushed(FakeRig):
    """A push in the second trial, its two numbers in a channel each."""

    hidden: Candidate | None = None

    def __post_init__(self):
        super().__post_init__()
        if self.hidden:
            x, local, shared = self.data[1]
            self.data[1] = x + self.columns(self.hidden)[1] @ FORCE, local, shared

    def _burst_columns(self, t, candidate):
        out = np.zeros((ROWS, CHANNELS, 2))
        if t == candidate.transient.trial:
            out[:, [0, 1], [0, 1]] = window(candidate.transient)[:, None]
        return out

    def transients(self, remaining):
        return [push(5.5, 1.6)]

    def steps(self, candidate):
        each = []
        for name in candidate.shape if candidate.transient else ():
            step = min(0.05, 0.25 * candidate.shape[name]) if name == "ramp_s" else 0.05
            a, b = candidate.shape[name] - step, candidate.shape[name] + step
            b = min(b, 0.5 * candidate.shape["duration_s"]) if name == "ramp_s" else b
            less, more = (candidate.in_shape({**candidate.shape, name: x}) for x in (a, b))
            each.append((less, more, b - a))
        return each


def found_in(rig):
    searched = search(rig)
    (cause,) = searched.best.causes
    index = searched.best.free[0]
    values = searched.best.fit.part(index)[0]
    return cause, values, covariance_with_shape(searched.rig, searched.best.fit, index)


def test_a_share_that_acts_is_the_area_under_its_corners():
    when = Transient(0, 1.0, 4.0, 1.5)
    time = np.linspace(0.0, 6.0, 6001)
    share = np.interp(time, [1.0, 2.5, 3.5, 5.0], [0.0, 1.0, 1.0, 0.0])
    area = np.concatenate([[0.0], np.cumsum(0.5 * (share[1:] + share[:-1])) * 1e-3])
    np.testing.assert_allclose(when.acted(time), area, atol=1e-6)
    assert Transient(0, 1.0, 4.0).acted(np.array([0.0, 1.25, 9.0])).tolist() == [0.0, 0.25, 4.0]


@pytest.mark.parametrize("ramp_s", [0.0, 1.2])
def test_ends_are_found_far_from_where_the_search_begins(ramp_s):
    cause, values, covariance = found_in(Pushed({}, hidden=push(2.37, 5.11, ramp_s)))
    at, se = cause.transient, np.sqrt(np.diag(covariance))
    assert at is not None
    assert bool(at.ramp_s) == bool(ramp_s)
    truth = [*FORCE, 2.37, 5.11, *([ramp_s] if ramp_s else [])]
    stated = [*values, at.start_s, at.duration_s, *([at.ramp_s] if at.ramp_s else [])]
    away = (np.array(stated) - truth) / se
    assert len(away) == len(se)
    assert np.abs(away).max() < 4.0
    assert se[2] < 0.1


def test_what_an_interval_explains_is_the_sum_of_its_parts():
    rig = Pushed({}, hidden=push(2.4, 4.8))
    nothing = search(Pushed({})).nothing  # of the same rig without the push: any fit will do
    nodes = np.linspace(0.8, 8.0, 10)
    ((best, gain),) = Elements.of(rig, push(4.0, 1.6), nodes).best(nothing.fit, (0.0,))
    information, score = nothing.fit.told_by(rig.columns(best))
    assert gain == pytest.approx(
        0.5 * score @ np.linalg.solve(information + 1e-3 * np.eye(2), score), rel=1e-6
    )


@pytest.mark.slow
def test_errors_hold_as_the_shape_is_not_known_beforehand():
    """Monte Carlo, of ramps far from a triangle, at which a standard error is no more than a bound."""
    away = []
    for seed in SEEDS:
        cause, values, covariance = found_in(Pushed({}, hidden=push(4.37, 3.03, 0.6), seed=seed))
        at = cause.transient
        assert at is not None
        stated = np.array([*values, at.start_s, at.duration_s, at.ramp_s])
        away.append((stated - [*FORCE, 4.37, 3.03, 0.6]) / np.sqrt(np.diag(covariance)))
    low, high = chi2.ppf([1e-3, 1 - 1e-3], len(SEEDS)) / len(SEEDS)
    squares = np.mean(np.square(away), axis=0)
    assert np.all((squares > low) & (squares < high)), squares

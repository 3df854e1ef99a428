"""Steps of a calibration where whole ones go astray: recordings of two teams taken for one."""

import numpy as np
import pytest

from estimator.arm.unit import COUNT, ArmUnit
from estimator.calibrate import rules
from estimator.calibrate.calibration import Prior
from estimator.calibrate.least_squares import CarriedTrial, Given, Problem, Unknowns, solved
from estimator.calibrate.rows import Rows, Sensing
from omnid_design import DESIGN
from synthetic_team import carry, draw_path, draw_units, load, with_noise


def problem_of(teams: int) -> Problem:
    """Two trials of one payload, carried by one team or by two, and where a calibration begins."""
    rng = np.random.default_rng(33)
    held = load(3, rng)
    units = [draw_units(3, Prior(), rng) for _ in range(teams)]
    exact = [carry(units[k % teams], held, draw_path(held, rng), rng, 12.0) for k in range(2)]
    recordings = [with_noise(one.recording, 2e-5, 0.01, rng) for one in exact]
    sensing = Sensing.of(recordings)
    trials = [CarriedTrial(Rows.of(one), 0, sensing) for one in recordings]
    designed = ArmUnit(DESIGN, np.zeros((3, COUNT)))
    start = Unknowns(designed, (held.shared,), tuple(one.bases for one in exact))
    return Problem(Given(trials, start, Prior()))


def test_steps_of_one_team_are_whole() -> None:
    problem = problem_of(1)
    point, damping = problem.start(), 0.0
    for _ in range(3):
        whole = solved(*problem.normal(point))[0]
        lower, tried, damping = problem.lower(point, damping, 5)
        assert lower is not None
        assert tried == 1
        assert lower.z == pytest.approx(point.z + whole, rel=1e-12, abs=1e-15)
        point = lower
    assert point.value / point.rows < 1.1


def test_steps_between_two_teams_go_down_where_whole_ones_go_up() -> None:
    problem = problem_of(2)
    whole = problem.start()
    highest = whole.value
    for _ in range(2):
        whole = problem.moved(whole, solved(*problem.normal(whole))[0])
    assert whole.value > 3.0 * highest
    problem = problem_of(2)
    point, damping = problem.start(), 0.0
    damped = 0
    for _ in range(4):
        lower, tried, damping = problem.lower(point, damping, 10)
        assert lower is not None
        assert lower.value < point.value * (1.0 + rules.RISE)
        damped += tried > 1
        point = lower
    assert damped > 0
    assert point.value < highest


def test_where_no_step_goes_down_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    again, problem = problem_of(1), problem_of(1)
    point = again.start()
    expected = again.at(point.unknowns, point.z).g
    point = problem.start()
    monkeypatch.setattr(rules, "RISE", -1.0)
    assert problem.lower(point, 0.0, 4)[:2] == (None, 4)
    np.testing.assert_array_equal(
        problem.at(point.unknowns, point.z).g, expected
    )  # signals are where they were

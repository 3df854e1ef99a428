"""What is a law of its own, and what is a listed cause in another form."""

import numpy as np
import pytest

from discrepancy import rules
from discrepancy.candidate import Candidate, Parameter
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.remainder import form_share_of
from discrepancy.laws.candidate import candidate_of
from discrepancy.laws.forms import form_of_named, gain_of, refinement
from discrepancy.laws.term import Term
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Rows
from discrepancy.team.causes.sea_hysteresis import SeaHysteresis
from discrepancy.team.laws.bench import TeamBench
from discrepancy.team.laws.places import places_of
from discrepancy.team.laws.variables import joint_variable

PLACES = places_of(3)
BENCH = TeamBench.__new__(TeamBench)  # without recordings: what is asked here needs none


def place(name, robot=None, joint=None):
    (found,) = [p for p in PLACES if p.key == (name, robot, joint)]
    return found


def law(at, function="linear", of=None):
    variable = of or joint_variable("tau", at.robot or 1, at.joint or 1)
    numbers = {"play": {"half_width": 3e-4}, "sign": {"slow": 4e-3}}.get(function, {})
    return candidate_of(at, Term(function, variable, numbers), 1.0, 100)


def listed(name, robot=None, joint=None, tolerance=0.0, **more):
    return Candidate(name, name, robot, joint, (Parameter("size", tolerance, 1.0),), **more)


@pytest.mark.parametrize(
    ("size", "share"), [(0.01, 0.1), (0.03, 0.1), (0.12, 0.2), (-0.12, 0.2), (50.0, 0.3)]
)
def test_friction_has_another_form_by_the_root_of_its_size(size, share):
    """Four times the friction rests four times as long: twice the share in amplitude, up to three tenths."""
    candidate = SeaHysteresis().candidate({"friction_Nm": 2e-3}, {"slow_Nm_per_s": 0.2}, 1, 1)
    assert form_share_of(candidate, np.array([size / 2e-3])) == pytest.approx(share)


def test_a_share_without_a_size_is_the_same_for_all():
    candidate = listed("play", 1, form_share=0.1)
    assert form_share_of(candidate, np.array([1e6])) == 0.1
    assert form_share_of(listed("zero", 1), np.array([1e6])) == 0.0


def hypothesis(size, gain, cause, at, named=True):
    """One unit of a cause of chi-square ``size`` squared and a law of ``gain``, along columns of their own; noise."""
    rng, n = np.random.default_rng(3), 400
    columns = np.linalg.qr(rng.standard_normal((n, 2)))[0]
    x = rng.standard_normal(n) + size * columns[:, 0] + np.sqrt(gain) * columns[:, 1]
    none = np.zeros((n, 1, 0))
    causes = [size * columns[:, :1, None], columns[:, 1:, None]]
    rows = Rows("trial", x[:, None], none, none, causes, np.arange(n) / 10.0)
    problem = Problem.of([rows], [cause, law(at)])
    return Hypothesis.of(problem, [0, 1] if named else [1])


@pytest.mark.parametrize(("gain", "is_form"), [(200.0, True), (800.0, False)])
def test_a_law_that_gains_less_than_a_fifth_of_the_cause_beside_it_is_its_form(gain, is_form):
    """Of a trace of 100 squared the law's share is 20 squared, a chi-square of 400."""
    best = hypothesis(100.0, gain, listed("grasp_flex", 3), place("phi reading", 3, 1))
    power = float(best.problem.power[0][best.problem.cells[0].sizes > 0].mean())
    assert gain_of(best, 1) == pytest.approx(gain / power, rel=0.35)
    found = refinement(best, 1, BENCH)
    assert (found is not None) is is_form
    if found:
        assert [cause.cause for cause in found.causes] == ["grasp_flex"]
        assert found.share == pytest.approx(np.sqrt(gain) / 100.0, rel=0.2)
        assert found.expected == pytest.approx(rules.LAW_SHARE)
        assert "grasp flex (robot 3) does" in found.sentence


@pytest.mark.parametrize(
    ("cause", "at"),
    [
        (listed("grasp_flex", 2), place("phi reading", 3, 1)),  # another robot
        (listed("theta_zero", 3, 1), place("phi reading", 3, 1)),  # a number, no law
        (listed("base_tilt", 3), place("force on payload")),
    ],
)
def test_what_cannot_leave_it_there_excuses_no_law(cause, at):
    assert refinement(hypothesis(100.0, 50.0, cause, at), 1, BENCH) is None


def test_a_named_cause_shows_in_the_payload_and_one_of_the_payload_everywhere():
    assert BENCH.beside(place("force on payload"), listed("tether", 2), named=True)
    assert BENCH.beside(place("tau reading", 1, 1), listed("drag"), named=True)
    assert not BENCH.beside(place("force on payload"), listed("tether", 2), named=False)


def test_what_is_tolerated_counts_with_its_own_form_and_at_its_joint_only():
    """Friction of a kind that scatters: a tenth of a trace of 100 squared is a chi-square of 100."""
    for joint, gain, is_form in ((1, 50.0, True), (1, 400.0, False), (2, 50.0, False)):
        cause = listed("sea_hysteresis", 3, joint, tolerance=1.0, form_share=0.1)
        best = hypothesis(100.0, gain, cause, place("tau reading", 3, 1), named=False)
        assert (refinement(best, 1, BENCH) is not None) is is_form, (joint, gain)


def test_what_was_named_before_counts_where_it_is_now_a_scatter():
    cause = listed("base_compliance", 3, tolerance=1.0)
    best = hypothesis(100.0, 200.0, cause, place("phi reading", 3, 1), named=False)
    assert refinement(best, 1, BENCH) is None
    assert refinement(best, 1, BENCH, {cause.key}) is not None


def test_play_of_its_own_angle_is_friction_that_gives_way_before_it_slides():
    here, there = place("gimbal torque", 3, 3), place("gimbal torque", 2, 2)
    friction = listed("gimbal_friction", 3, 3)
    own, other = (
        law(at, "play", joint_variable("theta", at.robot or 0, at.joint or 0)) for at in (here, there)
    )
    found = form_of_named([other, own], [friction], BENCH)
    assert found is not None
    assert found.law is own
    assert "in another form than its law: play of theta_33" in found.sentence
    assert form_of_named([other], [friction], BENCH) is None
    assert form_of_named([own], [listed("joint_friction", 3, 3)], BENCH) is None
    # One side only is no friction, and a reading that stays behind its angle none either.
    one_sided = law(here, "above", joint_variable("theta_rate", 3, 3))
    reading = law(place("theta reading", 3, 3), "play", joint_variable("theta", 3, 3))
    assert form_of_named([one_sided, reading], [friction], BENCH) is None
    driven = law(place("tau reading", 1, 3), "sign", joint_variable("phi_rate", 1, 3))
    assert form_of_named([driven], [listed("joint_friction", 1, 3)], BENCH) is not None


def test_play_of_the_torque_is_friction_inside_the_spring_in_another_form():
    friction, at = listed("sea_hysteresis", 1, 3), place("tau reading", 1, 3)
    own = law(at, "play", joint_variable("tau", 1, 3))
    found = form_of_named([own], [friction], BENCH)
    assert found is not None
    assert found.law is own
    assert form_of_named([law(at, "play", joint_variable("tau", 1, 2))], [friction], BENCH) is None
    assert form_of_named([own], [listed("sea_hysteresis", 1, 2)], BENCH) is None
    assert form_of_named([law(at)], [friction], BENCH) is None  # that is a scale

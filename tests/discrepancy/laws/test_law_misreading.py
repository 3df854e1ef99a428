"""A sensor that errs by what there is: closed forms, the exact residual, and a square hidden in a simulated team."""

from __future__ import annotations

import numpy as np
import pytest

from discrepancy.engine.diagnose import diagnose
from discrepancy.laws.candidate import LawCandidate, candidate_of
from discrepancy.laws.term import Term
from discrepancy.team.laws.variable import TIME
from discrepancy.rules import LAW_READING_LEAST
from discrepancy.team.causes.base import one_joint, one_robot
from discrepancy.team.laws.misreading import Misreading
from discrepancy.team.laws.places import places_of
from discrepancy.team.laws.variables import joint_variable
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import read_tolerances
from estimator.estimate.payload import estimate_payload
from mocobot_sim.effects import apply_effects
from mocobot_sim.effects.law import Law
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.readings import Misreading as Reader
from mocobot_sim.trial.readings import RobotReadings
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trajectories import random_vias, sphere_motion
from mocobot_sim.trial.trial import run_trial
from team_case import residual_of

READ = np.linspace(0.5, 9.5, 50)
PLACES = {place.key: place for place in places_of(3)}


def square(read: np.ndarray = READ) -> Misreading:
    return Misreading(read, lambda x: x[:, None] ** 2)


@pytest.mark.parametrize("a", [-0.02, -0.007, 1e-9, 0.007, 0.05])
def test_a_square_against_the_roots_of_its_equation(a: float) -> None:
    """read = x + a x^2, so dx/da = -x^2 / (1 + 2 a x) at a given reading."""
    root = np.sqrt(1.0 + 4.0 * a * READ)
    x = 2.0 * READ / (1.0 + root)
    np.testing.assert_allclose(square().true(np.array([a])), x, rtol=1e-7)
    np.testing.assert_allclose(square().slopes(np.array([a]))[:, 0], x**2 / root, rtol=1e-5)


def test_several_terms_and_none() -> None:
    """x (1 + b) + c: a linear sensor; and an amplitude of nought."""
    linear = Misreading(READ, lambda x: np.stack([x, np.ones_like(x)], axis=1))
    np.testing.assert_allclose(linear.true(np.array([0.1, -0.3])), (READ + 0.3) / 1.1, rtol=1e-9)
    np.testing.assert_allclose(
        linear.slopes(np.array([0.1, -0.3])),
        np.stack([(READ + 0.3) / 1.1, np.ones(50)], axis=1) / 1.1,
        rtol=1e-6,
    )
    np.testing.assert_array_equal(linear.true(np.zeros(2)), READ)


def test_a_sensor_that_loses_a_half_beyond_a_knee() -> None:
    knee = Misreading(READ, lambda x: np.maximum(x - 4.0, 0.0)[:, None])
    expected = np.where(READ > 4.0, 4.0 + 2.0 * (READ - 4.0), READ)
    np.testing.assert_allclose(knee.true(np.array([-0.5])), expected, rtol=1e-9)


def test_where_no_truth_fits_the_numbers_stay_finite() -> None:
    """Beyond 12.5 N m no torque reads as much: a (x - x^2 / 50) sensor has its top there."""
    lost = square(np.linspace(5.0, 20.0, 40))
    assert np.isfinite(lost.true(np.array([-0.02]))).all()
    slopes = lost.slopes(np.array([-0.02]))[:, 0]
    assert (slopes >= 0.0).all()
    assert (slopes <= lost.true(np.array([-0.02])) ** 2 / LAW_READING_LEAST * 1.001).all()
    still = square(np.full(7, 3.0))
    np.testing.assert_allclose(still.true(np.array([0.1])), (np.sqrt(2.2) - 1.0) / 0.2, rtol=1e-9)


def law_of(function: str, name: str, robot: int, joint: int, of: str = "") -> LawCandidate:
    variable = joint_variable(of or name, robot, joint)
    return candidate_of(PLACES[f"{name} reading", robot, joint], Term(function, variable), 1.0, 1)


@pytest.mark.parametrize("a", [-0.01, 0.02])
def test_the_error_that_was_put_into_a_reading_comes_out(case, bench, a) -> None:
    """Of a torque that is another than the one at which the bench is linear."""
    true = 1.3 * case.signals.tau[:, 1, 2]
    read = case.signals.minus(
        tau=one_robot(one_joint(case.signals.tau[:, 1, 2] - true - a * true**2, 2), 3, 1)
    )
    error = bench.reading_error(0, law_of("square", "tau", 2, 3), np.array([a]), read)["tau"]
    expected = one_robot(one_joint(a * true**2, 2), 3, 1)
    np.testing.assert_allclose(error, expected, atol=2e-3 * np.abs(expected).max())


@pytest.mark.parametrize("a", [-0.01, 0.02])
def test_columns_against_the_exact_residual(case, bench, a) -> None:
    law = law_of("square", "tau", 2, 3)

    def residual(size: float) -> np.ndarray:
        error = bench.reading_error(0, law, np.array([size]), case.signals)
        return residual_of(case, signals=case.signals.minus(**error))

    slopes, whole = bench.bent(0, law, np.array([a]))
    step = 1e-5
    expected = (residual(a - step) - residual(a + step)) / (2.0 * step)
    np.testing.assert_allclose(slopes[..., 0], expected, atol=5e-3 * np.abs(expected).max())
    expected = (residual(0.0) - residual(a)) / a
    np.testing.assert_allclose(whole[..., 0], expected, atol=5e-3 * np.abs(expected).max())
    # They are not the same, nor are those of the reading itself.
    plain = bench.columns(0, law)[..., 0]
    assert np.abs(slopes[..., 0] - whole[..., 0]).max() > 0.03 * np.abs(whole).max()
    assert np.abs(plain - whole[..., 0]).max() > 0.03 * np.abs(whole).max()


def test_other_laws_are_multiples_of_their_amplitudes(case, bench) -> None:
    ramp = candidate_of(PLACES["tau reading", 2, 3], Term("linear", TIME), 1.0, 1)
    other = candidate_of(PLACES["tau reading", 2, 3], Term("linear", joint_variable("tau", 2, 1)), 1.0, 1)
    rubs = candidate_of(PLACES["gimbal torque", 2, 3], Term("cube", joint_variable("theta", 2, 3)), 1.0, 1)
    for law in (ramp, other, rubs):
        assert bench.bent(0, law, np.array([0.01, 0.0])[: len(law.parameters)]) is None
    assert bench.reading_error(0, rubs, np.array([0.01, 0.0]), case.signals) is None


PER_NM = 0.012


class Square(Reader):
    """Robot 1's second torque sensor reads more the more there is: not the simulator's ``law``."""

    def __init__(self) -> None:
        super().__init__(1, self._bend)

    def _bend(self, readings: RobotReadings, seen: np.ndarray, time: float) -> None:
        tau = readings.tau(seen, 2)
        readings.set_tau(seen, 2, tau + PER_NM * tau**2)


class Hidden(Law):
    cause = "law"

    def readers(self, trial_number):
        return [Square()]


@pytest.mark.slow
def test_the_size_of_a_square_in_a_team() -> None:
    """At the peaks a fifth of the torque: as a law of the reading it came out a tenth too small."""
    rng, nominal, home = np.random.default_rng(31), sensor_preset("nominal"), build_team("a")
    motions = [
        random_vias(home.wrist_home_b, rng, vias=8),
        sphere_motion(home.wrist_home_b, home.X_1i, duration_s=12.0, rng=rng),
    ]
    recordings = []
    for number, motion in enumerate(motions, start=1):
        team = apply_effects(build_team("a", timestep_s=1e-3), [Hidden("tau_1_2", "constant", "time", 0.0)])
        recordings.append(
            measure(run_trial(team, motion, trial_number=number), nominal, rng, name=f"{number}")
        )
    found = diagnose(
        TeamRig.of(recordings, estimate_payload(recordings), read_tolerances(None)), closed_loop=False
    )
    (cause,) = found.causes
    assert isinstance(cause.candidate, LawCandidate)
    assert (cause.candidate.at.key, cause.candidate.term.function) == (("tau reading", 1, 2), "square")
    told = found.rig.effect_parameters(cause.candidate, cause.values, cause.covariance)
    assert told[0]["amplitude"] == pytest.approx(PER_NM, rel=0.02)

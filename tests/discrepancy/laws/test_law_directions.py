"""What an error at every place does to the rows: against the full residual with that error in it."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.laws.candidate import candidate_of
from discrepancy.laws.term import Term
from discrepancy.team.laws.variable import TIME, Variable
from discrepancy.team.laws.places import places_of, twin_of
from estimator.estimate.principal import inertia_parameters
from estimator.rigid_team.residual import Bases
from team_case import residual_of

PLACES = {place.key: place for place in places_of(3)}


def wave(case):
    """A smooth error, so slow that no filter matters."""
    t = case.signals.time
    return 0.3 + np.sin(2.0 * np.pi * 0.31 * t) + 0.5 * np.cos(2.0 * np.pi * 0.17 * t)


def of(bench, place, error):
    """Rows of an error at one component after the other, shape (components, n, C)."""
    directions = bench.directions(0, place)
    moved = bench.at_rows(0, error[:, None], rates=directions.shape[2] == 3)
    return np.einsum("narc,nr->anc", directions, moved[..., 0])


def close(found, expected, share=0.01):
    assert np.abs(expected).max() > 0
    for channels in (slice(0, -6), slice(-6, None)):
        scale = np.abs(expected[:, channels]).max(initial=0.0)
        np.testing.assert_allclose(found[:, channels], expected[:, channels], atol=share * max(scale, 1e-9))


@pytest.mark.parametrize("kind", ["phi", "theta", "tau"])
@pytest.mark.parametrize(("robot", "joint"), [(1, 1), (2, 3)])
def test_readings(case, bench, kind, robot, joint):
    size = 1e-4 if kind != "tau" else 1e-2
    wrong = np.zeros_like(case.signals.phi)
    wrong[:, robot - 1, joint - 1] = size * wave(case)
    changed = case.signals.minus(**{kind: -wrong})
    expected = (residual_of(case, signals=changed) - residual_of(case)) / size
    place = PLACES[f"{kind} reading", robot, joint]
    close(of(bench, place, wave(case))[0], expected, 0.02)
    # The columns of a law there are the same.
    law = candidate_of(place, Term("linear", TIME), 1.0, 1)
    ramp = case.signals.time - case.signals.time[0]
    np.testing.assert_allclose(
        bench.columns(0, law)[..., 0],
        of(bench, place, ramp)[0],
        atol=0.02 * np.abs(of(bench, place, ramp)).max(),
    )


def test_a_torque_beside_the_spring_is_a_reading_the_other_way_round(bench, case):
    place = PLACES["tau reading", 2, 1]
    twin = twin_of(place)
    np.testing.assert_array_equal(of(bench, twin, wave(case)), -of(bench, place, wave(case)))
    assert twin_of(PLACES["phi reading", 1, 1]) is None


def test_mass_and_first_moment_are_those_of_the_regressor(case, bench):
    """A payload that is heavier than it is taken for leaves what a lighter guess of it would."""
    com = case.shared.pi[1:4] / case.shared.pi[0]
    inertia = com @ com * np.eye(3) - np.outer(com, com)
    about_1 = inertia_parameters(inertia)
    ones = np.ones(len(case.signals.time))

    def moved(change):
        return residual_of(case, shared=replace(case.shared, pi=case.shared.pi - change)) - residual_of(case)

    (mass,) = of(bench, PLACES["payload mass", None, None], ones)
    close(mass, moved(np.concatenate([[1.0], com, about_1])), 0.01)
    for k, column in enumerate(of(bench, PLACES["payload centre", None, None], ones)):
        change = np.zeros(10)
        change[1 + k] = 1.0
        expected = moved(change)
        close(column[:, -6:], expected[:, -6:], 0.01)


def test_a_force_on_the_payload(case, bench):
    """Along an axis of {b1}, at the centre of mass: as ``of_wrench`` has it."""
    linear, error = case.linear, wave(case)
    com = case.shared.pi[1:4] / case.shared.pi[0]
    columns = of(bench, PLACES["force on payload", None, None], error)
    for k in range(3):
        along = error[:, None] * linear.data.R_bi[:, 0, k]
        close(columns[k], linear.of_wrench(along, np.cross(com, along)), 0.01)
        close(columns[3 + k][:, -3:], linear.of_wrench(0.0 * along, along)[:, -3:], 0.01)


def test_what_spins_in_the_payload_resists_turning(case, bench):
    """A moment -omega x h; omega from the path that the recording was made of."""
    omega = case.linear.data.twist[:, 0, :3]
    (x, *_) = of(bench, PLACES["payload spin", None, None], np.ones(len(omega)))
    moment = -np.cross(omega, [1.0, 0.0, 0.0])
    close(x[:, -3:], case.linear.of_wrench(np.zeros_like(moment), moment)[:, -3:], 0.02)


@pytest.mark.parametrize("robot", [1, 3])
def test_a_base_that_moves(case, bench, robot):
    """Constant: the pose error with the base taken to be where it is not. Moving: as a motion of the grasp frame."""
    place, step = PLACES["base position", robot, None], 1e-4
    ones = np.ones(len(case.signals.time))
    for k, column in enumerate(of(bench, place, ones)):
        p = case.bases.p.copy()
        p[robot - 1] -= step * case.bases.R[robot - 1][:, k]
        moved = residual_of(case, bases=Bases(case.bases.R, p - p[0]))
        still = residual_of(case, bases=Bases(case.bases.R, case.bases.p - case.bases.p[0]))
        close(column[:, :12], ((moved - still) / step)[:, :12], 0.01)
        along = np.outer(wave(case), case.bases.R[robot - 1][:, k])
        close(of(bench, place, wave(case))[k], case.linear.of_pose(robot - 1, None, along), 0.03)


def test_every_place_and_signal_is_one_that_the_simulator_knows():
    from discrepancy.team.laws.variables import variables_of
    from mocobot_sim.laws.signals import is_signal
    from mocobot_sim.laws.targets import is_target

    assert all(is_signal(variable.name) for variable in variables_of(3))
    assert all(is_target(target) for place in places_of(3) for target in place.targets)
    assert is_target(twin_of(PLACES["tau reading", 1, 1]).targets[0])


def test_signals_are_those_of_the_robots(case, bench):
    phi = bench.signal(0, Variable("phi_2_3", "", "", "rad", "angle"))
    np.testing.assert_allclose(phi, case.signals.phi[:, 1, 2], atol=2e-3)
    rate = bench.signal(0, Variable("phi_rate_2_3", "", "", "rad/s", "rate"))
    np.testing.assert_allclose(rate[50:-50], np.gradient(phi, 0.01)[50:-50], atol=5e-3)
    up = np.array([bench.signal(0, Variable(f"payload_up_{axis}", "", "", "1", "tilt")) for axis in "xyz"])
    np.testing.assert_allclose(np.linalg.norm(up, axis=0), 1.0, atol=1e-9)

"""Every kind of place: what the diagnosis says an error there does, against a simulated trial with that error in it."""

import numpy as np
import pytest

from discrepancy.laws.candidate import candidate_of
from discrepancy.laws.term import Term
from discrepancy.team.laws.effects import effects_of
from discrepancy.team.laws.places import twin_of
from discrepancy.team.laws.variables import payload_felt
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.start import exact_residual
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import read_tolerances
from effect_cases import team_with
from estimator.estimate.payload import estimate_payload
from mocobot_sim.effects.law import Law
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trajectories import random_vias
from mocobot_sim.trial.trial import run_trial

pytestmark = pytest.mark.slow
HUM_HZ = 0.3
SIZES = {
    "tau_1_3": 0.2, "phi_3_1": 1e-3, "theta_2_2": 1e-3, "driven_torque_2_1": 0.2, "gimbal_torque_1_2": 0.3,
    "base_position_1_x": 5e-4, "base_position_3_y": 5e-4, "grasp_position_1_y": 5e-4, "grasp_position_3_x": 5e-4,
    "payload_force_x": 2.0, "payload_moment_y": 1.0, "payload_mass": 0.3, "payload_first_moment_x": 0.05,
    "payload_spin_z": 0.5,
}  # fmt: skip


def recorded(*effects):
    team = team_with("b", *effects)
    log = run_trial(team, random_vias(team.wrist_home_b, np.random.default_rng(3), vias=4), trial_number=1)
    return measure(log, sensor_preset("ideal"), np.random.default_rng(0), name="trial")


@pytest.fixture(scope="module")
def rig():
    clean = recorded()
    return TeamRig.of([clean], estimate_payload([clean]), read_tolerances(None))


@pytest.mark.parametrize("target", SIZES)
def test_simulator_and_diagnosis_mean_the_same_error(rig, target):
    """Sign, axes and size: the change of the whitened rows is the column, to 1 %."""
    linear, bench, size = rig.linear[0], rig.bench, SIZES[target]
    every = [*bench.places, *(twin for twin in map(twin_of, bench.places) if twin is not None)]
    (place,) = (place for place in every if target in place.targets)
    signals = Signals.of(recorded(Law(target, "hum", "time", size, HUM_HZ)))
    moved = exact_residual(signals, linear.shared, linear.bases, linear.arms, linear.reduction)
    error = size * np.sin(2.0 * np.pi * HUM_HZ * signals.time)
    directions = bench.directions(0, place)[:, place.targets.index(target)]
    rates = bench.at_rows(0, error[:, None], rates=directions.shape[1] == 3)[..., 0]
    column, change = (
        bench.white(0, x[..., None])
        for x in (np.einsum("nrc,nr->nc", directions, rates), moved - linear.residual)
    )
    assert np.sum(column * change) / np.sum(column**2) == pytest.approx(1.0, abs=0.01)
    # Robot 1 holds the payload without a weld: the others' bend by 6 urad under the gimbal's 0.3 N m.
    assert np.linalg.norm(change - column) < 0.05 * np.linalg.norm(column)


def test_a_load_on_a_spring_is_simulated_as_it_is_diagnosed(rig):
    """By what is felt where it sits, beside robot 1's grasp: from the payload's turn acceleration, too."""
    linear, bench = rig.linear[0], rig.bench
    (place,) = (place for place in bench.places if place.name == "payload centre")
    inside = {"frequency_hz": 1.2, "damping": 0.5}
    law = candidate_of(place, Term("second_order", payload_felt(), inside), 1.0, 1)
    along, point = np.array([0.6, -0.8, 0.0]), np.array([1.0, 0.8, 0.3])
    drive = np.concatenate([along, np.cross(point, along)])
    values = -5e-3 * np.outer(drive, along).ravel()
    with_load = recorded(*effects_of(law, values))
    moved = exact_residual(Signals.of(with_load), linear.shared, linear.bases, linear.arms, linear.reduction)
    # The load moves the payload, and what it feels by that.
    other = TeamRig.of([with_load], estimate_payload([with_load]), read_tolerances(None)).bench
    columns = bench.white(0, bench.moved(0, bench.directions(0, place), other.values(0, law)))
    column = columns @ values
    change = bench.white(0, (moved - linear.residual)[..., None])[..., 0]
    assert np.sum(column * change) / np.sum(column**2) == pytest.approx(1.0, abs=0.01)
    assert np.linalg.norm(change - column) < 0.05 * np.linalg.norm(column)
    turned = np.arange(9, 18)
    alone = columns[..., turned] @ values[turned]
    assert np.linalg.norm(alone) > 0.1 * np.linalg.norm(column), "the test would not see a turn"

"""Small effects in the simulated team, and the values that the columns of their causes find in what they change."""

import numpy as np
import pytest
from sealed.measure import Bench

from hidden.schedule import Schedule
from mocobot_sim.effects import make_effect

pytestmark = pytest.mark.slow
HOME_M = np.array([0.0, 0.0, 0.355])


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench.of("b", Schedule(randoms=1, vias=7, periodic_s=10.0, hold_s=None))


def test_drag_of_force_and_moment(bench):
    (along, turning), left = bench.fitted(
        make_effect("drag", {"coefficient_Ns_per_m": 0.4, "turning_Nms_per_rad": 0.2})
    )
    assert left < 0.01
    assert along == pytest.approx(0.4, rel=0.03)
    assert turning == pytest.approx(0.2, rel=0.03)


def test_a_single_sensors_lag(bench):
    (time,), left = bench.fitted(make_effect("sensor_lag", {"time_constant_s": 1e-3}, 2, 3))
    assert left < 0.01
    assert time == pytest.approx(1e-3, rel=0.03)


def test_a_tether_of_the_payload(bench):
    stiffness, anchor = 0.5, np.array([0.9, -0.5, 0.8])
    point = bench.ground.p_1c + np.array([0.1, 0.05, 0.0])
    parameters = {"stiffness_N_per_m": stiffness} | {
        f"{name}_{axis}_m": float(value)
        for name, values in (("anchor", anchor), ("point", point))
        for axis, value in zip("xyz", values, strict=True)
    }
    values, left = bench.fitted(make_effect("payload_tether", parameters))
    force = stiffness * (anchor - HOME_M - point)
    assert left < 0.01
    np.testing.assert_allclose(values[:3], force, atol=0.03 * np.linalg.norm(force))
    assert values[3] == pytest.approx(stiffness, rel=0.1)

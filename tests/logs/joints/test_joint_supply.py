"""Supplies that ring where they are read, and motor voltages beside them."""

from __future__ import annotations

import numpy as np
import pytest

from joint_logs import JOINTS, read, write_csv
from mocobot_logs.joints.read import mean_supply

RATE_HZ, VOLTS = 200.0, 7.0
TIME = np.arange(1600) / RATE_HZ
RINGS = np.random.default_rng(0).choice([-1.0, 0.0, 1.0], len(TIME))
"""Readings of a bus at any instant of the drive's period: a volt less, as it is, or a volt more."""
MAP = """
joints = ["hip", "knee", "lift"]
time = { column = "t", unit = "s" }
[channels]
q = { column = "{joint}.pos", unit = "rad" }
duty = { column = "{joint}.duty", unit = "1" }
supply = { column = "volts", unit = "V" }
[joint.lift.channels]
q.unit = "m"
[joint.knee.channels]
duty = false
motor_voltage = { column = "knee.volts", unit = "V" }
"""


def test_a_supply_that_rings_is_read_as_its_mean() -> None:
    # White readings of variance 2/3 V^2 at 200 Hz through about 1 Hz of bandwidth.
    assert np.std(mean_supply(VOLTS + RINGS, RATE_HZ) - VOLTS) < 0.15
    slow = VOLTS - 0.5 * np.sin(2.0 * np.pi * 0.1 * TIME)  # a battery sags
    seen = mean_supply(slow, RATE_HZ)
    np.testing.assert_allclose(seen, slow, atol=0.1)
    np.testing.assert_allclose(seen[400:-400], slow[400:-400], atol=0.01)


def test_a_supply_that_is_steady_stays_as_it_is() -> None:
    np.testing.assert_allclose(mean_supply(np.full(40, VOLTS), 20.0), VOLTS, rtol=1e-12)


def test_a_motors_voltage_does_not_ring_with_the_supply(tmp_path) -> None:
    """What a drive turns into torque is duty times supply: of a voltage that is told, that voltage."""
    told = 3.0 * np.sin(2.0 * TIME)
    values = {"t": TIME, "volts": VOLTS + RINGS, "knee.volts": told}
    values |= {f"{joint}.pos": TIME for joint in JOINTS} | {f"{joint}.duty": told / VOLTS for joint in JOINTS}
    (log,) = read(write_csv(tmp_path / "log.csv", values), MAP)
    assert log.drive.duty is not None
    assert log.drive.supply_V is not None
    np.testing.assert_allclose(log.drive.duty[:, 1] * log.drive.supply_V, told, atol=1e-12)
    np.testing.assert_allclose(log.drive.duty[:, 1], told / VOLTS, atol=0.05 * np.abs(told / VOLTS).max())
    assert log.drive.duty[:, 0] == pytest.approx(told / VOLTS)

"""Joint states of one robot, by the map of its joints."""

from __future__ import annotations

import numpy as np

from bags import joint_state, rosbags_bag, said
from joint_logs import JOINTS, motion, read, torques

TIME = np.arange(1500) / 500.0


def test_joint_states_of_a_bag(tmp_path) -> None:
    """As a controller publishes them: names in another order in every message, another robot's joints between."""
    q, dq = motion(TIME)
    rng = np.random.default_rng(4)
    messages = []
    for k, time in enumerate(TIME):
        order = rng.permutation(4)
        names = np.array([*JOINTS, "gripper"])[order]
        stamp = 1_700_000_000_000_000_000 + round(time * 1e9)
        at = [np.append(values[k], 9.0)[order] for values in (q, dq, torques(TIME))]
        messages.append(
            said("/joint_states", stamp + 77, joint_state(at[0], at[2], stamp, names, velocity=at[1]))
        )
    text = """
joints = ["hip", "knee", "lift"]
[defaults]
topic = "/joint_states"
joint = "{joint}"
[channels]
q = { field = "position", unit = "rad" }
dq = { field = "velocity", unit = "rad/s" }
torque = { field = "effort", unit = "Nm" }
[joint.lift.channels]
q.unit = "m"
dq.unit = "m/s"
torque.unit = "N"
"""
    (log,) = read(rosbags_bag(tmp_path / "bag", messages), text)
    assert log.rate_hz == 500.0
    np.testing.assert_array_equal(log.q, q)
    np.testing.assert_array_equal(log.dq, dq)
    np.testing.assert_array_equal(log.torque, torques(TIME))
